// SPDX-License-Identifier: Apache-2.0
#include "volume/mesh_distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "model/closest_point.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

constexpr double kVoxel = 0.01;
constexpr double kBand = 3 * kVoxel;

// Rows of latitude between poles at +-y, outward.
TriangleMesh Ball(const Vector3d& center, double radius, int rows) {
  TriangleMesh mesh;
  const int around = 2 * rows;
  mesh.vertices.push_back(center + Vector3d(0, radius, 0));
  for (int i = 1; i < rows; ++i) {
    const double polar = std::numbers::pi * i / rows;
    for (int j = 0; j < around; ++j) {
      const double azimuth = 2 * std::numbers::pi * j / around;
      mesh.vertices.push_back(
          center + radius * Vector3d(std::sin(polar) * std::sin(azimuth),
                                     std::cos(polar),
                                     std::sin(polar) * std::cos(azimuth)));
    }
  }
  mesh.vertices.push_back(center - Vector3d(0, radius, 0));
  const int last = static_cast<int>(mesh.vertices.size()) - 1;
  const auto at = [&](int i, int j) {
    return i == 0 ? 0 : i == rows ? last : 1 + (i - 1) * around + j % around;
  };
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < around; ++j) {
      if (i > 0) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
      }
      if (i + 1 < rows) {
        mesh.triangles.push_back(
            {at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)});
      }
    }
  }
  return mesh;
}

TriangleMesh Box(const Vector3d& low, const Vector3d& high) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.emplace_back(i & 1 ? high.x() : low.x(),
                               i & 2 ? high.y() : low.y(),
                               i & 4 ? high.z() : low.z());
  }
  mesh.triangles = {{0, 2, 1},
                    {1, 2, 3},
                    {4, 5, 6},
                    {5, 7, 6},
                    {0, 1, 4},
                    {1, 5, 4},
                    {2, 6, 3},
                    {3, 6, 7},
                    {0, 4, 2},
                    {2, 4, 6},
                    {1, 3, 5},
                    {3, 7, 5}};
  return mesh;
}

void Append(const TriangleMesh& part, bool inside_out, TriangleMesh* mesh) {
  const int first = static_cast<int>(mesh->vertices.size());
  mesh->vertices.insert(
      mesh->vertices.end(), part.vertices.begin(), part.vertices.end());
  for (Triangle t : part.triangles) {
    for (int& v : t) v += first;
    if (inside_out) std::swap(t[1], t[2]);
    mesh->triangles.push_back(t);
  }
}

BlockGrid Grid(const TriangleMesh& mesh) {
  return BlockGrid(kVoxel, kBand, MeshDistance(mesh, kVoxel, kBand).Blocks());
}

// visit(point, value) for every voxel of a cube about the origin.
template <typename Visit>
void ForEachVoxel(const BlockGrid& grid, double reach, Visit visit) {
  const int n = static_cast<int>(reach / kVoxel);
  for (int i = -n; i <= n; ++i) {
    for (int j = -n; j <= n; ++j) {
      for (int k = -n; k <= n; ++k) {
        visit(kVoxel * Vector3d(i, j, k), grid.Value(i, j, k));
      }
    }
  }
}

// Facets of half a voxel, and of several voxels.
class MeshDistanceTest : public ::testing::TestWithParam<int> {};

TEST_P(MeshDistanceTest, IsExactNearTheSurface) {
  const TriangleMesh mesh = Ball({0.003, -0.002, 0.001}, 0.1, GetParam());
  const ClosestPointFinder finder(mesh);
  int near = 0;
  ForEachVoxel(Grid(mesh), 0.15, [&](const Vector3d& p, float value) {
    const ClosestPointFinder::Result closest = finder.Find(p);
    const Triangle& t = mesh.triangles[closest.triangle];
    const Vector3d normal =
        (mesh.vertices[t[1]] - mesh.vertices[t[0]])
            .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    const bool inside = normal.dot(p - closest.on_mesh.point) < 0;
    EXPECT_EQ(value < 0, inside) << p.transpose();
    EXPECT_GE(std::abs(value), std::min(closest.distance, kBand) - 1e-6);
    if (closest.distance > kVoxel) return;
    ++near;
    EXPECT_NEAR(std::abs(value), closest.distance, 1e-4) << p.transpose();
  });
  EXPECT_GT(near, 1000);
}

INSTANTIATE_TEST_SUITE_P(Rows, MeshDistanceTest, ::testing::Values(60, 8));

TEST(MeshDistanceTest, HoldsWhereGridLinesRunAlongEdges) {
  const Vector3d half(0.06, 0.05, 0.07);
  ForEachVoxel(
      Grid(Box(-half, half)), 0.12, [&](const Vector3d& p, float value) {
        const double most = (p.cwiseAbs() - half).maxCoeff();
        if (most < -1e-9) {
          EXPECT_NEAR(value, std::max(most, -kBand), 1e-6) << p.transpose();
        } else if (most > 1e-9) {
          EXPECT_GT(value, 0) << p.transpose();
        } else {
          EXPECT_NEAR(value, 0, 1e-6) << p.transpose();
        }
      });
}

TEST(MeshDistanceTest, SurfacesThatOverlapLeaveNoHole) {
  TriangleMesh mesh;
  const Vector3d a(-0.03, 0, 0), b(0.03, 0, 0);
  Append(Ball(a, 0.06, 40), false, &mesh);
  Append(Ball(b, 0.06, 40), false, &mesh);
  ForEachVoxel(Grid(mesh), 0.12, [&](const Vector3d& p, float value) {
    const double least = std::min((p - a).norm(), (p - b).norm()) - 0.06;
    if (std::abs(least) > 1e-3) {
      EXPECT_EQ(value < 0, least < 0) << p.transpose();
    }
  });
}

TEST(MeshDistanceTest, ASurfaceTurnedInsideOutIsAHollow) {
  TriangleMesh mesh;
  Append(Ball(Vector3d::Zero(), 0.1, 60), false, &mesh);
  Append(Ball(Vector3d::Zero(), 0.05, 40), true, &mesh);
  const BlockGrid grid = Grid(mesh);
  EXPECT_GT(grid.Value(0, 0, 0), 0);
  EXPECT_LT(grid.Value(7, 0, 0), 0);
  EXPECT_GT(grid.Value(11, 0, 0), 0);
}

}  // namespace
}  // namespace sweepfit
