// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "model/mesh.h"

namespace sweepfit {

// Pairs of triangles without a common vertex whose insides cut each other:
// an edge of one passes through the other. Triangles that only touch, or lie in
// one plane, do not count. Ascending.
std::vector<std::pair<int, int>> SelfIntersections(const TriangleMesh& mesh);

}  // namespace sweepfit
