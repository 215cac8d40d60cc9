// SPDX-License-Identifier: Apache-2.0
//
// The tester is tested: a residual with a wrong derivative must be refused.
#include "tests/support/residual_checker.h"

#include <ceres/sized_cost_function.h>
#include <gtest/gtest.h>

namespace sweepfit {
namespace {

// r = x^2 - 3y, with an error in dr/dx.
class Parabola : public ceres::SizedCostFunction<1, 1, 1> {
 public:
  explicit Parabola(double error) : error_(error) {}
  bool Evaluate(double const* const* p,
                double* residuals,
                double** jacobians) const override {
    residuals[0] = p[0][0] * p[0][0] - 3 * p[1][0];
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      jacobians[0][0] = 2 * p[0][0] + error_;
    }
    if (jacobians != nullptr && jacobians[1] != nullptr) jacobians[1][0] = -3;
    return true;
  }

 private:
  double error_;
};

TEST(ResidualChecker, AcceptsRightAndRefusesWrongDerivatives) {
  EXPECT_EQ(CheckDerivatives(Parabola(0), {{1.5}, {2}}), "");
  EXPECT_NE(CheckDerivatives(Parabola(1e-3), {{1.5}, {2}}), "");
}

TEST(ResidualChecker, SeesNonFiniteValues) {
  EXPECT_EQ(CheckFinite(Parabola(0), {{1}, {2}}), "");
  EXPECT_NE(CheckFinite(Parabola(0), {{std::nan("")}, {2}}), "");
}

TEST(ResidualChecker, ComparesCosts) {
  Parabola parabola(0);
  EXPECT_EQ(CheckWeight(parabola, {{1.5}, {2}}), "");
}

}  // namespace
}  // namespace sweepfit
