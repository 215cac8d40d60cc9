// SPDX-License-Identifier: Apache-2.0
//
//   r = L (x_j(theta, s) - X)        3 residuals
//
// x_j    joint centre by forward kinematics, world, metres
// X      landmark that speaks of this joint (offset from the body's outside
//        already applied), with covariance C = (L^T L)^-1
// theta  pose coordinates, s log bone lengths
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Cholesky>

#include "residuals/kinematic_cache.h"

namespace sweepfit {

class LandmarkResidual : public ceres::CostFunction {
 public:
  LandmarkResidual(int joint,
                   const Eigen::Vector3d& landmark_in_world,
                   const Eigen::Matrix3d& covariance,
                   KinematicCache* cache)
      : point_(JointAsPoint(joint)),
        landmark_in_world_(landmark_in_world),
        whitening_(Eigen::LLT<Eigen::Matrix3d>(covariance.inverse()).matrixU()),
        cache_(cache) {
    set_num_residuals(3);
    mutable_parameter_block_sizes()->push_back(
        cache->angles().num_parameters());
    mutable_parameter_block_sizes()->push_back(kNumLengthGroups);
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const auto& entry = cache_->At(parameters[0], parameters[1]);
    const PointDerivative x = EvaluatePoint(point_,
                                            entry.state,
                                            cache_->angles(),
                                            entry.length_change,
                                            jacobians != nullptr);
    Eigen::Map<Eigen::Vector3d>(residuals, 3) =
        whitening_ * (x.point_in_world - landmark_in_world_);
    if (jacobians == nullptr) return true;
    using RowMajor = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
    if (jacobians[0] != nullptr) {
      Eigen::Map<RowMajor>(jacobians[0], 3, x.by_pose.cols()) =
          whitening_ * x.by_pose;
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<RowMajor> by_length(jacobians[1], 3, kNumLengthGroups);
      by_length.setZero();
      for (int j = 1; j < kNumJoints; ++j) {
        by_length.col(LengthGroup(j)) +=
            whitening_ * x.by_length.col(j) * entry.length[j];
      }
    }
    return true;
  }

 private:
  CarriedPoint point_;
  Eigen::Vector3d landmark_in_world_;
  Eigen::Matrix3d whitening_;
  KinematicCache* cache_;
};

}  // namespace sweepfit
