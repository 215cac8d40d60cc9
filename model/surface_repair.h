// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "model/glb_surface.h"

namespace sweepfit {

// Makes one closed surface of what a file holds. Models of people have eyes,
// teeth, lashes and hair as pieces of their own, holes in sockets and mouths,
// sheets that touch in one vertex, and faces turned the wrong way:
// - vertices at which several sheets touch are split, double faces dropped;
// - of the pieces the tallest is kept (of equals that with the largest area),
//   if it reaches over nearly the whole height of all;
// - its faces are turned alike, to the outside;
// - holes up to 15 % of the height around are filled by a fan.
// Vertices that are left out go; `vertices` (+Y up, any unit) and the surface's
// two postures keep the same order. What was done is added to `notes`.
//
// Returns what cannot be mended, in words for a person, or nothing.
std::string RepairSurface(SkinnedSurface* surface,
                          std::vector<Eigen::Vector3d>* vertices,
                          std::vector<std::string>* notes);

}  // namespace sweepfit
