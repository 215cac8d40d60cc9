// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "model/template_solid.h"
#include "model/template_topology.h"

namespace sweepfit {

// To which sweeps (index, weight) each vertex of the whole mesh is bound, at
// most three, weights summing to 1 and smooth over the mesh:
//   w = smoothstep(1 - (d - d_min) / .04 H)
// by the distances d to the parts, then smoothed by the mesh's Laplacian.
// Vertices of one side are never bound to the limbs of the other; head and
// mid plane follow the trunk, hands the arm.
std::vector<std::vector<std::pair<int, double>>> TemplateWeights(
    const HalfComplex& half,
    const std::vector<Eigen::Vector3d>& half_vertices,
    const BodyTopology& topology,
    const TemplateSolid& solid);

}  // namespace sweepfit
