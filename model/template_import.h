// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "model/body.h"
#include "model/progress.h"

namespace sweepfit {

// Makes a template of a rigged person in a .glb: finds the 21 joints by their
// names (`names` as in joint_names.h; further bones count for the joint of ours
// that they hang on), measures the sections of our sweeps on the surface, and
// binds every vertex by its skin weights. Triangles are kept (as quads with a
// corner twice), and texture coordinates where they serve (texture_atlas.h).
//
// Taken is the posture of the nodes, or that in which the skin was bound where
// elbows, knees and trunk are straighter there. Arms or legs that are held
// otherwise than our template's are brought there by the sweeps. The person may
// stand along any axis and face anywhere, in any unit of length. Pieces such as
// eyes are left out and small holes filled (surface_repair.h). What was done is
// told to `progress` as warnings, one sentence each, with the file's name.
//
// Throws InputError when joints are missing or in disorder, when the surface
// cannot be made a single closed one, when the person does not stand upright,
// and when the feet point backwards (left and right exchanged).
Body ImportTemplate(const std::string& path,
                    const std::string& names = "auto",
                    Progress* progress = nullptr);

}  // namespace sweepfit
