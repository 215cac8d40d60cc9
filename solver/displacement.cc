// SPDX-License-Identifier: Apache-2.0
#include "solver/displacement.h"

#include "model/sweep.h"

namespace sweepfit {

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
