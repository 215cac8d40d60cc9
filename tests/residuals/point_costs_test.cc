// SPDX-License-Identifier: Apache-2.0
//
// Measurements of surface points joined with what moves the points.
#include <gtest/gtest.h>

#include <memory>

#include "residuals/contour_match.h"
#include "residuals/hull_distance.h"
#include "residuals/pose_point_cost.h"
#include "residuals/radius_point_cost.h"
#include "residuals/silhouette_rim.h"
#include "residuals/surface_point.h"
#include "tests/support/residual_checker.h"
#include "tests/support/test_person.h"

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Camera FrontCamera() {
  Camera camera;
  camera.id = "front";
  camera.width = camera.height = 400;
  camera.K << 300, 0, 200, 0, 310, 190, 0, 0, 1;
  // Looks along -Z from z = 3: x right is world x, y down is world -y.
  camera.camera_from_world = Vector3d(1, -1, -1).asDiagonal();
  camera.world_in_camera = Vector3d(0, 1, 3);
  return camera;
}

// A half plane: the distance grows linearly, so bilinear sampling is exact.
cv::Mat1f HalfPlane(double nx, double ny, double offset) {
  cv::Mat1f distance(400, 400);
  for (int v = 0; v < 400; ++v) {
    for (int u = 0; u < 400; ++u) {
      distance(v, u) = static_cast<float>(nx * u + ny * v - offset);
    }
  }
  return distance;
}

struct PosedPoint {
  Skeleton skeleton = TestSkeleton();
  JointAngles angles{skeleton};
  KinematicCache cache{skeleton, &angles};
  std::shared_ptr<ShapedPoint> point = std::make_shared<ShapedPoint>();

  PosedPoint() {
    point->carried.joint = {kLElbow, kLShoulder, 0, 0};
    point->carried.weight = {0.6, 0.4, 0, 0};
    point->carried.point_in_joint = {Vector3d(.05, -.1, .03),
                                     Vector3d(.2, -.25, .02),
                                     Vector3d::Zero(),
                                     Vector3d::Zero()};
    point->carried.stretch = {{kNeck, 1}, {kLShoulder, 1}, {kLElbow, .8}};
    for (auto& r : point->world_from_joint) r.setIdentity();
    point->girth = {{0, Vector3d(0, 0.02, 0.04)}, {2, Vector3d(.01, 0, .03)}};
    point->girth_at_linearisation = {0.1, 0, -0.1};
  }

  ParameterBlocks Parameters(unsigned seed) const {
    std::vector<double> lengths(kNumLengthGroups);
    for (size_t g = 0; g < lengths.size(); ++g)
      lengths[g] = 0.01 * (g % 5) - .02;
    std::vector<double> pose = RandomCoordinates(angles, seed);
    // In the middle of the picture: beyond its border distances are clamped.
    pose[0] = 0.1 * pose[0];
    pose[1] = 0.8 + 0.1 * pose[1];
    pose[2] = 0.1 * pose[2];
    return {pose, lengths, {0.05, 0.1, -0.2}};
  }

  template <typename M>
  PosePointCost<M> Cost(M measurement) {
    return PosePointCost<M>(std::move(measurement), point, &cache, 3);
  }
};

TEST(SilhouetteRim, HandValue) {
  const Camera camera = FrontCamera();
  const cv::Mat1f distance = HalfPlane(1, 0, 200);
  const SilhouetteRim rim(&camera, &distance, 0.01);
  // The point 0.1 m to the right at depth 3 projects 10 px right of u = 200:
  // 10 px * 3 m / 305 px / 10 mm.
  const Measured m = rim(Vector3d(0.1, 1, 0));
  EXPECT_NEAR(m.residual, 10 * 3 / 305.0 / 0.01, 1e-6);
  EXPECT_EQ(rim(Vector3d(0, 1, 3.5)).residual, 0) << "behind the camera";
}

TEST(SilhouetteRim, PassesTheChecker) {
  const Camera camera = FrontCamera();
  const cv::Mat1f distance = HalfPlane(0.8, -0.6, 40);
  PosedPoint posed;
  auto cost = posed.Cost(SilhouetteRim(&camera, &distance, 0.005));
  for (unsigned seed = 1; seed < 6; ++seed) {
    EXPECT_EQ(CheckDerivatives(cost, posed.Parameters(seed)), "");
  }
  EXPECT_EQ(CheckWeight(cost, posed.Parameters(1)), "");
  ParameterBlocks zero = posed.Parameters(1);
  for (auto& block : zero) std::fill(block.begin(), block.end(), 0.0);
  EXPECT_EQ(CheckFinite(cost, zero), "");
}

TEST(SilhouetteRim, StillPullsAtZeroResidual) {
  const Camera camera = FrontCamera();
  PosedPoint posed;
  const auto parameters = posed.Parameters(2);
  const cv::Mat1f plane = HalfPlane(1, 0, 0);
  const double at = EvaluateResidual(
      posed.Cost(SilhouetteRim(&camera, &plane, 1)), parameters)[0];
  // Move the plane so that the residual vanishes.
  const cv::Mat1f distance = HalfPlane(1, 0, at * 305 / 3.0);
  auto cost = posed.Cost(SilhouetteRim(&camera, &distance, 0.01));
  EXPECT_GT(JacobianSize(cost, parameters), 1);
}

TEST(ContourMatch, HandValueAndChecker) {
  const Camera camera = FrontCamera();
  const ContourMatch match(
      &camera, Vector2d(190, 200), Vector2d(1, 0), 3.05, 0.01);
  EXPECT_NEAR(match(Vector3d(0, 1, 0)).residual, 10 * 0.01 / 0.01, 1e-9);
  PosedPoint posed;
  auto cost = posed.Cost(
      ContourMatch(&camera, Vector2d(150, 90), Vector2d(.6, .8), 3, 0.004));
  for (unsigned seed = 1; seed < 6; ++seed) {
    EXPECT_EQ(CheckDerivatives(cost, posed.Parameters(seed)), "");
  }
  EXPECT_EQ(CheckWeight(cost, posed.Parameters(1)), "");
  EXPECT_GT(JacobianSize(cost, posed.Parameters(1)), 1);
}

// A cube of 0.6 m around (0.2, 1.1, 0) as a stand-in for a hull.
Volume CubeVolume() {
  TriangleMesh cube;
  for (int i = 0; i < 8; ++i) {
    cube.vertices.emplace_back(
        0.2 + (i & 1 ? .3 : -.3), 1.1 + (i & 2 ? .3 : -.3), (i & 4 ? .3 : -.3));
  }
  const std::vector<Quad> quads = {{0, 4, 6, 2},
                                   {1, 3, 7, 5},
                                   {0, 1, 5, 4},
                                   {2, 6, 7, 3},
                                   {0, 2, 3, 1},
                                   {4, 5, 7, 6}};
  cube.triangles = TriangulateQuads(quads, cube.vertices);
  return VolumeFromMesh(cube, 0.01);
}

TEST(HullDistance, OneSidedWithAWeakPullOutwards) {
  const Volume volume = CubeVolume();
  HullDistance::Options options;
  options.margin = 0.002;
  options.sigma_outside = 0.001;
  options.inflation = 0.006;
  options.sigma_inside = 0.02;
  const HullDistance hull(&volume, options);
  // 12 mm outside the face x = 0.5, then 3 mm and 16 mm inside.
  EXPECT_NEAR(hull(Vector3d(0.512, 1.1, 0)).residual, 10, 0.5);
  EXPECT_EQ(hull(Vector3d(0.497, 1.1, 0)).residual, 0);
  EXPECT_NEAR(hull(Vector3d(0.484, 1.1, 0)).residual, -0.5, 0.05);
  EXPECT_GT(hull(Vector3d(0.512, 1.1, 0)).gradient.x(), 900);
  EXPECT_TRUE(std::isfinite(hull(Vector3d(50, 0, 0)).residual));
}

TEST(HullDistance, PassesTheChecker) {
  const Volume volume = CubeVolume();
  // Linear near a face: derivatives are exact there.
  RadiusPoint point;
  point.point_in_world = Vector3d(0.513, 1.102, 0.003);
  point.block_sizes = {2, 1};
  point.terms = {{0, 1, 0.0, Vector3d(0.05, 0.001, 0)},
                 {1, 0, 0.2, Vector3d(0.02, 0, 0.001)}};
  RadiusPointCost<HullDistance> cost(
      HullDistance(&volume, HullDistance::Options()),
      std::make_shared<RadiusPoint>(point));
  EXPECT_EQ(CheckDerivatives(cost, {{0.01, 0.0202}, {0.2101}}, 1e-3), "");
  EXPECT_EQ(CheckWeight(cost, {{0.01, 0.02}, {0.21}}), "");
}

TEST(RadiusPointCost, PassesTheCheckerWithEveryImageMeasurement) {
  const Camera camera = FrontCamera();
  const cv::Mat1f distance = HalfPlane(0.8, 0.6, 300);
  RadiusPoint point;
  point.point_in_world = Vector3d(0.1, 1.2, 0.1);
  point.block_sizes = {4, 3};
  point.terms = {{0, 0, 0.1, Vector3d(0.05, 0, 0.01)},
                 {0, 3, 0.0, Vector3d(0.01, 0.04, 0)},
                 {1, 2, -0.1, Vector3d(0, 0.02, 0.03)}};
  const ParameterBlocks at = {{0.2, 0.1, 0, -0.1}, {0.3, 0, 0.05}};
  const auto shared = std::make_shared<RadiusPoint>(point);
  const RadiusPointCost<SilhouetteRim> rim(
      SilhouetteRim(&camera, &distance, 0.002), shared);
  EXPECT_EQ(CheckDerivatives(rim, at), "");
  const RadiusPointCost<ContourMatch> match(
      ContourMatch(&camera, Vector2d(210, 180), Vector2d(0, 1), 3, 0.002),
      shared);
  EXPECT_EQ(CheckDerivatives(match, at), "");
  EXPECT_GT(JacobianSize(match, at), 1);
}

TEST(SurfacePoint, CountsTheDistanceAlongTheNormal) {
  const Vector3d normal = Vector3d(1, 2, 2) / 3;
  const SurfacePoint surface(Vector3d(0.1, 1.2, 0.3), normal, 0.002);
  const Vector3d tangent = normal.unitOrthogonal();
  const Measured m =
      surface(Vector3d(0.1, 1.2, 0.3) - 0.004 * normal + 0.05 * tangent);
  EXPECT_NEAR(m.residual, -2, 1e-9);
  EXPECT_TRUE(m.gradient.isApprox(normal / 0.002));
}

}  // namespace
}  // namespace sweepfit
