// SPDX-License-Identifier: Apache-2.0
#include "model/unfold.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>

namespace sweepfit {
namespace {

constexpr int kSide = 20;

// A flat sheet of quads in the plane z = 0, looking to +z.
void Sheet(std::vector<Quad>* quads, std::vector<Eigen::Vector3d>* vertices) {
  for (int i = 0; i <= kSide; ++i) {
    for (int j = 0; j <= kSide; ++j) {
      vertices->emplace_back(0.01 * j, 0.01 * i, 0);
      if (i == kSide || j == kSide) continue;
      const int a = i * (kSide + 1) + j;
      quads->push_back({a, a + 1, a + kSide + 2, a + kSide + 1});
    }
  }
}

TEST(Unfolder, LeavesASheetWithoutFoldsAlone) {
  std::vector<Quad> quads;
  std::vector<Eigen::Vector3d> rest;
  Sheet(&quads, &rest);
  const Unfolder unfolder(quads, rest);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(2, Eigen::Vector3d(1, 2, 3).normalized())
          .toRotationMatrix();
  std::vector<Eigen::Vector3d> posed;
  for (const Eigen::Vector3d& x : rest) posed.push_back(turn * x);
  const std::vector<Eigen::Vector3d> before = posed;
  const std::vector<Eigen::Matrix3d> rotation(rest.size(), turn);
  EXPECT_EQ(unfolder.Apply(rotation, &posed), 0);
  EXPECT_EQ(posed, before);
}

TEST(Unfolder, TurnsFacesBack) {
  std::vector<Quad> quads;
  std::vector<Eigen::Vector3d> rest;
  Sheet(&quads, &rest);
  const Unfolder unfolder(quads, rest);
  // The middle columns run backwards.
  std::vector<Eigen::Vector3d> posed = rest;
  for (Eigen::Vector3d& x : posed) {
    if (x.x() > 0.075 && x.x() < 0.125) x.x() = 0.2 - x.x();
  }
  const std::vector<Eigen::Vector3d> before = posed;
  const std::vector<Eigen::Matrix3d> rotation(rest.size(),
                                              Eigen::Matrix3d::Identity());
  EXPECT_EQ(unfolder.Apply(rotation, &posed), 0);
  for (const Quad& quad : quads) {
    EXPECT_GT((posed[quad[1]] - posed[quad[0]])
                  .cross(posed[quad[3]] - posed[quad[0]])
                  .z(),
              0);
  }
  EXPECT_EQ(posed.front(), before.front());
  EXPECT_EQ(posed.back(), before.back());
}

TEST(Unfolder, MovesLittleForASmallFold) {
  std::vector<Quad> quads;
  std::vector<Eigen::Vector3d> rest;
  Sheet(&quads, &rest);
  const Unfolder unfolder(quads, rest);
  // One vertex is drawn over the next.
  const int middle = 10 * (kSide + 1) + 10;
  std::vector<Eigen::Vector3d> posed = rest;
  posed[middle].x() += 0.011;
  const std::vector<Eigen::Vector3d> before = posed;
  const std::vector<Eigen::Matrix3d> rotation(rest.size(),
                                              Eigen::Matrix3d::Identity());
  EXPECT_EQ(unfolder.Apply(rotation, &posed), 0);
  double largest = 0;
  for (std::size_t v = 0; v < posed.size(); ++v) {
    largest = std::max(largest, (posed[v] - before[v]).norm());
  }
  EXPECT_GT(largest, 0.0005);
  EXPECT_LT(largest, 0.006);
}

}  // namespace
}  // namespace sweepfit
