// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "capture/capture.h"
#include "model/progress.h"
#include "solver/config.h"

namespace sweepfit {

// Fills in and checks what is left open: all poses; all cameras but those held
// out ("all" as the only camera: every one); paths become absolute, so that the
// configuration means the same from any folder. InputError names an unknown or
// repeated pose or camera, and options out of range.
FitConfig ResolveConfig(const Capture& capture, const FitConfig& config);

// Fits a capture and writes the result folder, which appears whole at the end
// or not at all. Returns the content of its report.json. Throws InputError (bad
// input, output not writable) and FitError (nobody could be fitted).
nlohmann::ordered_json FitToFolder(const Capture& capture,
                                   const FitConfig& config,
                                   const std::filesystem::path& folder,
                                   Progress* progress);

}  // namespace sweepfit
