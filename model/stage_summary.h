// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace sweepfit {

// What a stage says about itself; one JSON object of report.json.
struct StageSummary {
  std::string stage;
  // "not run" until the stage says otherwise; then "ok", "weak" (the result is
  // usable, warnings say where it is not to be trusted) or "failed" (there is
  // no result; the fit ends).
  std::string status = "not run";
  std::vector<std::string> warnings;
  // Stage-specific figures: iterations, cost per residual family at start and
  // end, effective information, termination, ... Everything but times, which
  // are kept apart because they differ from run to run.
  nlohmann::ordered_json figures = nlohmann::ordered_json::object();
  double seconds = -1;
};

}  // namespace sweepfit
