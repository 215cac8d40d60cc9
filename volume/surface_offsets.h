// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "volume/rim_contacts.h"
#include "volume/vertex_rings.h"

namespace sweepfit {

// Offsets along the normals, metres, that minimise
//   sum_v (n_v . L(x + offset n)_v / (h^2 / 2))^2 / sigma_curvature_v^2
//   + sum_targets weight (slope offset - value)^2 + weak sum_v offset_v^2,
// L: mean of the neighbours minus the vertex, h: mean edge length; so the first
// term is the mean curvature. offset_v <= upper_v is kept by cutting off: the
// caller moves the surface in several steps.
std::vector<double> SolveOffsets(const std::vector<Eigen::Vector3d>& vertices,
                                 const std::vector<Eigen::Vector3d>& normals,
                                 const VertexRings& rings,
                                 const std::vector<OffsetTarget>& targets,
                                 const std::vector<double>& upper,
                                 const std::vector<double>& sigma_curvature);

}  // namespace sweepfit
