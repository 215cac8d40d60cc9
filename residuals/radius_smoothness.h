// SPDX-License-Identifier: Apache-2.0
//
// Around a section:  r_k = (q_{k+1} - 2 q_k + q_{k-1}) / sigma
// Along a sweep:     r_k = (a q^-_k - (a + b) q_k + b q^+_k) / sigma
// Symmetry:          r_k = (q_k - q'_{m(k)}) / sigma
//
// q     log radius ratios of one key row (K columns); q^-, q^+ the rows before
//       and after; a, b their inverse spacing, normalised to a mean of 1
// q'    the row of the mirrored sweep, m(k) the mirrored column
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace sweepfit {

// One linear residual vector of some rows: r = sum_i A_i q_i.
class LinearRowsResidual : public ceres::CostFunction {
 public:
  explicit LinearRowsResidual(std::vector<Eigen::MatrixXd> factors)
      : factors_(std::move(factors)) {
    set_num_residuals(static_cast<int>(factors_.front().rows()));
    for (const auto& factor : factors_) {
      mutable_parameter_block_sizes()->push_back(
          static_cast<int>(factor.cols()));
    }
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    Eigen::Map<Eigen::VectorXd> r(residuals, num_residuals());
    r.setZero();
    for (size_t i = 0; i < factors_.size(); ++i) {
      r += factors_[i] *
           Eigen::Map<const Eigen::VectorXd>(parameters[i], factors_[i].cols());
      if (jacobians != nullptr && jacobians[i] != nullptr) {
        using RowMajor = Eigen::
            Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        Eigen::Map<RowMajor>(
            jacobians[i], factors_[i].rows(), factors_[i].cols()) = factors_[i];
      }
    }
    return true;
  }

 private:
  std::vector<Eigen::MatrixXd> factors_;
};

inline ceres::CostFunction* SmoothAroundSection(int num_columns, double sigma) {
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(num_columns, num_columns);
  for (int k = 0; k < num_columns; ++k) {
    factor(k, k) -= 2;
    factor(k, (k + 1) % num_columns) += 1;
    factor(k, (k + num_columns - 1) % num_columns) += 1;
  }
  return new LinearRowsResidual({factor / sigma});
}

// `before` and `after`: distances to the neighbouring rows, any unit.
inline ceres::CostFunction* SmoothAlongSweep(int num_columns,
                                             double before,
                                             double after,
                                             double sigma) {
  const double a = 2 * after / (before + after);
  const double b = 2 * before / (before + after);
  const Eigen::MatrixXd one =
      Eigen::MatrixXd::Identity(num_columns, num_columns) / sigma;
  return new LinearRowsResidual({a * one, -(a + b) * one, b * one});
}

inline ceres::CostFunction* RowSymmetry(const std::vector<int>& mirrored_column,
                                        double sigma) {
  const int n = static_cast<int>(mirrored_column.size());
  Eigen::MatrixXd mirrored = Eigen::MatrixXd::Zero(n, n);
  for (int k = 0; k < n; ++k) mirrored(k, mirrored_column[k]) = -1 / sigma;
  return new LinearRowsResidual(
      {Eigen::MatrixXd::Identity(n, n) / sigma, mirrored});
}

// Symmetry of one section with itself, every pair of columns once.
inline ceres::CostFunction* SectionSymmetry(
    const std::vector<int>& mirrored_column, double sigma) {
  const int n = static_cast<int>(mirrored_column.size());
  std::vector<int> first;
  for (int k = 0; k < n; ++k) {
    if (k < mirrored_column[k]) first.push_back(k);
  }
  Eigen::MatrixXd factor =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(first.size()), n);
  for (size_t i = 0; i < first.size(); ++i) {
    factor(static_cast<Eigen::Index>(i), first[i]) = 1 / sigma;
    factor(static_cast<Eigen::Index>(i), mirrored_column[first[i]]) =
        -1 / sigma;
  }
  return new LinearRowsResidual({factor});
}

}  // namespace sweepfit
