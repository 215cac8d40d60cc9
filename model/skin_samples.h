// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "model/body.h"
#include "model/helper_joints.h"

namespace sweepfit {

// Postures that skin weights are fitted to: how every joint and helper moves
// there, and where the sweeps put every vertex. Numbers of one vertex or joint
// lie side by side over all postures, in single precision: a tenth of a
// micrometre.
class SkinSamples {
 public:
  SkinSamples(const Body& body,
              const std::vector<HelperJoint>& helpers,
              const std::vector<Pose>& poses);

  int num_poses() const { return num_poses_; }
  // Rows are as long as this, a multiple of four; beyond the postures all
  // errors are zero.
  int size() const { return size_; }
  const std::vector<Eigen::Vector3d>& rest() const { return rest_; }

  // Where a joint alone would put the vertex, from where it should be, along
  // one axis of the world, metres: `size()` numbers.
  void Errors(int vertex, int joint, int axis, float* errors) const;

 private:
  const float* Motion(int joint, int axis) const {
    return &motions_[static_cast<std::size_t>(12 * joint + 4 * axis) * size_];
  }
  const float* Target(int vertex, int axis) const {
    return &targets_[static_cast<std::size_t>(3 * vertex + axis) * size_];
  }

  int num_poses_;
  int size_;
  std::vector<Eigen::Vector3d> rest_;
  // Per joint and axis four rows: a row of the rotation, the translation.
  std::vector<float> motions_;
  std::vector<float> targets_;  // per vertex and axis a row
};

}  // namespace sweepfit
