// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "model/body.h"

namespace sweepfit {

// Writes quads with texture coordinates and normals as Wavefront OBJ, metres,
// nine digits; `texture` names the picture beside the file (empty:
// none), described in a file of the same name with the ending .mtl. Throws
// InputError when a file cannot be written.
void SaveObj(const BodyTopology& topology,
             const std::vector<Eigen::Vector3d>& vertices,
             const std::string& texture,
             const std::string& path);

}  // namespace sweepfit
