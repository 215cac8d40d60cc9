// SPDX-License-Identifier: Apache-2.0
#include "solver/displacement.h"

namespace sweepfit {

void DisplaceAtRest(const std::vector<Eigen::Vector3d>& move, Body* body) {
  const std::vector<SweepAxis> axes =
      MakeAxes(*body, RestFrames(body->skeleton));
  for (int v = 0; v < body->num_vertices(); ++v) {
    const SweepAttachment& heaviest = body->binding[v].attachment[0];
    const Eigen::Matrix3d frame =
        axes[heaviest.sweep].At(heaviest.u).world_from_section;
    body->displacement_in_section[v] += frame.transpose() * move[v];
  }
}

}  // namespace sweepfit
