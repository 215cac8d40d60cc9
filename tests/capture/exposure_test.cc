// SPDX-License-Identifier: Apache-2.0
#include "capture/exposure.h"

#include <gtest/gtest.h>

namespace sweepfit {
namespace {

TEST(SolveLogGains, MakesViewsAgree) {
  const Eigen::Vector3d exposure(0.06, -0.02, -0.04);  // sum 0
  std::vector<std::vector<LogBrightness>> places;
  for (int k = 0; k < 60; ++k) {
    const double brightness = -1 + 0.01 * k;
    const int first = k % 3, second = (k + 1) % 3;
    places.push_back({{first, brightness + exposure[first]},
                      {second, brightness + exposure[second]}});
    // One in ten is something else in one view.
    if (k % 10 == 0) places.back().back().value += 0.7;
  }
  const Eigen::VectorXd gain = SolveLogGains(places, 3, 0.01, 0.3);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(gain[i], -exposure[i], 0.003);
}

TEST(SolveLogGains, ViewsWithoutCommonPlacesStay) {
  const std::vector<std::vector<LogBrightness>> places = {
      {{0, 0.5}}, {{1, -0.5}}, {}};
  EXPECT_EQ(SolveLogGains(places, 2, 0.01, 0.3).norm(), 0);
}

}  // namespace
}  // namespace sweepfit
