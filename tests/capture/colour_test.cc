// SPDX-License-Identifier: Apache-2.0
#include "capture/colour.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace sweepfit {
namespace {

// CIELAB by its definition, sRGB's primaries and D65.
cv::Vec3d Lab(const cv::Vec3d& bgr) {
  const double r = bgr[2], g = bgr[1], b = bgr[0];
  const auto f = [](double v) {
    return v > 0.008856 ? std::cbrt(v) : 7.787 * v + 16.0 / 116;
  };
  const double x = f((0.412453 * r + 0.357580 * g + 0.180423 * b) / 0.950456);
  const double y = f(0.212671 * r + 0.715160 * g + 0.072169 * b);
  const double z = f((0.019334 * r + 0.119193 * g + 0.950227 * b) / 1.088754);
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

TEST(ToLab, FollowsTheDefinitionFromBlackToWhite) {
  // A row longer than what is converted together, and not a multiple of it.
  const std::array<float, 7> levels = {
      0, 1e-4f, 0.004f, 0.0089f, 0.1f, 0.5f, 1};
  cv::Mat3f linear(7, 49);
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 49; ++x) {
      linear(y, x) = {levels[y], levels[x / 7], levels[x % 7]};
    }
  }
  const cv::Mat3f lab = ToLab(linear);
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 49; ++x) {
      const cv::Vec3d expected = Lab(linear(y, x));
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(lab(y, x)[c], expected[c], 1e-3) << y << " " << x;
      }
    }
  }
}

TEST(ToLab, GreyHasNoColour) {
  const cv::Mat3f grey(1, 1, cv::Vec3f(0.3f, 0.3f, 0.3f));
  EXPECT_NEAR(ToLab(grey)(0, 0)[1], 0, 1e-3);
  EXPECT_NEAR(ToLab(grey)(0, 0)[2], 0, 1e-3);
}

TEST(ToSmoothLab, KeepsAnEvenColour) {
  const cv::Mat3f even(9, 9, cv::Vec3f(0.2f, 0.4f, 0.1f));
  const cv::Vec3d expected = Lab(even(0, 0));
  for (const cv::Vec3f& pixel : ToSmoothLab(even)) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(pixel[c], expected[c], 1e-3);
  }
}

}  // namespace
}  // namespace sweepfit
