// SPDX-License-Identifier: Apache-2.0
#include "apps/summary.h"

#include <cstdio>

namespace sweepfit {
namespace {

using Json = nlohmann::ordered_json;

std::string PoseLine(const std::string& pose, const Json& figures) {
  std::string line = "pose " + pose + ":";
  if (figures.contains("silhouette")) {
    char text[96];
    std::snprintf(text,
                  sizeof(text),
                  " silhouette IoU %.3f, boundary %.1f px (fit cameras)",
                  figures["silhouette"]["mean_iou"].get<double>(),
                  figures["silhouette"]["mean_boundary"].get<double>());
    line += text;
  } else {
    line += " done until the stage asked for";
  }
  if (figures.contains("unsafe_limbs") && !figures["unsafe_limbs"].empty()) {
    line += "; not safe:";
    for (const Json& limb : figures["unsafe_limbs"]) {
      line += " " + limb.get<std::string>();
    }
  }
  return line + "\n";
}

// The stages that say so of themselves; no line when none does.
std::string StageLine(const Json& stages, const std::string& status) {
  std::string names;
  for (const Json& stage : stages) {
    if (stage["status"] != status) continue;
    names += (names.empty() ? "" : ", ") + stage["stage"].get<std::string>();
  }
  return names.empty() ? "" : status + ": " + names + "\n";
}

}  // namespace

std::string FitSummary(const Json& report,
                       const std::filesystem::path& folder) {
  std::string text;
  for (const auto& [pose, figures] : report["poses"].items()) {
    text += PoseLine(pose, figures);
  }
  text += StageLine(report["stages"], "weak");
  text += StageLine(report["stages"], "failed");
  if (report["holdout_scores_void"].get<bool>()) {
    text += "holdout cameras were used: their scores are void\n";
  }
  text += "report: " + (folder / "report.html").string() + "\n";
  if (report.contains("model")) {
    text += "model:  " + (folder / "model.glb").string() + "\n";
  }
  return text;
}

}  // namespace sweepfit
