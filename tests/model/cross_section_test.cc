// SPDX-License-Identifier: Apache-2.0
#include "model/cross_section.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

namespace sweepfit {
namespace {

constexpr double kPi = std::numbers::pi;

CrossSection Sampled(const std::function<double(double)>& radius, int count) {
  std::vector<double> radii(count);
  for (int k = 0; k < count; ++k) radii[k] = radius(2 * kPi * k / count);
  return CrossSection(radii);
}

TEST(CrossSectionTest, WeightsSumToOneAndAreCentredOnTheSample) {
  for (double theta = -20; theta < 20; theta += 0.173) {
    const PeriodicWeights weights = PeriodicCubicWeights(theta, 16);
    double sum = 0;
    for (int i = 0; i < 4; ++i) {
      sum += weights.weight[i];
      EXPECT_GE(weights.index[i], 0);
      EXPECT_LT(weights.index[i], 16);
    }
    EXPECT_NEAR(sum, 1, 1e-14);
  }
  const PeriodicWeights at_sample = PeriodicCubicWeights(2 * kPi * 3 / 16, 16);
  EXPECT_EQ(at_sample.index[1], 3);
  EXPECT_NEAR(at_sample.weight[1], 1, 1e-12);
}

TEST(CrossSectionTest, RadiusPassesThroughItsSamplesAndIsPeriodic) {
  const std::vector<double> radii = {0.1, 0.12, 0.09, 0.2, 0.15, 0.11, 0.1};
  const CrossSection section(radii);
  for (int k = 0; k < 7; ++k) {
    const double theta = 2 * kPi * k / 7;
    EXPECT_NEAR(section.Radius(theta), radii[k], 1e-14);
    EXPECT_NEAR(section.Radius(theta + 0.2 + 2 * kPi),
                section.Radius(theta + 0.2),
                1e-13);
    EXPECT_NEAR(section.Radius(theta + 0.2 - 6 * kPi),
                section.Radius(theta + 0.2),
                1e-13);
  }
}

TEST(CrossSectionTest, RadiusHasAContinuousSlope) {
  const CrossSection section({0.1, 0.12, 0.09, 0.2, 0.15, 0.11, 0.1});
  constexpr double kStep = 1e-6;
  for (int k = 0; k < 7; ++k) {
    const double theta = 2 * kPi * k / 7;
    const double before = section.Radius(theta) - section.Radius(theta - kStep);
    const double after = section.Radius(theta + kStep) - section.Radius(theta);
    EXPECT_NEAR(before / kStep, after / kStep, 1e-5);
  }
}

TEST(CrossSectionTest, Circle) {
  const double r = 0.083;
  const CrossSection circle = CrossSection::Superellipse(r, r, 2, 16);
  EXPECT_NEAR(circle.Area(), kPi * r * r, 5e-5 * kPi * r * r);
  EXPECT_NEAR(circle.Perimeter(), 2 * kPi * r, 5e-5 * r);
  EXPECT_NEAR(circle.TapeGirth(), circle.Perimeter(), 1e-12);
  EXPECT_LT(circle.Centroid().norm(), 1e-12);
}

TEST(CrossSectionTest, CircleOffTheCentre) {
  // r(theta) of a circle whose centre is at (d, 0).
  const double r = 0.09;
  const double d = 0.02;
  const CrossSection section = Sampled(
      [&](double theta) {
        return d * std::cos(theta) +
               std::sqrt(r * r - std::pow(d * std::sin(theta), 2));
      },
      48);
  EXPECT_NEAR(section.Area(), kPi * r * r, 1e-4 * kPi * r * r);
  EXPECT_NEAR(section.Centroid().x(), d, 1e-5);
  EXPECT_NEAR(section.Centroid().y(), 0, 1e-12);
  EXPECT_NEAR(section.TapeGirth(), 2 * kPi * r, 1e-4);
}

TEST(CrossSectionTest, Ellipse) {
  const double a = 0.16;
  const double b = 0.11;
  const CrossSection ellipse = CrossSection::Superellipse(a, b, 2, 64);
  EXPECT_NEAR(ellipse.Radius(0), a, 1e-12);
  EXPECT_NEAR(ellipse.Radius(kPi / 2), b, 1e-12);
  EXPECT_NEAR(ellipse.Area(), kPi * a * b, 1e-4 * kPi * a * b);
  // Ramanujan's series is exact to 1e-9 here.
  const double h = std::pow((a - b) / (a + b), 2);
  const double perimeter =
      kPi * (a + b) * (1 + 3 * h / (10 + std::sqrt(4 - 3 * h)));
  EXPECT_NEAR(ellipse.Perimeter(), perimeter, 1e-4 * perimeter);
}

TEST(CrossSectionTest, SuperellipseOfHighPowerIsNearlyARectangle) {
  const CrossSection box = CrossSection::Superellipse(0.2, 0.1, 40, 360);
  EXPECT_NEAR(box.Area(), 4 * 0.2 * 0.1, 0.01 * 0.08);
  EXPECT_NEAR(box.TapeGirth(), 4 * 0.3, 0.02 * 1.2);
}

TEST(CrossSectionTest, TapeSpansHollows) {
  // A section with a waist: the tape is shorter than the outline, but longer
  // than there and back across the longest diameter.
  const CrossSection hollow = Sampled(
      [](double theta) { return 0.1 * (1 + 0.7 * std::cos(2 * theta)); }, 64);
  EXPECT_LT(hollow.TapeGirth(), 0.97 * hollow.Perimeter());
  EXPECT_GT(hollow.TapeGirth(), 4 * 0.17);

  // Four spikes: the hull is about the square of their tips.
  std::vector<double> radii(64, 0.01);
  for (int k = 0; k < 64; k += 16) radii[k] = 0.1;
  EXPECT_NEAR(CrossSection(radii).TapeGirth(), 4 * 0.1 * std::sqrt(2), 1e-3);
}

}  // namespace
}  // namespace sweepfit
