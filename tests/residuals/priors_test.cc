// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <memory>

#include "residuals/bone_length.h"
#include "residuals/landmark.h"
#include "residuals/prior.h"
#include "residuals/radius_smoothness.h"
#include "tests/support/residual_checker.h"
#include "tests/support/test_person.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

BoneStatistics Shank() {
  return {.mean_male = 0.24,
          .mean_female = 0.25,
          .sigma_population = 0.003,
          .sigma_systematic = 0.004};
}

TEST(Anthropometric, HandValueAndChecker) {
  const std::unique_ptr<ceres::CostFunction> cost(
      AnthropometricResidual::Create(3, 0.40, Shank(), 1.6));
  ParameterBlocks at = {std::vector<double>(12, 0.0), {1.6, 0.5}};
  // 0.40 - 0.245 * 1.6 = 8 mm over a sigma of 5 mm per metre of stature.
  EXPECT_NEAR(EvaluateResidual(*cost, at)[0], 0.008 / (0.005 * 1.6), 1e-9);
  at[0][3] = 0.1;
  EXPECT_EQ(CheckDerivatives(*cost, at), "");
  EXPECT_EQ(CheckWeight(*cost, at), "");
  EXPECT_EQ(CheckFinite(*cost, {std::vector<double>(12, 0.0), {0, 0}}), "");
  // At a residual of zero the lengths are still held.
  at = {std::vector<double>(12, 0.0), {0.40 / 0.245, 0.5}};
  EXPECT_NEAR(EvaluateResidual(*cost, at)[0], 0, 1e-9);
  EXPECT_GT(JacobianSize(*cost, at), 1);
}

TEST(TemplateRatio, HandValueAndChecker) {
  const std::unique_ptr<ceres::CostFunction> cost(
      TemplateRatioResidual::Create(5, 0.30, 0.2, 0.05));
  ParameterBlocks at = {std::vector<double>(12, 0.0), {1.5, 0.3}};
  EXPECT_NEAR(EvaluateResidual(*cost, at)[0], 0, 1e-9);
  at[0][5] = std::log(1.1);
  EXPECT_NEAR(EvaluateResidual(*cost, at)[0], std::log(1.1) / 0.05, 1e-9);
  EXPECT_EQ(CheckDerivatives(*cost, at), "");
  EXPECT_GT(JacobianSize(*cost, at), 1);
}

TEST(Landmark, HandValueAndChecker) {
  const Skeleton skeleton = TestSkeleton();
  const JointAngles angles(skeleton);
  KinematicCache cache(skeleton, &angles);
  Eigen::Matrix3d covariance;
  covariance << 4e-4, 1e-4, 0, 1e-4, 2e-4, 0, 0, 0, 1e-4;
  ParameterBlocks at = {RandomCoordinates(angles, 7),
                        std::vector<double>(12, 0.02)};
  const auto& entry = cache.At(at[0].data(), at[1].data());
  const Vector3d joint = entry.state.frames.joint_in_world[kLAnkle];
  const LandmarkResidual exact(kLAnkle, joint, covariance, &cache);
  for (const double r : EvaluateResidual(exact, at)) EXPECT_NEAR(r, 0, 1e-9);
  EXPECT_GT(JacobianSize(exact, at), 1);
  const Vector3d offset(0.01, -0.02, 0.03);
  LandmarkResidual moved(kLAnkle, joint - offset, covariance, &cache);
  double squared = 0;
  for (const double r : EvaluateResidual(moved, at)) squared += r * r;
  EXPECT_NEAR(squared, offset.dot(covariance.inverse() * offset), 1e-9);
  for (unsigned seed = 0; seed < 5; ++seed) {
    at[0] = RandomCoordinates(angles, seed, 2);
    EXPECT_EQ(CheckDerivatives(moved, at), "");
  }
  EXPECT_EQ(CheckWeight(moved, at), "");
  std::fill(at[0].begin(), at[0].end(), 0.0);
  EXPECT_EQ(CheckFinite(moved, at), "");
}

TEST(Prior, HandValueAndChecker) {
  const PriorResidual cost(Eigen::Vector2d(1, 2), Eigen::Vector2d(0.5, 4));
  EXPECT_EQ(EvaluateResidual(cost, {{2, 0}}), (std::vector<double>{2.0, -0.5}));
  EXPECT_EQ(CheckDerivatives(cost, {{2, 0}}), "");
  EXPECT_GT(JacobianSize(cost, {{1, 2}}), 0.2);
}

TEST(RadiusSmoothness, StraightLinesAreFree) {
  const std::unique_ptr<ceres::CostFunction> along(
      SmoothAlongSweep(3, 0.1, 0.3, 0.05));
  // A linear ramp over uneven rows.
  for (const double r : EvaluateResidual(
           *along, {{0, 0, 0}, {0.1, 0.1, 0.1}, {0.4, 0.4, 0.4}})) {
    EXPECT_NEAR(r, 0, 1e-12);
  }
  EXPECT_NEAR(EvaluateResidual(*along, {{0, 0, 0}, {1, 0, 0}, {0, 0, 0}})[0],
              -2 / 0.05,
              1e-9);
  EXPECT_EQ(CheckDerivatives(*along, {{.1, .2, .3}, {.3, 0, 1}, {1, 0, 2}}),
            "");
}

TEST(RadiusSmoothness, RoundSectionsAreFree) {
  const std::unique_ptr<ceres::CostFunction> around(
      SmoothAroundSection(4, 0.1));
  for (const double r : EvaluateResidual(*around, {{.2, .2, .2, .2}})) {
    EXPECT_NEAR(r, 0, 1e-12);
  }
  EXPECT_NEAR(EvaluateResidual(*around, {{1, 0, 0, 0}})[3], 10, 1e-9);
  EXPECT_EQ(CheckDerivatives(*around, {{.1, .4, .2, 0}}), "");
}

TEST(RadiusSmoothness, MirroredRowsAreFree) {
  const std::unique_ptr<ceres::CostFunction> symmetry(
      RowSymmetry({0, 3, 2, 1}, 0.5));
  for (const double r :
       EvaluateResidual(*symmetry, {{1, 2, 3, 4}, {1, 4, 3, 2}})) {
    EXPECT_NEAR(r, 0, 1e-12);
  }
  EXPECT_NEAR(
      EvaluateResidual(*symmetry, {{1, 2, 3, 4}, {1, 2, 3, 4}})[1], -4, 1e-9);
  EXPECT_EQ(CheckDerivatives(*symmetry, {{1, 2, 3, 4}, {1, 2, 0, 2}}), "");
  EXPECT_EQ(CheckWeight(*symmetry, {{1, 2, 3, 4}, {1, 2, 0, 2}}), "");
}

}  // namespace
}  // namespace sweepfit
