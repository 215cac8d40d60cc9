// SPDX-License-Identifier: Apache-2.0
#include "volume/block_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace sweepfit {

BlockGrid::BlockGrid(double voxel_size, double band, std::vector<Block> blocks)
    : voxel_size_(voxel_size), band_(band), blocks_(std::move(blocks)) {
  IndexBlocks();
}

void BlockGrid::IndexBlocks() {
  if (blocks_.empty()) return;
  Eigen::Vector3i low = blocks_[0].index;
  Eigen::Vector3i high = low;
  for (const Block& block : blocks_) {
    low = low.cwiseMin(block.index);
    high = high.cwiseMax(block.index);
  }
  first_block_ = low;
  size_ = high - low + Eigen::Vector3i::Ones();
  table_.assign(static_cast<size_t>(size_.x()) * size_.y() * size_.z(), -1);
  for (size_t b = 0; b < blocks_.size(); ++b) {
    const Eigen::Vector3i local = blocks_[b].index - low;
    table_[(static_cast<size_t>(local.x()) * size_.y() + local.y()) *
               size_.z() +
           local.z()] = static_cast<std::int32_t>(b);
  }
}

double BlockGrid::Sample(const Eigen::Vector3d& point_in_world,
                         Eigen::Vector3d* gradient) const {
  // Keeps the conversion to int defined far away; nothing is known there.
  constexpr double kFarthest = 1e8;
  const Eigen::Vector3d p = point_in_world / voxel_size_;
  if (!(p.cwiseAbs().maxCoeff() < kFarthest)) {
    if (gradient != nullptr) gradient->setZero();
    return band_;
  }
  const int i = static_cast<int>(std::floor(p.x()));
  const int j = static_cast<int>(std::floor(p.y()));
  const int k = static_cast<int>(std::floor(p.z()));
  const double fx = p.x() - i;
  const double fy = p.y() - j;
  const double fz = p.z() - k;
  double v[8];
  if ((i & 7) < 7 && (j & 7) < 7 && (k & 7) < 7) {
    const int block = FindBlock({i >> 3, j >> 3, k >> 3});
    if (block < 0) {
      if (gradient != nullptr) gradient->setZero();
      return band_;
    }
    const float* corner =
        blocks_[block].values.data() + ((i & 7) << 6 | (j & 7) << 3 | (k & 7));
    for (int c = 0; c < 8; ++c) {
      v[c] = corner[(c & 4) * 16 + (c & 2) * 4 + (c & 1)];
    }
  } else {
    for (int c = 0; c < 8; ++c) {
      v[c] = Value(i + (c >> 2), j + (c >> 1 & 1), k + (c & 1));
    }
  }
  // Interpolated along z, then y, then x.
  const double z00 = v[0] + fz * (v[1] - v[0]);
  const double z01 = v[2] + fz * (v[3] - v[2]);
  const double z10 = v[4] + fz * (v[5] - v[4]);
  const double z11 = v[6] + fz * (v[7] - v[6]);
  const double y0 = z00 + fy * (z01 - z00);
  const double y1 = z10 + fy * (z11 - z10);
  if (gradient != nullptr) {
    const double dz0 = (v[1] - v[0]) + fy * ((v[3] - v[2]) - (v[1] - v[0]));
    const double dz1 = (v[5] - v[4]) + fy * ((v[7] - v[6]) - (v[5] - v[4]));
    const double dy0 = z01 - z00;
    const double dy1 = z11 - z10;
    *gradient = Eigen::Vector3d(
                    y1 - y0, dy0 + fx * (dy1 - dy0), dz0 + fx * (dz1 - dz0)) /
                voxel_size_;
  }
  return y0 + fx * (y1 - y0);
}

void BlockGrid::Box(Eigen::Vector3d* box_min, Eigen::Vector3d* box_max) const {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  Eigen::Vector3d low = Eigen::Vector3d::Constant(kNone);
  Eigen::Vector3d high = -low;
  for (const Block& block : blocks_) {
    const Eigen::Vector3i first = block.index * kSide;
    // Blocks that lie within the box already cannot move it.
    const Eigen::Vector3d block_low = first.cast<double>().array() - 1;
    const Eigen::Vector3d block_high = first.cast<double>().array() + kSide;
    if ((block_low.array() >= low.array()).all() &&
        (block_high.array() <= high.array()).all()) {
      continue;
    }
    for (int o = 0; o < kBlockSize; ++o) {
      const double inside = block.values[o];
      if (inside >= 0) continue;
      const Eigen::Vector3i voxel =
          first + Eigen::Vector3i(o >> 6, o >> 3 & 7, o & 7);
      for (int axis = 0; axis < 3; ++axis) {
        for (const int step : {-1, 1}) {
          Eigen::Vector3i next = voxel;
          next[axis] += step;
          const double outside = Value(next.x(), next.y(), next.z());
          if (outside < 0) continue;
          const double at = voxel[axis] + step * inside / (inside - outside);
          low[axis] = std::min(low[axis], at);
          high[axis] = std::max(high[axis], at);
        }
      }
    }
  }
  if (!(low.x() <= high.x())) {
    low.setZero();
    high.setZero();
  }
  *box_min = low * voxel_size_;
  *box_max = high * voxel_size_;
}

double BlockGrid::EnclosedVolume() const {
  double covered = 0;
  for (const Block& block : blocks_) {
    for (const float value : block.values) {
      covered += std::clamp(0.5 - value / voxel_size_, 0.0, 1.0);
    }
  }
  return covered * voxel_size_ * voxel_size_ * voxel_size_;
}

}  // namespace sweepfit
