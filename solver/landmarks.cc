// SPDX-License-Identifier: Apache-2.0
#include "solver/landmarks.h"

#include <algorithm>
#include <chrono>
#include <string_view>

#include "model/input_error.h"
#include "solver/landmark_body.h"
#include "solver/landmark_graph.h"

namespace sweepfit {
namespace {

// Points of the solid graph per body height.
constexpr double kGraphResolution = 140;
// Ends that stick out less than this share of the body height are none.
constexpr double kMinProminence = 0.2;

void Summarize(const LandmarkResult& result,
               const BodyTrace& body,
               Progress* progress,
               StageSummary* summary) {
  for (const std::string& warning : body.warnings) {
    if (progress != nullptr) progress->Warning("landmarks: " + warning);
  }
  if (summary == nullptr) return;
  summary->stage = "landmarks";
  summary->status = body.warnings.empty() ? "ok" : "weak";
  summary->warnings = body.warnings;
  auto& figures = summary->figures;
  figures["mode"] = "multiview";
  figures["facing_confidence"] = result.facing_confidence;
  figures["stature"] = result.stature;
  figures["stature_sigma"] = result.stature_sigma;
  figures["crotch_height"] = body.crotch_height;
  figures["unsafe_limbs"] = result.unsafe_limbs;
  auto& found = figures["landmarks"];
  found = nlohmann::ordered_json::object();
  for (const Landmark3& landmark : result.landmarks) {
    found[landmark.name] = {
        {"source", landmark.source},
        {"num_views", landmark.num_views},
        {"sigma_rms", std::sqrt(landmark.covariance.trace() / 3)}};
  }
}

}  // namespace

std::optional<std::string> LandmarkOptions::Check() const {
  if (mode != "multiview") {
    return "landmarks.mode: must be multiview, not '" + mode + "'";
  }
  return std::nullopt;
}

const Landmark3* LandmarkResult::Find(std::string_view name) const {
  for (const Landmark3& landmark : landmarks) {
    if (landmark.name == name) return &landmark;
  }
  return nullptr;
}

LandmarkResult FindLandmarks(const std::vector<View>& views,
                             const Volume& volume,
                             const LandmarkOptions& options,
                             Progress* progress,
                             StageSummary* summary) {
  const auto start = std::chrono::steady_clock::now();
  if (const auto error = options.Check()) throw InputError(*error);
  static_cast<void>(views);
  LandmarkResult result;
  result.floor_height = volume.BoxMin().y();
  const double height = volume.BoxMax().y() - volume.BoxMin().y();
  const SolidGraph graph(volume, height / kGraphResolution);
  if (graph.num_nodes() == 0) {
    throw FitError("landmarks: there is nothing inside the volume");
  }
  const std::vector<Extremum> extrema =
      FindExtrema(graph, height, kMinProminence * height, 6);
  const BodyEnds ends = NameExtrema(extrema, height, result.floor_height);
  BodyTrace body = TraceBody(volume, ends, height, result.floor_height);
  result.landmarks = std::move(body.landmarks);
  std::sort(result.landmarks.begin(),
            result.landmarks.end(),
            [](const auto& a, const auto& b) { return a.joint < b.joint; });
  result.facing_in_world = body.facing_in_world;
  result.facing_confidence = body.facing_confidence;
  result.unsafe_limbs = body.unsafe_limbs;
  const Landmark3* crown = result.Find("head_end");
  result.stature = crown != nullptr
                       ? crown->point_in_world.y() - result.floor_height
                       : height;
  result.stature_sigma = crown != nullptr ? 0.02 : 0.1;
  Summarize(result, body, progress, summary);
  if (summary != nullptr) {
    summary->seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
            .count();
  }
  return result;
}

}  // namespace sweepfit
