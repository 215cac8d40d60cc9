// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "capture/capture.h"
#include "experiments/synthetic.h"
#include "model/progress.h"

namespace sweepfit {

// Makes a synthetic capture in a folder that appears whole or not at all and
// says in synthetic.json how it was made. InputError when the folder exists and
// is no earlier synthetic capture, and on options out of range.
Capture MakeSyntheticCapture(const std::filesystem::path& folder,
                             const SyntheticOptions& options,
                             Progress* progress);

}  // namespace sweepfit
