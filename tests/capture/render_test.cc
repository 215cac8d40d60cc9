// SPDX-License-Identifier: Apache-2.0
#include "capture/render.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>

namespace sweepfit {
namespace {

TriangleMesh Sphere(const Eigen::Vector3d& center, double radius, int rows) {
  TriangleMesh mesh;
  const int columns = 2 * rows;
  for (int i = 0; i <= rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double polar = std::numbers::pi * i / rows;
      const double turn = 2 * std::numbers::pi * j / columns;
      mesh.vertices.push_back(
          center + radius * Eigen::Vector3d(std::sin(polar) * std::sin(turn),
                                            std::cos(polar),
                                            std::sin(polar) * std::cos(turn)));
    }
  }
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const int a = i * columns + j;
      const int b = i * columns + (j + 1) % columns;
      mesh.triangles.push_back({a, a + columns, b});
      mesh.triangles.push_back({b, a + columns, b + columns});
    }
  }
  return mesh;
}

Camera TestCamera(bool distorted) {
  Camera camera;
  camera.width = 200;
  camera.height = 160;
  camera.K << 260, 0, 99.5, 0, 260, 79.5, 0, 0, 1;
  if (distorted) camera.distortion = {0.15, -0.03, 0.002, 0.001, 0};
  return camera;
}

// The outline of a sphere is the cone of rays at asin(r / distance).
TEST(RenderCoverage, OfASphereMatchesTheClosedForm) {
  for (const bool distorted : {false, true}) {
    const Camera camera = TestCamera(distorted);
    const Eigen::Vector3d center(0.15, -0.1, 2);
    const double radius = 0.4;
    const cv::Mat1f coverage =
        RenderCoverage(camera, Sphere(center, radius, 200), 4);
    const double cosine = std::sqrt(1 - std::pow(radius / center.norm(), 2));
    constexpr int kSamples = 8;
    double area = 0, true_area = 0, worst = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        int count = 0;
        for (int i = 0; i < kSamples * kSamples; ++i) {
          const Eigen::Vector2d pixel(
              x + (i % kSamples + 0.5) / kSamples - 0.5,
              y + (i / kSamples + 0.5) / kSamples - 0.5);
          const Eigen::Vector3d ray =
              camera.RayInWorld(camera.Undistort(pixel));
          count += ray.dot(center.normalized()) > cosine;
        }
        const double truth = count / double(kSamples * kSamples);
        area += coverage(y, x);
        true_area += truth;
        worst = std::max(worst, std::abs(coverage(y, x) - truth));
      }
    }
    EXPECT_NEAR(area / true_area, 1, 2e-3) << distorted;
    EXPECT_LT(worst, 0.3) << distorted;
  }
}

TEST(RenderCoverage, ClipsWhatReachesBehindTheCamera) {
  // A floor from behind the camera to far ahead fills the lower half.
  TriangleMesh floor;
  floor.vertices = {{-50, 1, -5}, {50, 1, -5}, {50, 1, 2000}, {-50, 1, 2000}};
  floor.vertices[2].x() = 5000;
  floor.vertices[3].x() = -5000;
  floor.triangles = {{0, 1, 2}, {0, 2, 3}};
  const Camera camera = TestCamera(false);
  const cv::Mat1f coverage = RenderCoverage(camera, floor, 2);
  EXPECT_EQ(coverage(10, 100), 0);
  EXPECT_EQ(coverage(70, 100), 0);
  EXPECT_EQ(coverage(90, 100), 1);
  EXPECT_EQ(coverage(159, 100), 1);
}

TEST(RayScene, FindsTheNearestTriangleAndItsWeights) {
  TriangleMesh mesh;
  mesh.vertices = {
      {0, 0, 2}, {1, 0, 2}, {0, 1, 2}, {0, 0, 3}, {1, 0, 3}, {0, 1, 3}};
  mesh.triangles = {{3, 4, 5}, {0, 1, 2}};
  const RayScene scene(mesh);
  const RayScene::Hit hit =
      scene.Intersect({0.25, 0.5, 0}, Eigen::Vector3d::UnitZ());
  EXPECT_EQ(hit.triangle, 1);
  EXPECT_NEAR(hit.distance, 2, 1e-5);
  EXPECT_NEAR(hit.b1, 0.25, 1e-5);
  EXPECT_NEAR(hit.b2, 0.5, 1e-5);
  EXPECT_EQ(
      scene.Intersect({0.25, 0.5, 0}, Eigen::Vector3d::UnitZ(), 2.5).triangle,
      0);
  EXPECT_EQ(scene.Intersect({2, 2, 0}, Eigen::Vector3d::UnitZ()).triangle, -1);
  EXPECT_EQ(RayScene(TriangleMesh{})
                .Intersect({0, 0, 0}, Eigen::Vector3d::UnitZ())
                .triangle,
            -1);
}

TEST(RayScene, TellsVisiblePointsFromHiddenOnes) {
  const RayScene scene(Sphere({0, 0, 0}, 1, 60));
  const Eigen::Vector3d camera(0, 0, 5);
  EXPECT_TRUE(scene.IsVisible({0, 0, 1}, camera, 0.01));
  EXPECT_FALSE(scene.IsVisible({0, 0, -1}, camera, 0.01));
  EXPECT_TRUE(scene.IsVisible({0, 0, -1}, camera, 2.1));
  EXPECT_TRUE(scene.IsVisible({0, 2, -1}, camera, 0.01));
}

TEST(LookAtMesh, FillsThePictureFromTheSideAsked) {
  const TriangleMesh mesh = Sphere({1, 2, 3}, 0.5, 40);
  const Camera front = LookAtMesh(mesh, 0, 0, 120, 100);
  EXPECT_GT(front.CenterInWorld().z(), 4);
  const Camera left = LookAtMesh(mesh, 90, 20, 120, 100);
  EXPECT_GT(left.CenterInWorld().x(), 2);
  EXPECT_GT(left.CenterInWorld().y(), 2.3);
  for (const Camera& camera : {front, left}) {
    EXPECT_NEAR(camera.camera_from_world.determinant(), 1, 1e-12);
    // Up in the world is up in the picture.
    EXPECT_LT(camera.Project({1, 2.5, 3}).y(), camera.Project({1, 1.5, 3}).y());
    const cv::Mat1f coverage = RenderCoverage(camera, mesh, 2);
    EXPECT_EQ(cv::sum(coverage.row(0))[0], 0);
    EXPECT_GT(cv::countNonZero(coverage), 5000);
  }
  // The subject's left is to the right in a picture of its front.
  EXPECT_GT(front.Project({1.5, 2, 3}).x(), front.Project({0.5, 2, 3}).x());
}

TEST(RenderColorings, ShowsEachColouringAsIfDrawnAlone) {
  // Half of the ball lies outside the picture.
  const Camera camera = TestCamera(false);
  const TriangleMesh mesh = Sphere({0.7, 0.1, 2}, 0.4, 40);
  std::vector<cv::Vec3b> striped;
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    striped.push_back(v % 2 == 0 ? cv::Vec3b(200, 30, 10)
                                 : cv::Vec3b(10, 180, 40));
  }
  const std::vector<cv::Mat3b> pictures =
      RenderColorings(camera, mesh, {{}, striped});
  ASSERT_EQ(pictures.size(), 2u);
  EXPECT_EQ(cv::norm(pictures[0], RenderShaded(camera, mesh, {}), cv::NORM_INF),
            0);
  EXPECT_EQ(
      cv::norm(pictures[1], RenderShaded(camera, mesh, striped), cv::NORM_INF),
      0);
  EXPECT_GT(cv::norm(pictures[0], pictures[1], cv::NORM_INF), 50);
  // All that the mesh covers is drawn, and nothing else.
  const cv::Mat1f coverage = RenderCoverage(camera, mesh);
  int covered = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const bool is_white = pictures[0](y, x) == cv::Vec3b(255, 255, 255);
      if (coverage(y, x) == 0 || coverage(y, x) == 1) {
        EXPECT_EQ(is_white, coverage(y, x) == 0) << x << " " << y;
      }
      covered += coverage(y, x) == 1;
    }
  }
  EXPECT_GT(covered, 1000);
}

TEST(RenderShaded, ShowsTheMeshInItsColourOnWhite) {
  const TriangleMesh mesh = Sphere({0, 0, 0}, 1, 30);
  const Camera camera = LookAtMesh(mesh, 0, 0, 80, 80);
  const std::vector<cv::Vec3b> red(mesh.vertices.size(),
                                   cv::Vec3b(20, 20, 200));
  const cv::Mat3b picture = RenderShaded(camera, mesh, red);
  EXPECT_EQ(picture(0, 0), cv::Vec3b(255, 255, 255));
  EXPECT_GT(picture(40, 40)[2], 150);
  EXPECT_LT(picture(40, 40)[0], 60);
  const cv::Vec3b grey = RenderShaded(camera, mesh, {})(40, 40);
  EXPECT_EQ(grey[0], grey[2]);
}

}  // namespace
}  // namespace sweepfit
