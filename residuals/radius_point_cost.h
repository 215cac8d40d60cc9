// SPDX-License-Identifier: Apache-2.0
//
//   r = m( x0 + sum_t d_t (q_t - q0_t) )
//
// m    a measurement (silhouette_rim.h, contour_match.h, hull_distance.h)
// q_t  samples of the log radius ratio of sweeps; parameter blocks are rows
// d_t  d x_world / d q_t at q0, metres (RestByLogRatio turned by the posture)
#pragma once

#include <ceres/cost_function.h>

#include <memory>
#include <utility>
#include <vector>

#include "residuals/measurement.h"

namespace sweepfit {

// A surface point as a linear function of radius samples.
struct RadiusPoint {
  Eigen::Vector3d point_in_world;  // at q0
  struct Term {
    int block;  // index of the row among this point's rows
    int column;
    double at_linearisation;
    Eigen::Vector3d direction_in_world;
  };
  std::vector<Term> terms;
  std::vector<int> block_sizes;
};

template <typename Measurement>
class RadiusPointCost : public ceres::CostFunction {
 public:
  RadiusPointCost(Measurement measurement,
                  std::shared_ptr<const RadiusPoint> point)
      : measurement_(std::move(measurement)), point_(std::move(point)) {
    set_num_residuals(1);
    for (const int size : point_->block_sizes) {
      mutable_parameter_block_sizes()->push_back(size);
    }
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    Eigen::Vector3d x = point_->point_in_world;
    for (const auto& term : point_->terms) {
      x += term.direction_in_world *
           (parameters[term.block][term.column] - term.at_linearisation);
    }
    const Measured m = measurement_(x);
    residuals[0] = m.residual;
    if (jacobians == nullptr) return true;
    for (size_t b = 0; b < point_->block_sizes.size(); ++b) {
      if (jacobians[b] == nullptr) continue;
      std::fill(jacobians[b], jacobians[b] + point_->block_sizes[b], 0.0);
    }
    for (const auto& term : point_->terms) {
      if (jacobians[term.block] == nullptr) continue;
      jacobians[term.block][term.column] +=
          m.gradient.dot(term.direction_in_world);
    }
    return true;
  }

 private:
  Measurement measurement_;
  std::shared_ptr<const RadiusPoint> point_;
};

}  // namespace sweepfit
