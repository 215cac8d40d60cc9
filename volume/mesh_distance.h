// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "model/mesh.h"
#include "volume/block_grid.h"

namespace sweepfit {

// Signed distances to a closed mesh at the voxels of a BlockGrid, negative
// inside, clamped to +- band. Inside is where the surface winds around more
// often one way than the other, counted along grid lines: folds of the surface
// do no harm. Exact up to about band minus two voxels from the surface; beyond,
// voxels may already hold +-band. The mesh must outlive the object. Thread-safe
// once built.
class MeshDistance {
 public:
  // band: three voxels or more.
  MeshDistance(const TriangleMesh& mesh, double voxel_size, double band);

  // At the voxels of one block, given by the index of BlockGrid::Block.
  BlockGrid::BlockValues Evaluate(const Eigen::Vector3i& block_index) const;

  // The blocks that are not wholly outside, ascending; evaluated.
  std::vector<BlockGrid::Block> Blocks() const;

 private:
  // Where a grid line along z crosses the surface, in voxels.
  struct Crossing {
    float z;
    std::int8_t winding;  // +1 where the line enters
  };

  void FindCrossings();
  void SortIntoBlocks();
  // Position in the box of blocks, or -1.
  std::int64_t BlockAt(const Eigen::Vector3i& block_index) const;

  const TriangleMesh& mesh_;
  const double voxel_size_;
  const double band_;

  // The box of blocks that holds the mesh and its band.
  Eigen::Vector3i first_block_, num_blocks_;
  // Per block the vertices and the large triangles within the band of it.
  std::vector<int> first_vertex_, vertices_;
  std::vector<int> first_large_, large_;
  // Per vertex its triangles.
  std::vector<int> first_around_, around_;
  // Per column of voxels.
  std::vector<int> first_crossing_;
  std::vector<Crossing> crossings_;
};

}  // namespace sweepfit
