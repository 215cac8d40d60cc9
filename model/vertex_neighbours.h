// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "model/mesh.h"

namespace sweepfit {

// Vertices that share an edge, ascending, per vertex.
std::vector<std::vector<int>> VertexNeighbours(const std::vector<Quad>& quads,
                                               std::size_t num_vertices);

}  // namespace sweepfit
