// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace sweepfit {

// The few lines that a person reads after a fit: how well the mesh covers the
// silhouettes, what is not safe, which stages are weak or failed, and where the
// files are.
std::string FitSummary(const nlohmann::ordered_json& report,
                       const std::filesystem::path& folder);

}  // namespace sweepfit
