// SPDX-License-Identifier: Apache-2.0
#include "volume/components.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "model/disjoint_sets.h"

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
    inside_.resize(blocks.size());
    tbb::parallel_for(size_t{0}, blocks.size(), [&](size_t b) {
      const BlockGrid::BlockValues& values = blocks[b].values;
      inside_[b] = std::all_of(
          values.begin(), values.end(), [](float value) { return value < 0; });
    });
  }

  VoxelId size() const {
    return static_cast<VoxelId>(grid_.blocks().size()) * kSize;
  }
  float value(VoxelId id) const {
    return grid_.blocks()[id / kSize].values[id % kSize];
  }
  const std::vector<BlockGrid::Block>& blocks() const { return grid_.blocks(); }
  // Whether all of a block is inside.
  bool IsInside(size_t block) const { return inside_[block]; }
  // Directions: 2 * axis + (0: down, 1: up). -1: there is none.
  int NeighborBlock(size_t block, int direction) const {
    return neighbor_[block][direction];
  }
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
  std::vector<char> inside_;  // whole blocks
};

// Numbers the connected parts of the inside voxels of one block from 0, in the
// order of their first voxels; `label` of the others is left. Returns how many.
std::int32_t LabelBlock(const BlockGrid::Block& block, std::int32_t* label) {
  std::int32_t count = 0;
  std::array<std::int16_t, kSize> stack;
  for (int seed = 0; seed < kSize; ++seed) {
    if (label[seed] >= 0 || block.values[seed] >= 0) continue;
    int height = 0;
    label[seed] = count;
    stack[height++] = static_cast<std::int16_t>(seed);
    while (height > 0) {
      const int offset = stack[--height];
      for (const int shift : {0, 3, 6}) {
        const int at = offset >> shift & 7;
        for (const int step : {-1, 1}) {
          if (at + step < 0 || at + step > 7) continue;
          const int next = offset + step * (1 << shift);
          if (label[next] >= 0 || block.values[next] >= 0) continue;
          label[next] = count;
          stack[height++] = static_cast<std::int16_t>(next);
        }
      }
    }
    ++count;
  }
  return count;
}

// Component number of every inside voxel, -1 elsewhere. Parts within blocks
// first, which can be found at once, then across faces.
std::vector<std::int32_t> LabelInside(const VoxelGraph& graph,
                                      int* num_components) {
  const std::vector<BlockGrid::Block>& blocks = graph.blocks();
  std::vector<std::int32_t> label(graph.size(), -1);
  std::vector<std::int32_t> first(blocks.size() + 1, 0);
  tbb::parallel_for(size_t{0}, blocks.size(), [&](size_t b) {
    if (graph.IsInside(b)) {
      std::fill_n(&label[b * kSize], kSize, 0);
      first[b + 1] = 1;
    } else {
      first[b + 1] = LabelBlock(blocks[b], &label[b * kSize]);
    }
  });
  std::partial_sum(first.begin(), first.end(), first.begin());
  tbb::parallel_for(size_t{0}, blocks.size(), [&](size_t b) {
    for (size_t i = b * kSize; i < (b + 1) * kSize; ++i) {
      if (label[i] >= 0) label[i] += first[b];
    }
  });
  DisjointSets parts(first.back());
  for (size_t b = 0; b < blocks.size(); ++b) {
    for (const int axis : {0, 1, 2}) {
      const int shift = 6 - 3 * axis;
      const int next = graph.NeighborBlock(b, 2 * axis + 1);
      if (next < 0) continue;
      for (int o = 0; o < kSize; ++o) {
        if ((o >> shift & 7) != 7) continue;
        const std::int32_t here = label[b * kSize + o];
        const std::int32_t there =
            label[static_cast<size_t>(next) * kSize + o - (7 << shift)];
        if (here >= 0 && there >= 0) parts.Unite(here, there);
      }
    }
  }
  std::vector<std::int32_t> component(first.back());
  for (std::int32_t part = 0; part < first.back(); ++part) {
    const std::int32_t root = parts.Find(part);
    component[part] = root == part ? (*num_components)++ : component[root];
  }
  for (std::int32_t& of_voxel : label) {
    if (of_voxel >= 0) of_voxel = component[of_voxel];
  }
  return label;
}

// Voxels by component, of the blocks that count; `counts` empty: of all.
std::vector<std::int64_t> Sizes(const std::vector<std::int32_t>& label,
                                int num_components,
                                const std::vector<char>& counts) {
  std::vector<std::int64_t> sizes(num_components, 0);
  for (size_t i = 0; i < label.size(); ++i) {
    if (label[i] < 0 || (!counts.empty() && counts[i / kSize] == 0)) continue;
    ++sizes[label[i]];
  }
  return sizes;
}

// Blocks within two of one that holds a voxel of a part other than `kept`.
std::vector<char> NearOtherParts(const BlockGrid& grid,
                                 const std::vector<std::int32_t>& label,
                                 std::int32_t kept) {
  std::vector<char> near(grid.blocks().size(), 0);
  for (size_t b = 0; b < near.size(); ++b) {
    const auto first = label.begin() + static_cast<std::ptrdiff_t>(b * kSize);
    if (std::none_of(first, first + kSize, [&](std::int32_t of_voxel) {
          return of_voxel >= 0 && of_voxel != kept;
        })) {
      continue;
    }
    for (int n = 0; n < 125; ++n) {
      const int next =
          grid.FindBlock(grid.blocks()[b].index +
                         Eigen::Vector3i(n / 25 - 2, n / 5 % 5 - 2, n % 5 - 2));
      if (next >= 0) near[next] = 1;
    }
  }
  return near;
}

// Gives the band voxels outside, as far as a block's side from parts other than
// `kept`, the label of the part they are nearest to, by steps across faces.
void SpreadLabels(const VoxelGraph& graph,
                  const std::vector<char>& near,
                  float band,
                  std::vector<std::int32_t>* label) {
  std::vector<VoxelId> front;
  for (size_t block = 0; block < near.size(); ++block) {
    if (!near[block]) continue;
    for (size_t id = block * kSize; id < (block + 1) * kSize; ++id) {
      if ((*label)[id] >= 0) front.push_back(static_cast<VoxelId>(id));
    }
  }
  std::vector<VoxelId> next_front;
  for (int step = 0; step < BlockGrid::kSide && !front.empty(); ++step) {
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

ComponentCount KeepLargestComponent(BlockGrid* grid,
                                    const std::vector<char>& counts) {
  ComponentCount result;
  const auto band = static_cast<float>(grid->band());
  const VoxelGraph graph(*grid);
  std::vector<std::int32_t> label = LabelInside(graph, &result.num_components);
  if (result.num_components <= 1) return result;

  const std::vector<std::int64_t> sizes =
      Sizes(label, result.num_components, counts);
  const auto largest = static_cast<std::int32_t>(
      std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  const auto dropped =
      std::count_if(label.begin(), label.end(), [&](std::int32_t of_voxel) {
        return of_voxel >= 0 && of_voxel != largest;
      });
  const double voxel = grid->voxel_size();
  result.dropped_volume = static_cast<double>(dropped) * voxel * voxel * voxel;

  SpreadLabels(graph, NearOtherParts(*grid, label, largest), band, &label);
  std::vector<BlockGrid::Block> kept = std::move(grid->mutable_blocks());
  size_t count = 0;
  for (size_t b = 0; b < kept.size(); ++b) {
    bool empty = true;
    for (int o = 0; o < kSize; ++o) {
      float& value = kept[b].values[o];
      const std::int32_t of_voxel = label[b * kSize + o];
      if (of_voxel >= 0 && of_voxel != largest) value = band;
      empty = empty && value >= band;
    }
    if (empty) continue;
    if (count != b) kept[count] = kept[b];
    ++count;
  }
  kept.resize(count);
  *grid = BlockGrid(grid->voxel_size(), grid->band(), std::move(kept));
  return result;
}

}  // namespace sweepfit
