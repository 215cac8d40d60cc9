// SPDX-License-Identifier: Apache-2.0
#include "model/self_intersection.h"

#include <gtest/gtest.h>

#include <random>

namespace sweepfit {
namespace {

TEST(SelfIntersections, FindsTheOnePairThatCuts) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0},
                   {1, 0, 0},
                   {0, 1, 0},
                   {0.2, 0.2, -1},
                   {0.3, 0.2, 1},
                   {0.2, 0.3, 1},
                   {5, 0, 0},
                   {6, 0, 0},
                   {5, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}};
  const auto pairs = SelfIntersections(mesh);
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_EQ(pairs[0], std::make_pair(0, 1));
}

TEST(SelfIntersections, NeighboursAndParallelsDoNotCount) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0},
                   {1, 0, 0},
                   {0, 1, 0},
                   {1, 1, 0.5},
                   {0, 0, 0.1},
                   {1, 0, 0.1},
                   {0, 1, 0.1}};
  mesh.triangles = {{0, 1, 2}, {1, 3, 2}, {4, 5, 6}};
  mesh.vertices[3] = {1, 1, 0};
  EXPECT_TRUE(SelfIntersections(mesh).empty());
}

TEST(SelfIntersections, AgreesWithAllPairs) {
  std::mt19937 generator(5);
  const auto uniform = [&] { return generator() / 4294967296.0; };
  TriangleMesh mesh;
  for (int t = 0; t < 150; ++t) {
    const Eigen::Vector3d center(uniform(), uniform(), uniform());
    for (int i = 0; i < 3; ++i) {
      mesh.vertices.push_back(
          center + 0.3 * (Eigen::Vector3d(uniform(), uniform(), uniform()) -
                          Eigen::Vector3d::Constant(0.5)));
    }
    mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  std::vector<std::pair<int, int>> expected;
  for (int s = 0; s < 150; ++s) {
    for (int t = s + 1; t < 150; ++t) {
      TriangleMesh two;
      two.vertices = mesh.vertices;
      two.triangles = {mesh.triangles[s], mesh.triangles[t]};
      if (!SelfIntersections(two).empty()) expected.emplace_back(s, t);
    }
  }
  EXPECT_GT(expected.size(), 20u);
  EXPECT_EQ(SelfIntersections(mesh), expected);
}

}  // namespace
}  // namespace sweepfit
