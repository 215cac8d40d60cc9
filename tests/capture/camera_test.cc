// SPDX-License-Identifier: Apache-2.0
#include "capture/camera.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>
#include <random>

namespace sweepfit {
namespace {

Camera TestCamera() {
  Camera camera;
  camera.id = "test";
  camera.width = 1280;
  camera.height = 960;
  camera.K << 1100, 0, 631.5, 0, 1090, 488.25, 0, 0, 1;
  camera.distortion = {-0.31, 0.12, 0.0011, -0.0007, -0.02};
  camera.camera_from_world =
      Eigen::AngleAxisd(2.1, Eigen::Vector3d(0.3, -0.8, 0.2).normalized())
          .toRotationMatrix();
  camera.world_in_camera = {0.2, -0.1, 3.5};
  return camera;
}

TEST(Camera, ProjectsLikeOpenCv) {
  const Camera camera = TestCamera();
  std::mt19937 random(1);
  std::uniform_real_distribution<double> offset(-1.2, 1.2);
  std::vector<cv::Point3d> points;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d p_in_camera(
        offset(random), offset(random), 3.5 + offset(random));
    const Eigen::Vector3d p = camera.camera_from_world.transpose() *
                              (p_in_camera - camera.world_in_camera);
    points.emplace_back(p.x(), p.y(), p.z());
  }
  cv::Matx33d rotation, K;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      rotation(i, j) = camera.camera_from_world(i, j);
      K(i, j) = camera.K(i, j);
    }
  }
  cv::Vec3d axis_angle;
  cv::Rodrigues(rotation, axis_angle);
  const cv::Vec3d t(camera.world_in_camera.data());
  std::vector<cv::Point2d> expected;
  cv::projectPoints(
      points,
      axis_angle,
      t,
      K,
      std::vector<double>(camera.distortion.begin(), camera.distortion.end()),
      expected);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p(points[i].x, points[i].y, points[i].z);
    const Eigen::Vector2d pixel = camera.Project(p);
    EXPECT_NEAR(pixel.x(), expected[i].x, 1e-9);
    EXPECT_NEAR(pixel.y(), expected[i].y, 1e-9);
    // Pinhole and distortion are the two halves of it.
    const Eigen::Vector2d in_two_steps =
        camera.Distort(camera.ProjectPinhole(p));
    EXPECT_NEAR((in_two_steps - pixel).norm(), 0, 1e-9);
  }
}

TEST(Camera, UndistortInvertsDistort) {
  for (const double strength : {-1.0, 0.3, 1.0}) {
    Camera camera = TestCamera();
    for (double& k : camera.distortion) k *= strength;
    for (double y = 0; y < camera.height; y += 60) {
      for (double x = 0; x < camera.width; x += 60) {
        const Eigen::Vector2d pixel(x, y);
        const Eigen::Vector2d back = camera.Distort(camera.Undistort(pixel));
        EXPECT_NEAR((back - pixel).norm(), 0, 1e-9) << x << " " << y;
      }
    }
  }
}

// Coefficients of another lens fold the picture over.
TEST(Camera, SaysWhetherItsLensCanBeUndone) {
  Camera camera = TestCamera();
  EXPECT_TRUE(camera.CanUndistort());
  camera.distortion = {};
  EXPECT_TRUE(camera.CanUndistort());
  camera.distortion = {-0.9, 0, 0, 0, 0};  // no point is seen near the corners
  EXPECT_FALSE(camera.CanUndistort());
  camera.distortion = {-1.2, 0.4, 0, 0, 0};  // one beyond the fold is
  EXPECT_LT((camera.Distort(camera.Undistort({0, 0}))).norm(), 0.01);
  EXPECT_FALSE(camera.CanUndistort());
  // As measured, of a wide lens: beyond the corners' reach by one per cent.
  camera.distortion = {-0.3687, 0.2032, 0.0003, 0, -0.0712};
  camera.K << 490.8, 0, 334.7, 0, 493.3, 222.4, 0, 0, 1;
  camera.width = 644;
  camera.height = 486;
  EXPECT_TRUE(camera.CanUndistort());
  camera.distortion = {-0.31, std::nan(""), 0, 0, 0};
  EXPECT_FALSE(camera.CanUndistort());
}

TEST(Camera, RayPassesThroughThePoint) {
  const Camera camera = TestCamera();
  const Eigen::Vector3d point =
      camera.camera_from_world.transpose() *
      (Eigen::Vector3d(0.4, -0.3, 2.8) - camera.world_in_camera);
  const Eigen::Vector3d ray = camera.RayInWorld(camera.ProjectPinhole(point));
  const Eigen::Vector3d expected =
      (point - camera.CenterInWorld()).normalized();
  EXPECT_NEAR((ray - expected).norm(), 0, 1e-12);
  EXPECT_NEAR(camera.PointInCamera(camera.CenterInWorld()).norm(), 0, 1e-12);
}

}  // namespace
}  // namespace sweepfit
