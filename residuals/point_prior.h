// SPDX-License-Identifier: Apache-2.0
//
//   r = L (X - X_0)        3 residuals
//
// X    a point in the world, metres (the parameter block)
// X_0  where something else than the pictures puts it, such as a section of
//      the volume, with covariance C = (L^T L)^-1
#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

namespace sweepfit {

class PointPriorResidual : public ceres::SizedCostFunction<3, 3> {
 public:
  PointPriorResidual(const Eigen::Vector3d& point_in_world,
                     const Eigen::Matrix3d& covariance)
      : point_in_world_(point_in_world),
        whitening_(
            Eigen::LLT<Eigen::Matrix3d>(covariance.inverse()).matrixU()) {}

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    Eigen::Map<Eigen::Vector3d>(residuals, 3) =
        whitening_ * (Eigen::Vector3d(parameters[0]) - point_in_world_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
      Eigen::Map<RowMajor>(jacobians[0], 3, 3) = whitening_;
    }
    return true;
  }

 private:
  Eigen::Vector3d point_in_world_;
  Eigen::Matrix3d whitening_;
};

}  // namespace sweepfit
