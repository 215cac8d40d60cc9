// SPDX-License-Identifier: Apache-2.0
//
//   r = m( x(theta, s, g) )
//
// m      a measurement (silhouette_rim.h, contour_match.h, hull_distance.h)
// theta  pose coordinates (JointAngles), s 12 log bone lengths
// g      coarse girth parameters: log ratios of groups of radii
// x      sum_b w_b (x_b + R_b (p_b + sum_k D_bk g_k)) + stretch, see
//        CarriedPoint; exact at the linearisation, where the body was posed by
//        its sweeps
#pragma once

#include <ceres/cost_function.h>

#include <memory>
#include <utility>
#include <vector>

#include "residuals/kinematic_cache.h"
#include "residuals/measurement.h"

namespace sweepfit {

// A surface point that also depends on girth parameters.
struct ShapedPoint {
  CarriedPoint carried;
  // (parameter index, d x_world / d g at the linearisation) and the joints'
  // orientation there.
  std::vector<std::pair<int, Eigen::Vector3d>> girth;
  std::array<Eigen::Matrix3d, 4> world_from_joint;
  std::vector<double> girth_at_linearisation;
};

template <typename Measurement>
class PosePointCost : public ceres::CostFunction {
 public:
  PosePointCost(Measurement measurement,
                std::shared_ptr<const ShapedPoint> point,
                KinematicCache* cache,
                int num_girths)
      : measurement_(std::move(measurement)),
        point_(std::move(point)),
        cache_(cache) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(
        cache->angles().num_parameters());
    mutable_parameter_block_sizes()->push_back(kNumLengthGroups);
    if (num_girths > 0) mutable_parameter_block_sizes()->push_back(num_girths);
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const auto& entry = cache_->At(parameters[0], parameters[1]);
    CarriedPoint carried = point_->carried;
    for (const auto& [k, direction] : point_->girth) {
      const double change =
          parameters[2][k] - point_->girth_at_linearisation[k];
      for (int b = 0; b < 4; ++b) {
        if (carried.weight[b] == 0) continue;
        carried.point_in_joint[b] +=
            change * (point_->world_from_joint[b].transpose() * direction);
      }
    }
    const PointDerivative x = EvaluatePoint(carried,
                                            entry.state,
                                            cache_->angles(),
                                            entry.length_change,
                                            jacobians != nullptr);
    const Measured m = measurement_(x.point_in_world);
    residuals[0] = m.residual;
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::RowVectorXd>(jacobians[0], x.by_pose.cols()) =
          m.gradient.transpose() * x.by_pose;
    }
    if (jacobians[1] != nullptr) {
      std::fill(jacobians[1], jacobians[1] + kNumLengthGroups, 0.0);
      for (int j = 1; j < kNumJoints; ++j) {
        jacobians[1][LengthGroup(j)] +=
            m.gradient.dot(x.by_length.col(j)) * entry.length[j];
      }
    }
    if (parameter_block_sizes().size() > 2 && jacobians[2] != nullptr) {
      std::fill(jacobians[2], jacobians[2] + parameter_block_sizes()[2], 0.0);
      for (const auto& [k, direction] : point_->girth) {
        for (int b = 0; b < 4; ++b) {
          if (carried.weight[b] == 0) continue;
          jacobians[2][k] +=
              carried.weight[b] *
              m.gradient.dot(
                  entry.state.frames.world_from_joint[carried.joint[b]] *
                  (point_->world_from_joint[b].transpose() * direction));
        }
      }
    }
    return true;
  }

 private:
  Measurement measurement_;
  std::shared_ptr<const ShapedPoint> point_;
  KinematicCache* cache_;
};

}  // namespace sweepfit
