// SPDX-License-Identifier: Apache-2.0
#include "experiments/fit_to_folder.h"

#include <chrono>
#include <set>

#include "experiments/output_folder.h"
#include "experiments/result_folder.h"
#include "model/input_error.h"
#include "solver/pipeline.h"

namespace sweepfit {
namespace {

void CheckDistinct(const std::vector<std::string>& names, const char* kind) {
  std::set<std::string> seen;
  for (const std::string& name : names) {
    if (!seen.insert(name).second) {
      throw InputError(std::string(kind) + " '" + name + "' is named twice");
    }
  }
}

std::vector<std::string> ResolvePoses(const Capture& capture,
                                      const FitConfig& config) {
  if (!config.poses) {
    std::vector<std::string> all;
    for (const CapturePose& pose : capture.poses) all.push_back(pose.name);
    return all;
  }
  CheckDistinct(*config.poses, "pose");
  for (const std::string& name : *config.poses) capture.FindPose(name);
  return *config.poses;
}

std::vector<std::string> ResolveCameras(const Capture& capture,
                                        const FitConfig& config) {
  const bool all =
      config.cameras && *config.cameras == std::vector<std::string>{"all"};
  if (config.cameras && !all) {
    CheckDistinct(*config.cameras, "camera");
    for (const std::string& id : *config.cameras) capture.FindCamera(id);
    return *config.cameras;
  }
  std::vector<std::string> cameras;
  for (const CaptureCamera& camera : capture.cameras) {
    if (all || !capture.IsHoldout(camera.camera.id)) {
      cameras.push_back(camera.camera.id);
    }
  }
  return cameras;
}

void MakeAbsolute(std::string* path) {
  *path = std::filesystem::absolute(*path).lexically_normal().string();
}

void ResolvePaths(FitOptions* options) {
  if (options->landmarks.keypoints != "none") {
    MakeAbsolute(&options->landmarks.keypoints);
  }
  if (!options->body_template.IsGeneric()) {
    MakeAbsolute(&options->body_template.file);
  }
  // A file with names is told from a preset by these.
  if (options->body_template.names.find_first_of("./") != std::string::npos) {
    MakeAbsolute(&options->body_template.names);
  }
}

}  // namespace

FitConfig ResolveConfig(const Capture& capture, const FitConfig& config) {
  if (FindFitStage(config.options.until) < 0) {
    throw InputError("until: unknown stage '" + config.options.until + "'");
  }
  if (const auto error = config.options.Check()) {
    throw InputError("configuration: " + *error);
  }
  FitConfig resolved = config;
  resolved.poses = ResolvePoses(capture, config);
  resolved.cameras = ResolveCameras(capture, config);
  ResolvePaths(&resolved.options);
  if (resolved.cameras->size() < 2) {
    throw InputError(capture.folder.string() +
                     ": a fit needs at least two cameras");
  }
  return resolved;
}

nlohmann::ordered_json FitToFolder(const Capture& capture,
                                   const FitConfig& config,
                                   const std::filesystem::path& folder,
                                   Progress* progress) {
  const auto start = std::chrono::steady_clock::now();
  const FitConfig resolved = ResolveConfig(capture, config);
  OutputFolder output(folder, kReportFile);
  const FitResult result = Fit(
      capture, *resolved.poses, *resolved.cameras, resolved.options, progress);
  const double fit_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
          .count();
  nlohmann::ordered_json report = WriteResult(
      {capture, resolved, result, fit_seconds}, output.temporary(), progress);
  output.Commit();
  return report;
}

}  // namespace sweepfit
