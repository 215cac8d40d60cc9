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
  // How the joints are named: a preset of export_names.h.
  std::string names = "sweepfit";
  // Bake correctives into every clip, so that it shows what the sweeps do.
  // Without them bent joints differ by millimetres. Other clips, and programs
  // that know no morph targets, go without.
  bool correctives = true;
};

// How one clip of a file follows the sweeps, metres.
struct ClipReport {
  std::string name;
  int num_targets = 0;
  double rms_without = 0, max_without = 0;  // skinning alone
  double rms = 0, max = 0;                  // as written
};

// Writes a binary glTF 2.0 file: one skinned mesh (vertices split along UV
// seams, joints and weights identical on both sides), 21 named joints and the
// helpers of the weights, named <joint>_swing and so on, the rest pose as bind
// pose, and the clips with the helpers' motion and morph weights baked in.
// Metres, +Y up, front +Z. Throws InputError when the file cannot be written
// or the options name no preset. One report per clip; empty without
// correctives.
std::vector<ClipReport> SaveGlb(const Body& body,
                                const SkinWeights& weights,
                                const std::vector<Clip>& clips,
                                const GltfOptions& options,
                                const std::string& path);

}  // namespace sweepfit
