// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "model/sweep.h"
#include "model/template_solid.h"

namespace sweepfit {

// Indices of the template's sweeps.
enum TemplateSweep : int {
  kTrunkSweep,
  kLArmSweep,
  kRArmSweep,
  kLLegSweep,
  kRLegSweep,
  kLFootSweep,
  kRFootSweep,
  kNumTemplateSweeps,
};

// The seven sweeps whose sections are those of the solid's parts, each part by
// itself. `skeleton` is the one at rest, the solid stands on the floor with
// its root joint at solid.joints()[kRoot]. Right sweeps mirror left ones:
// theta -> -theta.
std::vector<Sweep> TemplateSweeps(const TemplateSolid& solid,
                                  const Skeleton& skeleton);

}  // namespace sweepfit
