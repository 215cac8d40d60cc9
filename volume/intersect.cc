// SPDX-License-Identifier: Apache-2.0
#include "volume/intersect.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "volume/components.h"
#include "volume/mesh_distance.h"
#include "volume/volume_impl.h"

namespace sweepfit {

Volume IntersectWithMesh(const Volume& hull, const TriangleMesh& mesh) {
  const MeshDistance inner(mesh, hull.voxel_size(), hull.band_half_width());
  std::vector<BlockGrid::Block> blocks = hull.impl().blocks.blocks();
  tbb::parallel_for(size_t{0}, blocks.size(), [&](size_t b) {
    BlockGrid::Block& block = blocks[b];
    const BlockGrid::BlockValues values = inner.Evaluate(block.index);
    for (int o = 0; o < BlockGrid::kBlockSize; ++o) {
      block.values[o] = std::max(block.values[o], values[o]);
    }
  });
  BlockGrid grid(hull.voxel_size(), hull.band_half_width(), std::move(blocks));
  KeepLargestComponent(&grid);
  return MakeVolume(std::move(grid));
}

}  // namespace sweepfit
