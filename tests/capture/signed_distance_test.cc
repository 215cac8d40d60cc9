// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "capture/silhouette.h"

namespace sweepfit {
namespace {

Camera TestCamera(bool distorted) {
  Camera camera;
  camera.width = 240;
  camera.height = 200;
  camera.K << 300, 0, 121, 0, 300, 98, 0, 0, 1;
  if (distorted) camera.distortion = {-0.2, 0.05, 0.002, -0.001, 0};
  return camera;
}

// Coverage of a disc that is round in pinhole pixels, 8 x 8 samples a pixel.
cv::Mat1f DrawDisc(const Camera& camera,
                   const Eigen::Vector2d& center,
                   double radius) {
  constexpr int kSamples = 8;
  cv::Mat1f coverage(camera.height, camera.width);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      int count = 0;
      for (int i = 0; i < kSamples * kSamples; ++i) {
        const Eigen::Vector2d pixel(x + (i % kSamples + 0.5) / kSamples - 0.5,
                                    y + (i / kSamples + 0.5) / kSamples - 0.5);
        count += (camera.Undistort(pixel) - center).norm() < radius;
      }
      coverage(y, x) = static_cast<float>(count) / (kSamples * kSamples);
    }
  }
  return coverage;
}

TEST(SignedDistance, OfADiscIsUnbiasedWithAndWithoutDistortion) {
  for (const bool distorted : {false, true}) {
    const Camera camera = TestCamera(distorted);
    const Eigen::Vector2d center(110.3, 101.7);
    const double radius = 45.2;
    const cv::Mat1f distance =
        SignedDistance(camera, DrawDisc(camera, center, radius));
    ASSERT_EQ(distance.size(), cv::Size(camera.width, camera.height));
    double sum = 0, sum_squared = 0, worst = 0;
    int count = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const double truth = (Eigen::Vector2d(x, y) - center).norm() - radius;
        const double error = distance(y, x) - truth;
        worst = std::max(worst, std::abs(error));
        if (std::abs(truth) > 10) continue;
        sum += error;
        sum_squared += error * error;
        ++count;
      }
    }
    EXPECT_LT(std::abs(sum / count), 0.05) << distorted;
    EXPECT_LT(std::sqrt(sum_squared / count), 0.15) << distorted;
    EXPECT_LT(worst, 0.5) << distorted;  // everywhere, far away, too
  }
}

TEST(SignedDistance, TheFrameIsNoBoundary) {
  const Camera camera = TestCamera(false);
  // A half plane: x < 100.5 is covered, also at the frame.
  cv::Mat1f coverage(camera.height, camera.width, 0.f);
  coverage.colRange(0, 101) = 1;
  const cv::Mat1f distance = SignedDistance(camera, coverage);
  for (const int y : {0, 50, camera.height - 1}) {
    for (const int x : {0, 99, 102, camera.width - 1}) {
      EXPECT_NEAR(distance(y, x), x - 100.5, 0.01) << x << " " << y;
    }
  }
}

TEST(SignedDistance, OfNothingAndOfEverything) {
  const Camera camera = TestCamera(true);
  cv::Mat1f coverage(camera.height, camera.width, 0.f);
  double low, high;
  cv::minMaxLoc(SignedDistance(camera, coverage), &low, &high);
  EXPECT_GT(low, 400);
  coverage = 1;
  cv::minMaxLoc(SignedDistance(camera, coverage), &low, &high);
  EXPECT_LT(high, -400);
}

TEST(SampleBilinear, GivesValueAndGradientOfABilinearFunction) {
  cv::Mat1f image(6, 8);
  const auto f = [](double x, double y) { return 1 + 2 * x - y + 0.5 * x * y; };
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) image(y, x) = static_cast<float>(f(x, y));
  }
  const ImageSample sample = SampleBilinear(image, {3.25, 4.5});
  EXPECT_NEAR(sample.value, f(3.25, 4.5), 1e-5);
  EXPECT_NEAR(sample.gradient.x(), 2 + 0.5 * 4.5, 1e-5);
  EXPECT_NEAR(sample.gradient.y(), -1 + 0.5 * 3.25, 1e-5);
  EXPECT_NEAR(SampleBilinear(image, {-5, 2}).value, f(0, 2), 1e-5);
  EXPECT_NEAR(SampleBilinear(image, {7, 5}).value, f(7, 5), 1e-5);
  EXPECT_NEAR(SampleBilinear(image, {70, 50}).value, f(7, 5), 1e-5);
  EXPECT_TRUE(std::isfinite(SampleBilinear(image, {std::nan(""), 1}).value));
}

double SignedArea(const std::vector<Eigen::Vector2d>& polyline) {
  double twice = 0;
  for (std::size_t i = 0; i < polyline.size(); ++i) {
    const Eigen::Vector2d& a = polyline[i];
    const Eigen::Vector2d& b = polyline[(i + 1) % polyline.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return twice / 2;
}

TEST(SubpixelContours, OfARing) {
  const Camera camera = TestCamera(false);
  const Eigen::Vector2d center(100.4, 90.6);
  const cv::Mat1f ring =
      DrawDisc(camera, center, 50) - DrawDisc(camera, center, 20);
  const auto contours = SubpixelContours(ring);
  ASSERT_EQ(contours.size(), 2u);
  // Counter-clockwise as seen, so negative with y down; the hole the other way.
  EXPECT_NEAR(SignedArea(contours[0]), -std::numbers::pi * 2500, 8);
  EXPECT_NEAR(SignedArea(contours[1]), std::numbers::pi * 400, 4);
  for (const Eigen::Vector2d& p : contours[0]) {
    EXPECT_NEAR((p - center).norm(), 50, 0.15);
  }
  for (std::size_t i = 0; i < contours[0].size(); ++i) {
    const Eigen::Vector2d& next = contours[0][(i + 1) % contours[0].size()];
    EXPECT_LE((next - contours[0][i]).norm(), std::sqrt(2.0) + 1e-9);
  }
}

TEST(SubpixelContours, AreClosedAtTheFrameAndAtSaddles) {
  EXPECT_TRUE(SubpixelContours(cv::Mat1f(5, 5, 0.f)).empty());
  const auto whole = SubpixelContours(cv::Mat1f(5, 7, 1.f));
  ASSERT_EQ(whole.size(), 1u);
  // Half a pixel beyond the outer pixel centres, corners cut.
  EXPECT_NEAR(SignedArea(whole[0]), -(7 * 5 - 0.5), 1e-6);
  // Two pixels that touch at a corner only.
  cv::Mat1f saddle(6, 6, 0.f);
  saddle(2, 2) = saddle(3, 3) = 1;
  EXPECT_EQ(SubpixelContours(saddle).size(), 2u);
  saddle(2, 2) = saddle(3, 3) = 1;
  saddle(2, 3) = saddle(3, 2) = 0.4f;
  EXPECT_EQ(SubpixelContours(saddle).size(), 1u);
}

}  // namespace
}  // namespace sweepfit
