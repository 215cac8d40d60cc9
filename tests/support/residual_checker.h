// SPDX-License-Identifier: Apache-2.0
//
// The checks that every residual must pass.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/gradient_checker.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace sweepfit {

using ParameterBlocks = std::vector<std::vector<double>>;

inline std::vector<double> EvaluateResidual(const ceres::CostFunction& cost,
                                            const ParameterBlocks& at) {
  std::vector<const double*> pointers;
  for (const auto& block : at) pointers.push_back(block.data());
  std::vector<double> residuals(cost.num_residuals());
  cost.Evaluate(pointers.data(), residuals.data(), nullptr);
  return residuals;
}

// Largest absolute value of the Jacobian over all blocks.
inline double JacobianSize(const ceres::CostFunction& cost,
                           const ParameterBlocks& at) {
  std::vector<const double*> pointers;
  std::vector<std::vector<double>> jacobians;
  std::vector<double*> jacobian_pointers;
  for (const auto& block : at) {
    pointers.push_back(block.data());
    jacobians.emplace_back(block.size() * cost.num_residuals());
  }
  for (auto& jacobian : jacobians) jacobian_pointers.push_back(jacobian.data());
  std::vector<double> residuals(cost.num_residuals());
  cost.Evaluate(pointers.data(), residuals.data(), jacobian_pointers.data());
  double largest = 0;
  for (const auto& jacobian : jacobians) {
    for (const double value : jacobian) {
      largest = std::max(largest, std::abs(value));
    }
  }
  return largest;
}

// Analytic (or automatic) against numeric derivatives at a point of the
// parameter space. Empty when they agree, otherwise what differs.
inline std::string CheckDerivatives(const ceres::CostFunction& cost,
                                    const ParameterBlocks& at,
                                    double relative_tolerance = 1e-5) {
  ceres::NumericDiffOptions numeric;
  numeric.ridders_relative_initial_step_size = 1e-3;
  ceres::GradientChecker checker(
      &cost,
      static_cast<const std::vector<const ceres::Manifold*>*>(nullptr),
      numeric);
  std::vector<const double*> pointers;
  for (const auto& block : at) pointers.push_back(block.data());
  ceres::GradientChecker::ProbeResults results;
  if (!checker.Probe(pointers.data(), relative_tolerance, &results) &&
      results.jacobians.empty()) {
    return results.error_log;
  }
  // Ceres compares every entry by its own size, so an exact zero against
  // rounding noise would fail; entries far below the largest one are compared
  // by that.
  double largest = 0;
  for (const auto& jacobian : results.jacobians) {
    largest = std::max(largest, jacobian.cwiseAbs().maxCoeff());
  }
  for (size_t b = 0; b < results.jacobians.size(); ++b) {
    const auto& given = results.jacobians[b];
    const auto& measured = results.numeric_jacobians[b];
    for (int r = 0; r < given.rows(); ++r) {
      for (int c = 0; c < given.cols(); ++c) {
        const double size = std::max(
            {std::abs(given(r, c)), std::abs(measured(r, c)), 1e-3 * largest});
        const double error = std::abs(given(r, c) - measured(r, c));
        if (!(error <= relative_tolerance * size)) {
          return "block " + std::to_string(b) + " residual " +
                 std::to_string(r) + " parameter " + std::to_string(c) + ": " +
                 std::to_string(given(r, c)) + " given, " +
                 std::to_string(measured(r, c)) + " measured";
        }
      }
    }
  }
  return "";
}

// A weight w on squared residuals must scale the cost by w. Empty when it does.
inline std::string CheckWeight(ceres::CostFunction& cost, ParameterBlocks at) {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(options);
  std::vector<double*> pointers;
  for (auto& block : at) pointers.push_back(block.data());
  const auto plain = problem.AddResidualBlock(&cost, nullptr, pointers);
  double once = 0, weighted = 0;
  problem.EvaluateResidualBlock(plain, true, &once, nullptr, nullptr);
  double sum = 0;
  for (const double value : EvaluateResidual(cost, at)) sum += value * value;
  ceres::ScaledLoss loss(nullptr, 4.0, ceres::DO_NOT_TAKE_OWNERSHIP);
  double rho[3];
  loss.Evaluate(2 * once, rho);
  weighted = 0.5 * rho[0];
  if (std::abs(once - 0.5 * sum) > 1e-9 * (1 + once)) return "cost != r^2 / 2";
  if (std::abs(weighted - 4 * once) > 1e-9 * (1 + once)) {
    return "weight does not scale the cost";
  }
  return "";
}

// Residuals must stay finite at degenerate parameters.
inline std::string CheckFinite(const ceres::CostFunction& cost,
                               const ParameterBlocks& at) {
  for (const double value : EvaluateResidual(cost, at)) {
    if (!std::isfinite(value)) return "residual is not finite";
  }
  if (!std::isfinite(JacobianSize(cost, at))) return "Jacobian is not finite";
  return "";
}

}  // namespace sweepfit
