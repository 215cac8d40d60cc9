// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "capture/capture.h"
#include "experiments/landmark_score.h"
#include "experiments/metrics.h"
#include "model/progress.h"

namespace sweepfit {

struct EvaluateOptions {
  // Compare joints and surface with the ground truth of the capture.
  bool truth = false;
  int surface_samples = 100000;
  unsigned seed = 1;
};

// The fit has seen a camera, the capture holds it out, or neither.
inline constexpr std::array<std::string_view, 3> kCameraGroups = {
    "fit", "holdout", "unused"};

// The fitted mesh against the silhouette of one camera.
struct CameraScore {
  std::string camera_id;
  std::string group;      // of kCameraGroups
  std::string reference;  // "truth", "result" or "segmented"
  SilhouetteError error;
};

struct PoseScore {
  std::string pose;
  std::vector<CameraScore> cameras;
  // With truth only:
  std::optional<JointError> joints;
  std::optional<SurfaceError> fit_to_truth;
  std::optional<SurfaceError> truth_to_fit;
  std::vector<LandmarkScore> landmarks;
};

struct Evaluation {
  std::string capture;
  bool holdout_void = false;  // the fit has seen holdout cameras
  std::vector<PoseScore> poses;
};

// A fitted pose in memory, world metres.
struct FittedPose {
  std::optional<JointPositions> joints;
  std::optional<TriangleMesh> mesh;
};

// Scores a pose against the truth folder of the capture, as far as it has
// something to compare with: joints, surface, and masks of all cameras.
PoseScore ScoreAgainstTruth(const Capture& capture,
                            const std::string& pose_name,
                            const FittedPose& fitted,
                            const std::vector<std::string>& fit_cameras,
                            const EvaluateOptions& options);

// Scores a result folder against its capture: mesh_<pose>.ply drawn into every
// camera and compared with truth/<pose>/masks/<camera>.png where there is one,
// else with the result's own masks/, else (cameras that the fit did not use)
// with the silhouette segmented from the picture as the result's fit.yaml says.
// A camera in which nobody can be found is left out with a warning.
// With options.truth also truth/<pose>/joints.json (joints, and landmarks.json
// where the result has one) and surface.ply (metres, +Y up). InputError when
// the folder is no result, has no mesh, or when truth is asked for and there is
// none.
Evaluation EvaluateResult(const Capture& capture,
                          const std::filesystem::path& result_folder,
                          const EvaluateOptions& options,
                          Progress* progress);

// Millimetres and pixels, as a table for people.
std::string EvaluationTable(const Evaluation& evaluation);
// Metres and pixels.
nlohmann::ordered_json EvaluationToJson(const Evaluation& evaluation);
nlohmann::ordered_json PoseScoreToJson(const PoseScore& score);

// Mean over the cameras of one group; none: nothing.
std::optional<SilhouetteError> MeanSilhouetteError(const PoseScore& score,
                                                   std::string_view group);

}  // namespace sweepfit
