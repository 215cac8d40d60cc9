// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "solver/carried_surface.h"
#include "solver/fit_body.h"

namespace sweepfit {

// How closely the outlines are to be followed in one solve.
struct OutlineFit {
  double sigma;         // metres
  double max_distance;  // pixels between contour and rim
  int max_iterations;
  int stride;  // every n-th outline point counts, n times as much
};

// One solve of poses, lengths and girths of a person with all residual
// families: finds the rims of the body as it stands, assembles the problem and
// solves it. `photo`: per pose where the photographs see vertices of the body;
// may be empty. Unlike outlines they tell the depth of a limb in front of the
// trunk, which few cameras see beside it. `basis` null: girths stay. Updates
// body (lengths, girths), joints and girth; the joints' covariances stay. False
// when no usable solution was found. `report` may be null; filling it costs.
bool SolvePerson(const std::vector<PoseEvidence>& evidence,
                 const OutlineFit& outline,
                 const std::vector<PictureMatches>& pictures,
                 const JointOptions& options,
                 const GirthBasis* basis,
                 std::vector<double>* girth,
                 Body* body,
                 JointResult* joints,
                 nlohmann::ordered_json* report);

}  // namespace sweepfit
