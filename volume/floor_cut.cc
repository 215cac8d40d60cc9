// SPDX-License-Identifier: Apache-2.0
#include "volume/floor_cut.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "volume/components.h"
#include "volume/floor_level.h"
#include "volume/volume_impl.h"

namespace sweepfit {
namespace {

// A wedge is cut when it is this many times as deep as the floor is uncertain.
constexpr double kDeepWedge = 4;

// How far above the soles FindFloor may find them: a view from above does not
// see the underside of a round edge, and a ray a pixel within the outline meets
// the edge higher still.
double MostFloorError(const std::vector<View>& views, const Volume& hull) {
  constexpr double kSoleRadius = 0.02;  // metres
  const Eigen::Vector3d low = hull.BoxMin(), high = hull.BoxMax();
  const Eigen::Vector3d feet(
      0.5 * (low.x() + high.x()), low.y(), 0.5 * (low.z() + high.z()));
  double most = 0;
  for (const View& view : views) {
    const Eigen::Vector3d way = view.camera.CenterInWorld() - feet;
    const double pixel = way.norm() / view.camera.FocalLength();
    const double sine = std::clamp(way.normalized().y(), 0.0, 1.0);
    most = std::max(most,
                    kSoleRadius * (1 - std::sqrt(1 - sine * sine)) +
                        std::sqrt(2 * kSoleRadius * pixel) * sine + pixel);
  }
  return most;
}

}  // namespace

Volume CutBelowFloor(const std::vector<View>& views,
                     Volume hull,
                     double* depth) {
  if (depth != nullptr) *depth = 0;
  const double floor = FindFloor(views, hull);
  const double lowest = hull.BoxMin().y();
  if (!(floor - lowest > kDeepWedge * MostFloorError(views, hull))) {
    return hull;
  }
  std::vector<BlockGrid::Block> blocks = hull.impl().blocks.blocks();
  const double band = hull.band_half_width();
  for (BlockGrid::Block& block : blocks) {
    for (int o = 0; o < BlockGrid::kBlockSize; ++o) {
      const int row = BlockGrid::kSide * block.index.y() + (o >> 3 & 7);
      const double below =
          std::clamp(floor - row * hull.voxel_size(), -band, band);
      block.values[o] = std::max(block.values[o], static_cast<float>(below));
    }
  }
  BlockGrid grid(hull.voxel_size(), band, std::move(blocks));
  KeepLargestComponent(&grid);
  if (depth != nullptr) *depth = floor - lowest;
  return MakeVolume(std::move(grid));
}

}  // namespace sweepfit
