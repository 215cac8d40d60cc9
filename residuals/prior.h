// SPDX-License-Identifier: Apache-2.0
//
//   r_i = (p_i - usual_i) / sigma_i
//
// A diagonal Gaussian prior on one parameter block: joint angles (radians),
// stature (metres) and sex, girth and radius log ratios.
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>

namespace sweepfit {

class PriorResidual : public ceres::CostFunction {
 public:
  PriorResidual(const Eigen::VectorXd& usual, const Eigen::VectorXd& sigma)
      : usual_(usual), inverse_sigma_(sigma.cwiseInverse()) {
    set_num_residuals(static_cast<int>(usual.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(usual.size()));
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const int n = num_residuals();
    Eigen::Map<Eigen::VectorXd>(residuals, n) =
        (Eigen::Map<const Eigen::VectorXd>(parameters[0], n) - usual_)
            .cwiseProduct(inverse_sigma_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      using RowMajor = Eigen::
          Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      Eigen::Map<RowMajor>(jacobians[0], n, n) = inverse_sigma_.asDiagonal();
    }
    return true;
  }

 private:
  Eigen::VectorXd usual_;
  Eigen::VectorXd inverse_sigma_;
};

}  // namespace sweepfit
