// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "residuals/point_prior.h"
#include "residuals/reprojection.h"
#include "tests/support/residual_checker.h"

namespace sweepfit {
namespace {

Camera TestCamera() {
  Camera camera;
  camera.K << 800, 2, 320, 0, 780, 240, 0, 0, 1;
  camera.camera_from_world =
      Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, -1).normalized())
          .toRotationMatrix();
  camera.world_in_camera = {0.1, -0.2, 3};
  return camera;
}

TEST(Reprojection, HandValueAndChecker) {
  Camera plain;
  plain.K << 100, 0, 50, 0, 100, 40, 0, 0, 1;
  Eigen::Matrix2d whitening;
  whitening << 0.5, 0, 0, 0.25;
  const ReprojectionResidual hand(plain, {60, 40}, whitening);
  // (0.4, 0.2, 2) projects to (70, 50).
  EXPECT_EQ(EvaluateResidual(hand, {{0.4, 0.2, 2}}),
            (std::vector<double>{5, 2.5}));

  const Camera camera = TestCamera();
  const Eigen::Vector3d point(0.2, 0.3, 0.1);
  whitening << 0.5, 0.1, -0.2, 0.3;
  ReprojectionResidual cost(camera, {300, 200}, whitening);
  const ParameterBlocks at = {{point.x(), point.y(), point.z()}};
  EXPECT_EQ(CheckDerivatives(cost, at), "");
  EXPECT_EQ(CheckWeight(cost, at), "");
  const ReprojectionResidual exact(
      camera, camera.ProjectPinhole(point), whitening);
  for (const double r : EvaluateResidual(exact, at)) EXPECT_NEAR(r, 0, 1e-9);
  EXPECT_GT(JacobianSize(exact, at), 1);
}

TEST(Reprojection, AcrossALineOnly) {
  const Camera camera = TestCamera();
  Eigen::Matrix2d whitening;
  whitening << 0.6, 0.8, 0, 0;
  ReprojectionResidual cost(camera, {300, 200}, whitening);
  const ParameterBlocks at = {{0.2, 0.3, 0.1}};
  EXPECT_EQ(EvaluateResidual(cost, at)[1], 0);
  EXPECT_EQ(CheckDerivatives(cost, at), "");
}

TEST(Reprojection, BehindTheCameraIsBadAndFlat) {
  Camera camera;
  camera.K << 100, 0, 50, 0, 100, 40, 0, 0, 1;
  ReprojectionResidual cost(camera, {60, 40}, Eigen::Matrix2d::Identity());
  for (const double z : {0.0, -1.0}) {
    const ParameterBlocks at = {{0.1, 0.2, z}};
    EXPECT_EQ(EvaluateResidual(cost, at)[0], ReprojectionResidual::kBehind);
    EXPECT_EQ(JacobianSize(cost, at), 0);
    EXPECT_EQ(CheckFinite(cost, at), "");
  }
}

TEST(PointPrior, HandValueAndChecker) {
  PointPriorResidual diagonal({1, 2, 3},
                              Eigen::Vector3d(4, 1, 0.25).asDiagonal());
  EXPECT_EQ(EvaluateResidual(diagonal, {{3, 2, 4}}),
            (std::vector<double>{1, 0, 2}));
  Eigen::Matrix3d covariance;
  covariance << 4e-4, 1e-4, 0, 1e-4, 2e-4, 0, 0, 0, 1e-4;
  PointPriorResidual cost({1, 2, 3}, covariance);
  const ParameterBlocks at = {{1.01, 1.98, 3.03}};
  double squared = 0;
  for (const double r : EvaluateResidual(cost, at)) squared += r * r;
  const Eigen::Vector3d offset(0.01, -0.02, 0.03);
  EXPECT_NEAR(squared, offset.dot(covariance.inverse() * offset), 1e-9);
  EXPECT_EQ(CheckDerivatives(cost, at), "");
  EXPECT_EQ(CheckWeight(cost, at), "");
  EXPECT_EQ(CheckFinite(cost, {{0, 0, 0}}), "");
  EXPECT_GT(JacobianSize(cost, {{1, 2, 3}}), 1);
}

}  // namespace
}  // namespace sweepfit
