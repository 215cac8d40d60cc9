// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_triangulation.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <random>

#include "solver/landmark_keypoints.h"
#include "tests/volume/capsule_person.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

std::vector<Camera> Ring(int count) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count;
    cameras.push_back(testing::LookAt(
        "cam" + std::to_string(i),
        {3 * std::sin(angle), i % 2 == 0 ? 1.6 : 0.8, 3 * std::cos(angle)},
        {0, 1, 0},
        800,
        800));
  }
  return cameras;
}

// Normal deviates that are the same on every machine.
class Normal {
 public:
  double operator()() {
    const double u = (generator_() + 0.5) / 4294967296.0;
    const double v = (generator_() + 0.5) / 4294967296.0;
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * v);
  }

 private:
  std::mt19937 generator_{7};
};

PointObservation See(const Camera& camera,
                     const Vector3d& point,
                     double sigma,
                     Normal* noise) {
  return {&camera,
          camera.ProjectPinhole(point) +
              sigma * Eigen::Vector2d((*noise)(), (*noise)()),
          Eigen::Vector2d::UnitX(),
          sigma,
          sigma};
}

TEST(TriangulatePoint, ExactWithoutNoise) {
  const std::vector<Camera> cameras = Ring(5);
  const Vector3d point(0.2, 1.3, -0.1);
  std::vector<PointObservation> observations;
  for (const Camera& camera : cameras) {
    observations.push_back({&camera,
                            camera.ProjectPinhole(point),
                            Eigen::Vector2d::UnitX(),
                            1,
                            1});
  }
  const auto found = TriangulatePoint(observations, std::nullopt);
  ASSERT_TRUE(found);
  EXPECT_LT((found->point_in_world - point).norm(), 1e-6);
  EXPECT_EQ(found->num_views, 5);
}

TEST(TriangulatePoint, CovarianceIsHonest) {
  const std::vector<Camera> cameras = Ring(6);
  const Vector3d point(0.2, 1.3, -0.1);
  Normal noise;
  double chi_square = 0;
  constexpr int kTrials = 200;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<PointObservation> observations;
    for (const Camera& camera : cameras) {
      observations.push_back(See(camera, point, 2, &noise));
    }
    const auto found = TriangulatePoint(observations, std::nullopt);
    ASSERT_TRUE(found);
    const Vector3d error = found->point_in_world - point;
    chi_square += error.dot(found->covariance.ldlt().solve(error)) / 3;
  }
  EXPECT_NEAR(chi_square / kTrials, 1, 0.25);
}

TEST(TriangulatePoint, DropsViewsThatDoNotAgree) {
  const std::vector<Camera> cameras = Ring(6);
  const Vector3d point(-0.3, 0.7, 0.2);
  Normal noise;
  std::vector<PointObservation> observations;
  for (const Camera& camera : cameras) {
    observations.push_back(See(camera, point, 1, &noise));
  }
  observations[1].pinhole_pixel += Eigen::Vector2d(60, -20);
  observations[4].pinhole_pixel += Eigen::Vector2d(-30, 80);
  const auto found = TriangulatePoint(observations, std::nullopt);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->agrees,
            (std::vector<bool>{true, false, true, true, false, true}));
  EXPECT_EQ(found->num_views, 4);
  EXPECT_LT((found->point_in_world - point).norm(), 0.008);
}

TEST(TriangulatePoint, PriorHoldsWhatViewsLeaveOpen) {
  const std::vector<Camera> cameras = Ring(6);
  const Vector3d truth(0, 1, 0);
  const Vector3d axis = Vector3d(1, 2, 0.5).normalized();
  std::vector<PointObservation> observations;
  for (const Camera& camera : cameras) {
    const Eigen::Vector2d pixel = camera.ProjectPinhole(truth);
    const Eigen::Vector2d along =
        (camera.ProjectPinhole(truth + 0.01 * axis) - pixel).normalized();
    observations.push_back(
        {&camera, pixel, Eigen::Vector2d(-along.y(), along.x()), 1, 0});
  }
  // The prior is off along and across the limb; the views correct the second.
  const Vector3d off = 0.02 * axis + 0.01 * axis.unitOrthogonal();
  const PointPrior prior{truth + off, AlongAcross(axis, 0.01, 0.03)};
  const auto found = TriangulatePoint(observations, prior);
  ASSERT_TRUE(found);
  const Vector3d error = found->point_in_world - truth;
  EXPECT_NEAR(error.dot(axis), 0.02, 0.001);
  EXPECT_LT((error - error.dot(axis) * axis).norm(), 0.001);
  EXPECT_NEAR(axis.dot(found->covariance * axis), 1e-4, 1e-5);
  // Without a prior lines alone have no start.
  EXPECT_FALSE(TriangulatePoint(observations, std::nullopt));
}

TEST(TriangulatePoint, RefusesWhatIsNotKnown) {
  const std::vector<Camera> cameras = Ring(4);
  const Vector3d point(0, 1, 0);
  std::vector<PointObservation> observations = {
      {&cameras[0],
       cameras[0].ProjectPinhole(point),
       Eigen::Vector2d::UnitX(),
       1,
       1}};
  EXPECT_FALSE(TriangulatePoint({}, std::nullopt));
  EXPECT_FALSE(TriangulatePoint(observations, std::nullopt));
  // Two views that contradict each other.
  observations.push_back({&cameras[1],
                          cameras[1].ProjectPinhole(point + Vector3d(0, 1, 0)),
                          Eigen::Vector2d::UnitX(),
                          1,
                          1});
  EXPECT_FALSE(TriangulatePoint(observations, std::nullopt));
  // Views that agree but are too vague.
  observations.clear();
  for (const Camera& camera : cameras) {
    observations.push_back({&camera,
                            camera.ProjectPinhole(point),
                            Eigen::Vector2d::UnitX(),
                            60,
                            60});
  }
  EXPECT_FALSE(TriangulatePoint(observations, std::nullopt));
}

TEST(TriangulateKeypoints, JointsAndFeatures) {
  std::vector<View> views(6);
  std::vector<Keypoint2> keypoints;
  const std::vector<Camera> cameras = Ring(6);
  const Vector3d wrist(0.5, 1.1, 0.1), nose(0, 1.6, 0.1);
  for (size_t i = 0; i < views.size(); ++i) {
    views[i].camera = cameras[i];
    // Keypoints are in pictures as taken.
    views[i].camera.distortion = {-0.1, 0.02, 0.001, 0, 0};
    const std::string& id = cameras[i].id;
    keypoints.push_back(
        {id, "A", "l_wrist", views[i].camera.Project(wrist), 3});
    keypoints.push_back({id, "A", "nose", views[i].camera.Project(nose), 3});
  }
  keypoints.push_back({"cam0", "A", "l_knee", {100, 100}, 3});
  // A detector's blunder.
  keypoints[4].pixel += Eigen::Vector2d(150, 0);
  std::vector<Landmark2> points;
  const std::vector<Landmark3> found =
      TriangulateKeypoints(views, keypoints, &points);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].name, "l_wrist");
  EXPECT_EQ(found[0].joint, kLWrist);
  EXPECT_EQ(found[0].source, "keypoint");
  EXPECT_EQ(found[0].num_views, 5);
  EXPECT_LT((found[0].point_in_world - wrist).norm(), 1e-4);
  EXPECT_EQ(found[1].name, "nose");
  EXPECT_EQ(found[1].joint, -1);
  EXPECT_LT((found[1].point_in_world - nose).norm(), 1e-4);
  EXPECT_EQ(points.size(), 11u);
}

}  // namespace
}  // namespace sweepfit
