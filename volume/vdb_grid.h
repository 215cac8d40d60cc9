// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "model/mesh.h"
#include "volume/block_grid.h"

namespace sweepfit {

// An OpenVDB level set; only vdb_grid.cc knows what is in it.
struct VdbGrid;

// Leaves where the level set is near, inactive tiles inside.
std::shared_ptr<const VdbGrid> MakeVdbGrid(const BlockGrid& grid);

// The zero surface; quads split along their shorter diagonal.
TriangleMesh MeshVdbGrid(const VdbGrid& vdb);

// Writes the grid "surface". OpenVDB stamps every file with a random UUID;
// here it is derived from the content. InputError when it cannot be written.
void SaveVdbGrid(const VdbGrid& vdb, const std::string& path);

}  // namespace sweepfit
