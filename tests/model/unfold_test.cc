// SPDX-License-Identifier: Apache-2.0
#include "model/unfold.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
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

// Which corner of a triangle comes last does not matter.
TEST(Unfolder, TakesTrianglesAsTheyAre) {
  std::vector<Quad> quads;
  std::vector<Eigen::Vector3d> rest;
  Sheet(&quads, &rest);
  std::array<std::vector<Eigen::Vector3d>, 2> results;
  for (const bool turn : {false, true}) {
    std::vector<Quad> triangles;
    for (const Quad& q : quads) {
      for (const auto& [a, b, c] :
           {Triangle{q[0], q[1], q[2]}, Triangle{q[0], q[2], q[3]}}) {
        const bool turn_this = turn && triangles.size() % 3 == 0;
        triangles.push_back(turn_this ? Quad{b, c, a, a} : Quad{a, b, c, c});
      }
    }
    const Unfolder unfolder(triangles, rest);
    std::vector<Eigen::Vector3d>& posed = results[turn];
    posed = rest;
    posed[10 * (kSide + 1) + 10].x() += 0.011;
    const std::vector<Eigen::Matrix3d> rotation(rest.size(),
                                                Eigen::Matrix3d::Identity());
    EXPECT_EQ(unfolder.Apply(rotation, &posed), 0);
  }
  for (std::size_t v = 0; v < rest.size(); ++v) {
    EXPECT_LT((results[0][v] - results[1][v]).norm(), 1e-9) << v;
  }
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
