// SPDX-License-Identifier: Apache-2.0
#include "volume/volume.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "model/input_error.h"
#include "volume/block_grid.h"
#include "volume/components.h"
#include "volume/cut_plane.h"

namespace sweepfit {
namespace {

// A closed tube of elliptic section along y: half axes a (x) and b (z).
TriangleMesh Tube(double a, double b, double height, double offset_x) {
  constexpr int kAround = 96;
  TriangleMesh mesh;
  for (const double y : {0.0, height}) {
    for (int i = 0; i < kAround; ++i) {
      const double angle = 2 * std::numbers::pi * i / kAround;
      mesh.vertices.emplace_back(
          offset_x + a * std::cos(angle), y, b * std::sin(angle));
    }
  }
  mesh.vertices.emplace_back(offset_x, 0, 0);
  mesh.vertices.emplace_back(offset_x, height, 0);
  for (int i = 0; i < kAround; ++i) {
    const int next = (i + 1) % kAround;
    mesh.triangles.push_back({i, kAround + i, next});
    mesh.triangles.push_back({next, kAround + i, kAround + next});
    mesh.triangles.push_back({2 * kAround, i, next});
    mesh.triangles.push_back({2 * kAround + 1, kAround + next, kAround + i});
  }
  return mesh;
}

TriangleMesh Join(TriangleMesh a, const TriangleMesh& b) {
  const int first = static_cast<int>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Triangle& t : b.triangles) {
    a.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  return a;
}

TEST(VolumeTest, SamplesDistanceAndGradient) {
  const TriangleMesh mesh = Tube(0.1, 0.06, 0.6, 0);
  ASSERT_GT(EnclosedVolume(mesh), 0);
  const Volume volume = VolumeFromMesh(mesh, 0.005);
  Eigen::Vector3d gradient;
  for (const double x : {0.09, 0.1, 0.108}) {
    EXPECT_NEAR(
        volume.SampleWithGradient({x, 0.3, 0}, &gradient), x - 0.1, 0.0005);
    EXPECT_NEAR(gradient.x(), 1, 0.03);
    EXPECT_NEAR(gradient.y(), 0, 0.03);
    // The section is curved: half a cell off its vertex the normal has turned.
    EXPECT_NEAR(gradient.z(), 0, 0.12);
  }
  EXPECT_EQ(volume.Sample({5, 5, 5}), volume.band_half_width());
  EXPECT_NEAR(volume.Sample({0, 0.3, 0}), -volume.band_half_width(), 1e-9);
  EXPECT_EQ(volume.Sample(Eigen::Vector3d::Constant(1e300)),
            volume.band_half_width());
  EXPECT_NEAR(volume.EnclosedVolume(), EnclosedVolume(mesh), 1e-5);
  EXPECT_LT((volume.BoxMin() - Eigen::Vector3d(-0.1, 0, -0.06)).norm(), 0.003);
  EXPECT_LT((volume.BoxMax() - Eigen::Vector3d(0.1, 0.6, 0.06)).norm(), 0.003);
}

TEST(VolumeTest, GradientIsThatOfTheInterpolation) {
  const Volume volume = VolumeFromMesh(Tube(0.1, 0.06, 0.6, 0), 0.005);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d point(
        0.1 * std::cos(i), 0.1 + 0.008 * i, 0.06 * std::sin(i));
    // Within one cell, away from its faces.
    const Eigen::Vector3d inside =
        0.005 * ((point / 0.005).array().floor() + 0.5);
    Eigen::Vector3d gradient;
    volume.SampleWithGradient(inside, &gradient);
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = 1e-3 * Eigen::Vector3d::Unit(axis);
      const double numeric =
          (volume.Sample(inside + step) - volume.Sample(inside - step)) / 2e-3;
      EXPECT_NEAR(gradient[axis], numeric, 1e-9);
    }
  }
}

TEST(VolumeTest, NeedsAMesh) {
  EXPECT_THROW(VolumeFromMesh({}, 0.005), InputError);
}

TEST(CutPlaneTest, FindsAnEllipseAndNotItsNeighbour) {
  const Volume volume = VolumeFromMesh(
      Join(Tube(0.08, 0.05, 0.6, 0), Tube(0.08, 0.05, 0.6, 0.18)), 0.004);
  const CutPlaneSection section =
      CutPlane(volume, {0.02, 0.3, 0.01}, Eigen::Vector3d(0, 1, 0), 0.3);
  ASSERT_TRUE(section.found);
  EXPECT_FALSE(section.touches_border);
  EXPECT_NEAR(section.area, std::numbers::pi * 0.08 * 0.05, 1e-4);
  EXPECT_LT((section.centroid_in_world - Eigen::Vector3d(0, 0.3, 0)).norm(),
            5e-4);
  EXPECT_NEAR(section.half_axis_long, 0.08, 1e-3);
  EXPECT_NEAR(section.half_axis_short, 0.05, 1e-3);
  EXPECT_NEAR(std::abs(section.long_direction.x()), 1, 1e-3);
}

TEST(CutPlaneTest, SeedsNearbyAndSaysWhenItLeaves) {
  const Volume volume = VolumeFromMesh(Tube(0.08, 0.05, 0.6, 0), 0.004);
  const Eigen::Vector3d normal(0, 1, 0);
  EXPECT_TRUE(CutPlane(volume, {0.1, 0.3, 0}, normal, 0.3).found);
  EXPECT_FALSE(CutPlane(volume, {0.15, 0.3, 0}, normal, 0.3).found);
  EXPECT_TRUE(CutPlane(volume, {0, 0.3, 0}, normal, 0.06).touches_border);
}

TEST(RayExitTest, MeasuresToTheSurface) {
  const Volume volume = VolumeFromMesh(Tube(0.08, 0.05, 0.6, 0), 0.004);
  const Eigen::Vector3d x(1, 0, 0);
  EXPECT_NEAR(RayExit(volume, {0, 0.3, 0}, x, 1), 0.08, 1e-3);
  EXPECT_NEAR(RayExit(volume, {-0.05, 0.3, 0}, x, 1), 0.13, 1e-3);
  EXPECT_LT(RayExit(volume, {0, 0.3, 0}, x, 0.05), 0);
}

TEST(ComponentsTest, KeepsTheLargerOfTwo) {
  BlockGrid::Block small{{0, 0, 0}, {}};
  BlockGrid::Block large{{3, 0, 0}, {}};
  small.values.fill(0.03f);
  large.values.fill(0.03f);
  small.values[0] = -0.01f;
  for (int i = 100; i < 110; ++i) large.values[i] = -0.01f;
  BlockGrid grid(0.01, 0.03, {small, large});
  const ComponentCount count = KeepLargestComponent(&grid);
  // Ten neighbours along z run over one row of eight into the next.
  EXPECT_EQ(count.num_components, 2);
  EXPECT_NEAR(count.dropped_volume, 1e-6, 1e-12);
  EXPECT_EQ(grid.Value(0, 0, 0), 0.03f);
  EXPECT_EQ(grid.FindBlock({0, 0, 0}), -1);
  EXPECT_EQ(grid.Value(24 + (105 >> 6), 105 >> 3 & 7, 105 & 7), -0.01f);
}

TEST(ComponentsTest, JoinsAcrossFacesOfBlocks) {
  // A U whose arms lie in blocks of their own meets in the block between them;
  // a voxel between the arms belongs to neither.
  std::vector<BlockGrid::Block> blocks;
  for (int x = 0; x < 3; ++x) {
    for (int y = 0; y < 2; ++y) {
      BlockGrid::Block block{{x, y, 0}, {}};
      block.values.fill(y == 0 || x != 1 ? -0.03f : 0.03f);
      blocks.push_back(block);
    }
  }
  float& single = blocks[3].values[3 << 6 | 4 << 3 | 3];
  single = -0.01f;
  BlockGrid grid(0.01, 0.03, blocks);
  const ComponentCount count = KeepLargestComponent(&grid);
  EXPECT_EQ(count.num_components, 2);
  EXPECT_NEAR(count.dropped_volume, 1e-6, 1e-12);
  EXPECT_EQ(grid.Value(8 + 3, 8 + 4, 3), 0.03f);
  EXPECT_EQ(grid.Value(4, 12, 4), -0.03f);
  EXPECT_EQ(grid.Value(20, 12, 4), -0.03f);
}

TEST(ComponentsTest, TakesTheFieldAroundWhatIsDropped) {
  // Two balls ten voxels apart: the smaller one's field goes with it, that of
  // the larger one stays as it is.
  BlockGrid::Block left{{0, 0, 0}, {}}, right{{1, 0, 0}, {}};
  const auto ball = [](BlockGrid::Block* block, int x, float radius) {
    for (int o = 0; o < BlockGrid::kBlockSize; ++o) {
      const Eigen::Vector3d at(8 * block->index.x() + (o >> 6) - x,
                               (o >> 3 & 7) - 3.0,
                               (o & 7) - 3.0);
      const float value = 0.01f * static_cast<float>(at.norm() - radius);
      block->values[o] = std::min(value, 0.03f);
    }
  };
  ball(&left, 2, 1.2f);
  ball(&right, 12, 2.2f);
  BlockGrid grid(0.01, 0.03, {left, right});
  EXPECT_EQ(KeepLargestComponent(&grid).num_components, 2);
  EXPECT_EQ(grid.Value(2, 3, 3), 0.03f);
  EXPECT_EQ(grid.Value(4, 3, 3), 0.03f);
  EXPECT_LT(grid.Value(12, 3, 3), 0);
  EXPECT_EQ(grid.Value(9, 3, 3), right.values[1 << 6 | 3 << 3 | 3]);
}

}  // namespace
}  // namespace sweepfit
