// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "model/joint_angles.h"

namespace sweepfit {

// Forward kinematics of one pose, evaluated once per point of the parameter
// space however many residuals ask. For one thread.
//
// Parameters: the pose (JointAngles), and 12 logarithms s_g of bone lengths
// against a base skeleton: l = l_base exp(s_g).
class KinematicCache {
 public:
  KinematicCache(Skeleton base, const JointAngles* angles)
      : base_(std::move(base)), angles_(angles) {}

  struct Entry {
    KinematicState state;
    std::array<double, kNumJoints> length;
    std::array<double, kNumJoints> length_change;
  };

  const Entry& At(const double* pose, const double* log_length) {
    const int n = angles_->num_parameters();
    if (!key_.empty() && std::equal(pose, pose + n, key_.begin()) &&
        std::equal(
            log_length, log_length + kNumLengthGroups, key_.begin() + n)) {
      return entry_;
    }
    Skeleton skeleton = base_;
    entry_.length[kRoot] = entry_.length_change[kRoot] = 0;
    for (int j = 1; j < kNumJoints; ++j) {
      skeleton.length[j] *= std::exp(log_length[LengthGroup(j)]);
      entry_.length[j] = skeleton.length[j];
      entry_.length_change[j] = skeleton.length[j] - base_.length[j];
    }
    entry_.state = EvaluateKinematics(skeleton, *angles_, pose);
    key_.assign(pose, pose + n);
    key_.insert(key_.end(), log_length, log_length + kNumLengthGroups);
    return entry_;
  }

  const JointAngles& angles() const { return *angles_; }
  const Skeleton& base() const { return base_; }

 private:
  Skeleton base_;
  const JointAngles* angles_;
  std::vector<double> key_;
  Entry entry_;
};

}  // namespace sweepfit
