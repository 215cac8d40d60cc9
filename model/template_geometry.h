// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "model/template_solid.h"
#include "model/template_topology.h"

namespace sweepfit {

// Places the vertices of the left half on the surface of the solid: rings by
// rays from their centres, junctions (arm pit, groin, webs, ankle) by
// relaxation on the surface. Vertices on the mid plane have x = 0 exactly.
std::vector<Eigen::Vector3d> PlaceHalf(const HalfComplex& half,
                                       const TemplateSolid& solid);

}  // namespace sweepfit
