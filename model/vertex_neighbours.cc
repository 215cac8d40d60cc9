// SPDX-License-Identifier: Apache-2.0
#include "model/vertex_neighbours.h"

#include <algorithm>

namespace sweepfit {

std::vector<std::vector<int>> VertexNeighbours(const std::vector<Quad>& quads,
                                               std::size_t num_vertices) {
  std::vector<std::vector<int>> neighbours(num_vertices);
  for (const Quad& quad : quads) {
    for (int i = 0; i < 4; ++i) {
      const int a = quad[i];
      const int b = quad[(i + 1) % 4];
      if (a == b) continue;
      neighbours[a].push_back(b);
      neighbours[b].push_back(a);
    }
  }
  for (std::vector<int>& list : neighbours) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return neighbours;
}

}  // namespace sweepfit
