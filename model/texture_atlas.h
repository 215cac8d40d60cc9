// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "model/mesh.h"

namespace sweepfit {

// Texture coordinates of three corners per triangle, v up.
using CornerCoordinates = std::vector<std::array<Eigen::Vector2f, 3>>;

// Of the texels of [0,1]^2 that triangles cover, the share covered by more than
// one (counted once per further triangle). Texels on shared edges count for one
// triangle.
double OverlapShare(const CornerCoordinates& uv);

// An atlas of its own for any surface: triangles are sorted by the part that
// they belong to (`group`, per triangle) and the axis that their smoothed
// normals are nearest to; every connected chart is projected along its axis,
// turned upright, and packed on shelves in one scale, with gutters of 6/2048.
CornerCoordinates BoxAtlas(const TriangleMesh& mesh,
                           const std::vector<int>& group);

// Makes texture coordinates usable for one picture of the whole surface: they
// must lie in [0,1]^2 and overlap nowhere. Those that do stay as they are.
// Where every material has a square of its own, the squares are put side by
// side. Else (none, repeated or mirrored textures) a box atlas is made. Returns
// what was done, empty if nothing.
std::string FitTextureAtlas(const TriangleMesh& mesh,
                            const std::vector<int>& material,
                            const std::vector<int>& group,
                            CornerCoordinates* uv);

}  // namespace sweepfit
