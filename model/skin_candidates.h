// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "model/body.h"
#include "model/helper_joints.h"
#include "model/simplex.h"

namespace sweepfit {

// Joints and helpers.
inline constexpr int kMaxSkinJoints = 128;

// The joints that may move one vertex, most plausible first.
struct SkinCandidates {
  int count = 0;
  std::array<int, kMaxSimplexSize> joint{};
};

// A joint turns the bone that starts there, so bone k of a chain belongs to
// chain[k]; its neighbours in the chain and the parent of the chain matter
// where bones meet and where twist is spread. Helpers matter near their
// section, those that blend sweeps to vertices that do.
SkinCandidates FindSkinCandidates(const Body& body,
                                  const std::vector<HelperJoint>& helpers,
                                  int vertex);

}  // namespace sweepfit
