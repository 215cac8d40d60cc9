// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "capture/capture.h"
#include "model/progress.h"
#include "solver/config.h"
#include "solver/pipeline.h"

namespace sweepfit {

// The file that tells a result folder from any other.
inline constexpr char kReportFile[] = "report.json";

// What a result folder is written from.
struct ResultInput {
  const Capture& capture;
  const FitConfig& config;  // as resolved: with poses and cameras
  const FitResult& result;
  double fit_seconds = 0;
};

// Cameras of the fit that the capture holds out: their holdout scores are void.
std::vector<std::string> HoldoutCamerasUsed(
    const Capture& capture, const std::vector<std::string>& camera_ids);

// Writes every file of a result into `folder`, which exists (README.md lists
// them): what the last stage that ran has made. InputError when a file cannot
// be written. Bytes depend on the input only, apart from the object "times" of
// report.json and what report.html shows of it. Returns what report.json says.
nlohmann::ordered_json WriteResult(const ResultInput& input,
                                   const std::filesystem::path& folder,
                                   Progress* progress);

// Pieces of the above, for tests and other writers.
nlohmann::ordered_json JointsToJson(const std::vector<PoseResult>& poses);
nlohmann::ordered_json LandmarksToJson(const std::vector<PoseResult>& poses);

// The mesh of a body in one posture, quads split.
TriangleMesh PosedMesh(const Body& body,
                       const std::vector<Eigen::Vector3d>& vertices_in_world);

}  // namespace sweepfit
