// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <utility>

#include "volume/block_grid.h"
#include "volume/vdb_grid.h"
#include "volume/volume.h"

namespace sweepfit {

// The same level set twice: as OpenVDB grid to mesh and to save, as blocks to
// sample.
struct Volume::Impl {
  BlockGrid blocks;
  std::shared_ptr<const VdbGrid> vdb;
  Eigen::Vector3d box_min = Eigen::Vector3d::Zero();
  Eigen::Vector3d box_max = Eigen::Vector3d::Zero();

  Impl(BlockGrid block_grid, std::shared_ptr<const VdbGrid> vdb_grid)
      : blocks(std::move(block_grid)), vdb(std::move(vdb_grid)) {
    blocks.Box(&box_min, &box_max);
  }
};

// The volume of a grid of blocks.
Volume MakeVolume(BlockGrid blocks);

// Throughout the room: half the width of the band that is known, in voxels.
inline constexpr double kBandVoxels = 3;

}  // namespace sweepfit
