// SPDX-License-Identifier: Apache-2.0
//
//   r = W (pi(X) - m)        2 residuals
//
// X   a point in the world, metres (the parameter block)
// pi  pinhole projection of one camera
// m   where the point was seen, pinhole pixels
// W   whitening, 1 / pixels: W^T W is the inverse covariance of m, or of rank 1
//     when the picture fixes the point across a line only (the middle of a
//     limb)
//
// A point behind the camera has the constant residual (kBehind, 0) and no
// gradient: no view can see it there.
#pragma once

#include <ceres/sized_cost_function.h>

#include <utility>

#include "residuals/measurement.h"

namespace sweepfit {

class ReprojectionResidual : public ceres::SizedCostFunction<2, 3> {
 public:
  static constexpr double kBehind = 1000;

  ReprojectionResidual(const Camera& camera,
                       const Eigen::Vector2d& pinhole_pixel,
                       const Eigen::Matrix2d& whitening)
      : camera_(&camera),
        pinhole_pixel_(pinhole_pixel),
        whitening_(whitening) {}

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const Eigen::Vector3d point(parameters[0]);
    const auto projection = ProjectWithDerivative(*camera_, point);
    Eigen::Map<Eigen::Vector2d> residual(residuals);
    using JacobianMap =
        Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>;
    if (!projection) {
      residual = Eigen::Vector2d(kBehind, 0);
      if (jacobians != nullptr && jacobians[0] != nullptr) {
        JacobianMap(jacobians[0]).setZero();
      }
      return true;
    }
    residual = whitening_ * (projection->pixel - pinhole_pixel_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      JacobianMap by_point(jacobians[0]);
      by_point = whitening_ * projection->pixel_by_world;
    }
    return true;
  }

 private:
  const Camera* camera_;
  Eigen::Vector2d pinhole_pixel_;
  Eigen::Matrix2d whitening_;
};

}  // namespace sweepfit
