// SPDX-License-Identifier: Apache-2.0
#include "model/skin_samples.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace sweepfit {
namespace {

// Postures that one thread poses before it sorts the vertices into their rows:
// half a cache line of each.
constexpr int kBlock = 8;

using ConstRow = Eigen::Map<const Eigen::ArrayXf>;
using Row = Eigen::Map<Eigen::ArrayXf>;

}  // namespace

SkinSamples::SkinSamples(const Body& body,
                         const std::vector<HelperJoint>& helpers,
                         const std::vector<Pose>& poses)
    : num_poses_(static_cast<int>(poses.size())),
      size_((num_poses_ + kBlock - 1) / kBlock * kBlock) {
  const BodyDeformer deformer(body);
  rest_ = deformer.rest_vertices();
  const JointMotions joint_motions(body, helpers, deformer);
  const std::size_t num_joints = kNumJoints + helpers.size();
  motions_.assign(12 * num_joints * size_, 0);
  targets_.assign(3 * rest_.size() * size_, 0);
  tbb::parallel_for(0, size_ / kBlock, [&](int block) {
    const int first = block * kBlock;
    const int count = std::min(kBlock, num_poses_ - first);
    std::vector<std::vector<Eigen::Vector3d>> posed(count);
    for (int p = 0; p < count; ++p) {
      posed[p] = deformer.Vertices(poses[first + p]);
      const std::vector<RigidMotion> motions =
          joint_motions.At(poses[first + p], posed[p]);
      for (std::size_t j = 0; j < num_joints; ++j) {
        float* at = &motions_[12 * j * size_ + first + p];
        for (int axis = 0; axis < 3; ++axis) {
          for (int c = 0; c < 4; ++c) {
            *at = static_cast<float>(c < 3 ? motions[j].rotation(axis, c)
                                           : motions[j].translation[axis]);
            at += size_;
          }
        }
      }
    }
    for (std::size_t v = 0; v < rest_.size(); ++v) {
      for (int axis = 0; axis < 3; ++axis) {
        float* at = &targets_[(3 * v + axis) * size_ + first];
        for (int p = 0; p < count; ++p) {
          at[p] = static_cast<float>(posed[p][v][axis]);
        }
      }
    }
  });
}

void SkinSamples::Errors(int vertex, int joint, int axis, float* errors) const {
  const Eigen::Vector3f x = rest_[vertex].cast<float>();
  const float* motion = Motion(joint, axis);
  Row(errors, size_) = x.x() * ConstRow(motion, size_) +
                       x.y() * ConstRow(motion + size_, size_) +
                       x.z() * ConstRow(motion + 2 * size_, size_) +
                       (ConstRow(motion + 3 * size_, size_) -
                        ConstRow(Target(vertex, axis), size_));
}

}  // namespace sweepfit
