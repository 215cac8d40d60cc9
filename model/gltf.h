// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "model/body.h"
#include "model/lbs.h"

namespace sweepfit {

// A clip: one posture per key time; times ascend strictly, in seconds.
struct Clip {
  std::string name;
  std::vector<double> time;
  std::vector<Pose> pose;
};

struct GltfOptions {
  std::string mesh_name = "body";
  // An encoded PNG; empty: a plain grey material.
  std::vector<std::uint8_t> texture_png;
};

// Writes a binary glTF 2.0 file: one skinned mesh (vertices split along UV
// seams, joints and weights identical on both sides), 21 named joints, the
// rest pose as bind pose, and the clips. Metres, +Y up, front +Z. Throws
// InputError when the file cannot be written.
void SaveGlb(const Body& body,
             const SkinWeights& weights,
             const std::vector<Clip>& clips,
             const GltfOptions& options,
             const std::string& path);

}  // namespace sweepfit
