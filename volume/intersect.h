// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "model/mesh.h"
#include "volume/volume.h"

namespace sweepfit {

// The common part of a hull and of the inside of a closed mesh: whatever was
// done to the mesh, nothing lies beyond the hull. Its largest part.
Volume IntersectWithMesh(const Volume& hull, const TriangleMesh& mesh);

}  // namespace sweepfit
