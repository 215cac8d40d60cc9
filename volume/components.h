// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "volume/block_grid.h"

namespace sweepfit {

struct ComponentCount {
  int num_components = 0;     // face-connected parts of the inside
  double dropped_volume = 0;  // cubic metres, by whole voxels
};

// Keeps the largest face-connected part of the inside; the others, and the
// band around them, become outside. Blocks without any inside or band left are
// dropped. Parts of equal size: the first in the order of blocks stays.
// `counts`: per block whether its voxels count for the size; empty: all do.
ComponentCount KeepLargestComponent(BlockGrid* grid,
                                    const std::vector<char>& counts = {});

}  // namespace sweepfit
