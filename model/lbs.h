// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "model/body.h"
#include "model/helper_joints.h"

namespace sweepfit {

// Joints that move one vertex, at most: what file formats hold.
inline constexpr int kMaxInfluences = 4;

// Linear blend skinning: x = sum_b weight_b T_b T_b,rest^-1 x_rest over at
// most kMaxInfluences joints per vertex; weights sum to 1, heaviest first,
// joint 0 where the weight is 0. Joints from 21 on are the helpers.
struct SkinWeights {
  std::vector<HelperJoint> helpers;
  std::vector<std::array<int, kMaxInfluences>> joint;
  std::vector<std::array<double, kMaxInfluences>> weight;
};

// Fits for files use so many poses and this seed.
inline constexpr int kSkinPoses = 240;
inline constexpr unsigned kSkinSeed = 1;

struct SkinFit {
  SkinWeights weights;
  double rms = 0;  // metres, LBS against sweeps over the sampled poses
  double max = 0;
};

// Fits weights so that LBS follows the sweep deformation over sampled poses
// within the joint limits (SSDR's weight step with fixed bones, Le and Deng
// 2012): non-negative least squares per vertex over the joints and helpers near
// it. The larger an error, the more it counts. Deterministic for a seed.
// `with_helpers` = false: the 21 joints alone.
SkinFit FitSkinWeights(const Body& body,
                       int num_poses,
                       unsigned seed,
                       bool with_helpers = true);

std::vector<Eigen::Vector3d> PoseVerticesLbs(const Body& body,
                                             const SkinWeights& weights,
                                             const Pose& pose);
// The same with given motions of joints and helpers, from given rest vertices.
std::vector<Eigen::Vector3d> SkinVertices(
    const std::vector<Eigen::Vector3d>& rest_vertices,
    const SkinWeights& weights,
    const std::vector<RigidMotion>& motions);

// Dual quaternion skinning with the same weights: for comparison.
std::vector<Eigen::Vector3d> PoseVerticesDualQuaternion(
    const Body& body, const SkinWeights& weights, const Pose& pose);

}  // namespace sweepfit
