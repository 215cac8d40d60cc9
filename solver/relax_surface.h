// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "model/body.h"

namespace sweepfit {

struct RelaxedSurface {
  int moved_vertices = 0;
  int turned_faces_left = 0;
  int long_edges_left = 0;
};

// Undoes what the evidence tore: faces that look away from where they looked on
// the reference, and edges several times as long. Their displacements and those
// of their neighbours are tied to each other, more with every round that leaves
// them torn, and so wider; the rest stays where it is. Changes
// body->displacement_in_section only.
//
// reference_rest: vertices at rest of the same topology, metres, before radii
// and vertices were fitted.
RelaxedSurface RelaxSurface(const std::vector<Eigen::Vector3d>& reference_rest,
                            Body* body);

}  // namespace sweepfit
