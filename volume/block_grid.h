// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace sweepfit {

// A sparse grid of signed distances in blocks of 8^3 voxels, for fast reading
// from many threads. Voxel (i, j, k) is centred at voxel_size * (i, j, k) in
// the world. Values are metres, negative inside, clamped to +- band; what no
// block covers is +band. Within a block the voxel (x, y, z) has the offset
// 64 x + 8 y + z, as in an OpenVDB leaf.
class BlockGrid {
 public:
  static constexpr int kSide = 8;
  static constexpr int kBlockSize = kSide * kSide * kSide;
  using BlockValues = std::array<float, kBlockSize>;

  struct Block {
    Eigen::Vector3i index;  // of the voxel (0, 0, 0) of the block, over kSide
    BlockValues values;
  };

  BlockGrid(double voxel_size, double band, std::vector<Block> blocks);

  double voxel_size() const { return voxel_size_; }
  double band() const { return band_; }
  const std::vector<Block>& blocks() const { return blocks_; }
  std::vector<Block>& mutable_blocks() { return blocks_; }

  // Position in blocks(), or -1 where there is none.
  int FindBlock(const Eigen::Vector3i& block_index) const {
    const Eigen::Vector3i local = block_index - first_block_;
    if ((local.array() < 0).any() || (local.array() >= size_.array()).any()) {
      return -1;
    }
    return table_[(static_cast<size_t>(local.x()) * size_.y() + local.y()) *
                      size_.z() +
                  local.z()];
  }

  float Value(int i, int j, int k) const {
    const int block = FindBlock({i >> 3, j >> 3, k >> 3});
    if (block < 0) return static_cast<float>(band_);
    return blocks_[block].values[(i & 7) << 6 | (j & 7) << 3 | (k & 7)];
  }

  // Trilinear value and, unless null, gradient at a point in the world.
  double Sample(const Eigen::Vector3d& point_in_world,
                Eigen::Vector3d* gradient) const;

  // Box around the zero level, in the world; along each axis interpolated
  // between the outermost inside voxels and their neighbours. Both corners are
  // zero when nothing is inside.
  void Box(Eigen::Vector3d* box_min, Eigen::Vector3d* box_max) const;

  // Volume of the inside, cubic metres, with sub-voxel coverage.
  double EnclosedVolume() const;

 private:
  void IndexBlocks();

  double voxel_size_;
  double band_;
  std::vector<Block> blocks_;
  Eigen::Vector3i first_block_ = Eigen::Vector3i::Zero();
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  std::vector<std::int32_t> table_;
};

}  // namespace sweepfit
