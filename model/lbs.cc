// SPDX-License-Identifier: Apache-2.0
#include "model/lbs.h"

#include <glog/logging.h>

namespace sweepfit {
namespace {

Eigen::Vector3d Skin(const std::vector<RigidMotion>& motions,
                     const std::array<int, kMaxInfluences>& joint,
                     const std::array<double, kMaxInfluences>& weight,
                     const Eigen::Vector3d& rest) {
  Eigen::Vector3d posed = Eigen::Vector3d::Zero();
  for (int i = 0; i < kMaxInfluences; ++i) {
    if (weight[i] == 0) continue;
    posed += weight[i] * (motions[joint[i]] * rest);
  }
  return posed;
}

void CheckSizes(const SkinWeights& weights, std::size_t num_vertices) {
  CHECK_EQ(weights.joint.size(), num_vertices);
  CHECK_EQ(weights.weight.size(), num_vertices);
}

}  // namespace

std::vector<Eigen::Vector3d> SkinVertices(
    const std::vector<Eigen::Vector3d>& rest_vertices,
    const SkinWeights& weights,
    const std::vector<RigidMotion>& motions) {
  CheckSizes(weights, rest_vertices.size());
  std::vector<Eigen::Vector3d> posed(rest_vertices.size());
  for (std::size_t v = 0; v < rest_vertices.size(); ++v) {
    posed[v] =
        Skin(motions, weights.joint[v], weights.weight[v], rest_vertices[v]);
  }
  return posed;
}

std::vector<Eigen::Vector3d> PoseVerticesLbs(const Body& body,
                                             const SkinWeights& weights,
                                             const Pose& pose) {
  return SkinVertices(RestVertices(body),
                      weights,
                      JointMotions(body, weights.helpers).At(pose));
}

std::vector<Eigen::Vector3d> PoseVerticesDualQuaternion(
    const Body& body, const SkinWeights& weights, const Pose& pose) {
  std::vector<Eigen::Vector3d> vertices = RestVertices(body);
  CheckSizes(weights, vertices.size());
  const std::vector<RigidMotion> motions =
      JointMotions(body, weights.helpers).At(pose);
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    MotionBlend blend;
    for (int i = 0; i < kMaxInfluences; ++i) {
      if (weights.weight[v][i] == 0) continue;
      blend.Add(weights.weight[v][i], motions[weights.joint[v][i]]);
    }
    vertices[v] = blend.Normalized() * vertices[v];
  }
  return vertices;
}

}  // namespace sweepfit
