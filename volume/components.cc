// SPDX-License-Identifier: Apache-2.0
#include "volume/components.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace sweepfit {
namespace {

constexpr int kSize = BlockGrid::kBlockSize;

// A voxel by block and offset, as one number.
using VoxelId = std::int64_t;
constexpr VoxelId kNoVoxel = -1;

class VoxelGraph {
 public:
  explicit VoxelGraph(const BlockGrid& grid) : grid_(grid) {
    const auto& blocks = grid.blocks();
    neighbor_.resize(blocks.size());
    for (size_t b = 0; b < blocks.size(); ++b) {
      for (int axis = 0; axis < 3; ++axis) {
        for (int side = 0; side < 2; ++side) {
          Eigen::Vector3i index = blocks[b].index;
          index[axis] += side == 0 ? -1 : 1;
          neighbor_[b][2 * axis + side] = grid.FindBlock(index);
        }
      }
    }
  }

  VoxelId size() const {
    return static_cast<VoxelId>(grid_.blocks().size()) * kSize;
  }
  float value(VoxelId id) const {
    return grid_.blocks()[id / kSize].values[id % kSize];
  }
  // direction: 2 * axis + (0: down, 1: up).
  VoxelId Neighbor(VoxelId id, int direction) const {
    const auto block = static_cast<size_t>(id / kSize);
    const int offset = static_cast<int>(id % kSize);
    const int shift = 6 - 3 * (direction / 2);
    const int at = offset >> shift & 7;
    const bool up = direction % 2 == 1;
    if (up ? at < 7 : at > 0) {
      return id + (up ? 1 << shift : -(1 << shift));
    }
    const int next = neighbor_[block][direction];
    if (next < 0) return kNoVoxel;
    const int wrapped = up ? offset - (7 << shift) : offset + (7 << shift);
    return static_cast<VoxelId>(next) * kSize + wrapped;
  }

 private:
  const BlockGrid& grid_;
  std::vector<std::array<int, 6>> neighbor_;
};

// Component number of every inside voxel, -1 elsewhere; sizes by component.
std::vector<std::int32_t> LabelInside(const VoxelGraph& graph,
                                      std::vector<std::int64_t>* sizes) {
  std::vector<std::int32_t> label(graph.size(), -1);
  std::vector<VoxelId> stack;
  for (VoxelId seed = 0; seed < graph.size(); ++seed) {
    if (label[seed] >= 0 || graph.value(seed) >= 0) continue;
    const auto component = static_cast<std::int32_t>(sizes->size());
    std::int64_t count = 0;
    label[seed] = component;
    stack.push_back(seed);
    while (!stack.empty()) {
      const VoxelId id = stack.back();
      stack.pop_back();
      ++count;
      for (int d = 0; d < 6; ++d) {
        const VoxelId next = graph.Neighbor(id, d);
        if (next == kNoVoxel || label[next] >= 0 || graph.value(next) >= 0) {
          continue;
        }
        label[next] = component;
        stack.push_back(next);
      }
    }
    sizes->push_back(count);
  }
  return label;
}

// Gives every band voxel outside the label of the part it is nearest to, by
// steps across faces.
void SpreadLabels(const VoxelGraph& graph,
                  float band,
                  std::vector<std::int32_t>* label) {
  std::vector<VoxelId> front;
  for (VoxelId id = 0; id < graph.size(); ++id) {
    if ((*label)[id] >= 0) front.push_back(id);
  }
  std::vector<VoxelId> next_front;
  while (!front.empty()) {
    for (const VoxelId id : front) {
      for (int d = 0; d < 6; ++d) {
        const VoxelId next = graph.Neighbor(id, d);
        if (next == kNoVoxel || (*label)[next] >= 0 ||
            graph.value(next) >= band) {
          continue;
        }
        (*label)[next] = (*label)[id];
        next_front.push_back(next);
      }
    }
    front.swap(next_front);
    next_front.clear();
  }
}

}  // namespace

ComponentCount KeepLargestComponent(BlockGrid* grid) {
  ComponentCount result;
  std::vector<std::int64_t> sizes;
  const auto band = static_cast<float>(grid->band());
  const VoxelGraph graph(*grid);
  std::vector<std::int32_t> label = LabelInside(graph, &sizes);
  result.num_components = static_cast<int>(sizes.size());
  if (sizes.size() <= 1) return result;

  const auto largest = static_cast<std::int32_t>(
      std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  std::int64_t dropped = 0;
  for (const std::int64_t size : sizes) dropped += size;
  dropped -= sizes[largest];
  const double voxel = grid->voxel_size();
  result.dropped_volume = static_cast<double>(dropped) * voxel * voxel * voxel;

  SpreadLabels(graph, band, &label);
  std::vector<BlockGrid::Block> kept;
  for (size_t b = 0; b < grid->blocks().size(); ++b) {
    BlockGrid::Block block = grid->blocks()[b];
    bool empty = true;
    for (int o = 0; o < kSize; ++o) {
      if (label[b * kSize + o] != largest) block.values[o] = band;
      empty = empty && block.values[o] >= band;
    }
    if (!empty) kept.push_back(block);
  }
  *grid = BlockGrid(grid->voxel_size(), grid->band(), std::move(kept));
  return result;
}

}  // namespace sweepfit
