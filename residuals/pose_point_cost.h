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

#include <algorithm>
#include <array>
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
    const CarriedPoint& carried = point_->carried;
    Eigen::Vector3d change_in_world = Eigen::Vector3d::Zero();
    for (const auto& [k, direction] : point_->girth) {
      change_in_world +=
          (parameters[2][k] - point_->girth_at_linearisation[k]) * direction;
    }
    std::array<Eigen::Vector3d, 4> point_in_joint = carried.point_in_joint;
    for (int b = 0; b < 4 && !point_->girth.empty(); ++b) {
      if (carried.weight[b] == 0) continue;
      point_in_joint[b] +=
          point_->world_from_joint[b].transpose() * change_in_world;
    }
    const PosedPoint x(
        carried, point_in_joint, entry.state, entry.length_change);
    const Measured m = measurement_(x.in_world());
    residuals[0] = m.residual;
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      x.ByPose(m.gradient, cache_->angles(), jacobians[0]);
    }
    if (jacobians[1] != nullptr) {
      std::fill(jacobians[1], jacobians[1] + kNumLengthGroups, 0.0);
      const std::array<double, kNumJoints> by_length = x.ByLength(m.gradient);
      for (int j = 1; j < kNumJoints; ++j) {
        jacobians[1][LengthGroup(j)] += by_length[j] * entry.length[j];
      }
    }
    if (parameter_block_sizes().size() > 2 && jacobians[2] != nullptr) {
      std::fill(jacobians[2], jacobians[2] + parameter_block_sizes()[2], 0.0);
      // The gradient in the frame of the linearisation.
      Eigen::Vector3d back = Eigen::Vector3d::Zero();
      for (int b = 0; b < 4; ++b) {
        if (carried.weight[b] == 0) continue;
        back += carried.weight[b] *
                (point_->world_from_joint[b] *
                 (entry.state.frames.world_from_joint[carried.joint[b]]
                      .transpose() *
                  m.gradient));
      }
      for (const auto& [k, direction] : point_->girth) {
        jacobians[2][k] += back.dot(direction);
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
