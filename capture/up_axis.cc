// SPDX-License-Identifier: Apache-2.0
#include "capture/up_axis.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace sweepfit {

UpEstimate EstimateUp(const std::vector<Camera>& cameras) {
  // Tripods and walls keep cameras within a few degrees.
  constexpr double kMaxRoll = 0.26;
  // Of the x axes: how much of the second direction there must be.
  constexpr double kMinSpread = 0.02;
  UpEstimate estimate;
  if (cameras.empty()) return estimate;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  Eigen::Vector3d tops = Eigen::Vector3d::Zero();
  for (const Camera& camera : cameras) {
    const Eigen::Vector3d x = camera.camera_from_world.row(0);
    scatter += x * x.transpose();
    tops -= camera.camera_from_world.row(1);
  }
  scatter /= static_cast<double>(cameras.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  estimate.up_in_world = eigen.eigenvectors().col(0);
  if (estimate.up_in_world.dot(tops) < 0) estimate.up_in_world *= -1;
  estimate.roll =
      std::asin(std::sqrt(std::clamp(eigen.eigenvalues()[0], 0.0, 1.0)));
  estimate.sound =
      eigen.eigenvalues()[1] > kMinSpread && estimate.roll < kMaxRoll;
  return estimate;
}

Eigen::Matrix3d RotationToYUp(const Eigen::Vector3d& up) {
  const Eigen::Vector3d unit = up.normalized();
  Eigen::Matrix3d rotation;
  if (unit == Eigen::Vector3d::UnitZ()) {
    rotation << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  } else if (unit == -Eigen::Vector3d::UnitY()) {
    rotation << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  } else if (unit == -Eigen::Vector3d::UnitZ()) {
    rotation << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  } else {
    rotation =
        Eigen::Quaterniond::FromTwoVectors(unit, Eigen::Vector3d::UnitY())
            .toRotationMatrix();
  }
  return rotation;
}

}  // namespace sweepfit
