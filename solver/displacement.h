// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "model/body.h"

namespace sweepfit {

// Adds moves of the vertices at rest, metres, to the body's displacements,
// which are kept in the frames of the sections.
void DisplaceAtRest(const std::vector<Eigen::Vector3d>& move, Body* body);

}  // namespace sweepfit
