// SPDX-License-Identifier: Apache-2.0
#include "solver/displacement.h"

#include <set>

#include "model/sweep.h"

namespace sweepfit {

std::vector<std::vector<int>> VertexNeighbours(const BodyTopology& topology,
                                               size_t num_vertices) {
  std::vector<std::set<int>> sets(num_vertices);
  for (const Quad& quad : topology.quads) {
    for (int k = 0; k < 4; ++k) {
      if (quad[k] == quad[(k + 1) % 4]) continue;
      sets[quad[k]].insert(quad[(k + 1) % 4]);
      sets[quad[(k + 1) % 4]].insert(quad[k]);
    }
  }
  std::vector<std::vector<int>> neighbours;
  for (const auto& set : sets) neighbours.emplace_back(set.begin(), set.end());
  return neighbours;
}

void DisplaceAtRest(const std::vector<Eigen::Vector3d>& move, Body* body) {
  const JointFrames rest = RestFrames(body->skeleton);
  std::vector<SweepAxis> axes;
  axes.reserve(body->sweeps.size());
  for (const Sweep& sweep : body->sweeps) {
    axes.emplace_back(sweep, body->skeleton, rest);
  }
  for (int v = 0; v < body->num_vertices(); ++v) {
    const SweepAttachment& heaviest = body->binding[v].attachment[0];
    const Eigen::Matrix3d frame =
        axes[heaviest.sweep].At(heaviest.u).world_from_section;
    body->displacement_in_section[v] += frame.transpose() * move[v];
  }
}

}  // namespace sweepfit
