// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include "model/skeleton.h"

namespace sweepfit {

// The presets by which other programs know a skeleton's joints, for files we
// write: "sweepfit" (our own names), "mixamo", "unity" (humanoid), "unreal"
// (mannequin), "vrm". Our joint `neck` carries the shoulders as well as the
// head, so it takes the name of the upper chest; joints that a preset does not
// know keep a name in its style.
const std::vector<std::string>& ExportNamePresets();

// Names of the 21 joints. Throws InputError that lists the presets when there
// is none of this name.
std::array<std::string, kNumJoints> ExportNames(const std::string& preset);

}  // namespace sweepfit
