// SPDX-License-Identifier: Apache-2.0
#include "model/closest_point.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace sweepfit {
namespace {

using Eigen::Vector3d;

TEST(ClosestPointOnTriangle, FindsFaceEdgeAndCorner) {
  const Vector3d a(0, 0, 0), b(1, 0, 0), c(0, 1, 0);
  const auto closest = [&](double x, double y, double z) {
    return ClosestPointOnTriangle({x, y, z}, a, b, c).point;
  };
  EXPECT_TRUE(closest(0.2, 0.3, 5).isApprox(Vector3d(0.2, 0.3, 0)));
  EXPECT_TRUE(closest(0.4, -2, 1).isApprox(Vector3d(0.4, 0, 0)));
  EXPECT_TRUE(closest(-1, 0.4, 1).isApprox(Vector3d(0, 0.4, 0)));
  EXPECT_TRUE(closest(1, 1, -1).isApprox(Vector3d(0.5, 0.5, 0)));
  EXPECT_TRUE(closest(3, -1, 0).isApprox(b));
  EXPECT_TRUE(closest(-1, 3, 0).isApprox(c));
  EXPECT_LT(closest(-1, -1, 0).norm(), 1e-15);
}

TEST(ClosestPointFinder, AgreesWithTryingAllTriangles) {
  TriangleMesh mesh;
  constexpr int kSide = 12;
  for (int i = 0; i <= kSide; ++i) {
    for (int j = 0; j <= kSide; ++j) {
      mesh.vertices.emplace_back(i, j, 2 * std::sin(i) * std::cos(j));
    }
  }
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      const int a = i * (kSide + 1) + j, b = a + kSide + 1;
      mesh.triangles.push_back({a, b, a + 1});
      mesh.triangles.push_back({b, b + 1, a + 1});
    }
  }
  const ClosestPointFinder finder(mesh);
  for (int i = 0; i < 50; ++i) {
    const Vector3d p(
        6 + 9 * std::sin(i), 6 + 9 * std::sin(2.3 * i), 4 * std::sin(5.1 * i));
    double best = 1e9;
    for (const auto& [a, b, c] : mesh.triangles) {
      const TrianglePoint closest = ClosestPointOnTriangle(
          p, mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]);
      best = std::min(best, (p - closest.point).norm());
    }
    EXPECT_NEAR(finder.Find(p).distance, best, 1e-12);
  }
}

}  // namespace
}  // namespace sweepfit
