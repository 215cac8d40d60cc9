// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "experiments/metrics.h"

namespace sweepfit {

// A landmark of landmarks.json that speaks of a joint, against its true centre.
struct LandmarkScore {
  std::string name;
  std::string source;  // "contour", "volume", "both" or "keypoint"
  int num_views = 0;
  Eigen::Vector3d error_in_world;  // found less true, metres
  // e^T C^-1 e / 3 with the stated covariance C: 1 on average where that is
  // honest, less where it is too cautious.
  double chi2_per_dof = 0;
};

// Those of one pose. InputError when the file cannot be read or lacks the pose.
std::vector<LandmarkScore> ScoreLandmarks(
    const std::filesystem::path& landmarks_json,
    const std::string& pose_name,
    const JointPositions& truth);

}  // namespace sweepfit
