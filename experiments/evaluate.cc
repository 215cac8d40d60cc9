// SPDX-License-Identifier: Apache-2.0
#include "experiments/evaluate.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <functional>
#include <opencv2/imgcodecs.hpp>

#include "capture/render.h"
#include "capture/silhouette.h"
#include "experiments/result_folder.h"
#include "model/input_error.h"
#include "solver/config.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Json LoadJson(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path.string() + ": cannot read the file");
  try {
    return Json::parse(file);
  } catch (const Json::exception&) {
    throw InputError(path.string() + ": malformed JSON");
  }
}

JointPositions ReadJoints(const Json& joints, const fs::path& path) {
  JointPositions positions;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    const std::string name(kJointNames[joint]);
    try {
      for (int axis = 0; axis < 3; ++axis) {
        positions[joint][axis] = joints.at(name).at(axis).get<double>();
      }
    } catch (const Json::exception&) {
      throw InputError(path.string() + ": joint '" + name +
                       "' is missing or has no three coordinates");
    }
  }
  return positions;
}

JointPositions FittedJoints(const fs::path& folder, const std::string& pose) {
  const fs::path path = folder / "joints.json";
  const Json json = LoadJson(path);
  if (!json.contains("poses") || !json["poses"].contains(pose)) {
    throw InputError(path.string() + ": no pose '" + pose + "'");
  }
  return ReadJoints(json["poses"][pose], path);
}

cv::Mat1f LoadResultMask(const fs::path& path, const Camera& camera) {
  const cv::Mat1b mask = cv::imread(path.string(), cv::IMREAD_GRAYSCALE);
  if (mask.empty()) throw InputError(path.string() + ": cannot read the mask");
  if (mask.cols != camera.width || mask.rows != camera.height) {
    throw InputError(path.string() + ": size differs from camera " + camera.id);
  }
  cv::Mat1f coverage;
  mask.convertTo(coverage, CV_32F, 1.0 / 255);
  return coverage;
}

fs::path TruthFolder(const Capture& capture, const std::string& pose_name) {
  return capture.folder / "truth" / pose_name;
}

// The silhouette of one camera to compare with and where it comes from; empty
// when there is none.
using Reference = std::function<cv::Mat1f(const Camera&, CameraScore*)>;

cv::Mat1f TruthMask(const Capture& capture,
                    const std::string& pose_name,
                    const Camera& camera,
                    CameraScore* score) {
  const fs::path mask =
      fs::path("truth") / pose_name / "masks" / (camera.id + ".png");
  if (!fs::exists(capture.folder / mask)) return {};
  score->reference = "truth";
  return LoadMask(capture, mask.string(), camera);
}

std::vector<CameraScore> ScoreSilhouettes(
    const Capture& capture,
    const TriangleMesh& mesh,
    const std::vector<std::string>& fit_cameras,
    const Reference& reference) {
  std::vector<CameraScore> scores;
  std::vector<cv::Mat1f> masks;
  for (const CaptureCamera& camera : capture.cameras) {
    CameraScore score;
    score.camera_id = camera.camera.id;
    const bool in_fit =
        std::find(fit_cameras.begin(), fit_cameras.end(), score.camera_id) !=
        fit_cameras.end();
    score.group = in_fit                               ? "fit"
                  : capture.IsHoldout(score.camera_id) ? "holdout"
                                                       : "unused";
    const cv::Mat1f mask = reference(camera.camera, &score);
    if (mask.empty()) continue;
    masks.push_back(mask);
    scores.push_back(score);
  }
  tbb::parallel_for(size_t{0}, scores.size(), [&](size_t i) {
    const Camera& camera = capture.FindCamera(scores[i].camera_id).camera;
    scores[i].error = CompareMasks(RenderCoverage(camera, mesh), masks[i]);
  });
  return scores;
}

// A mesh with a surface to measure on.
TriangleMesh LoadSurface(const fs::path& path) {
  TriangleMesh mesh = LoadPly(path.string());
  if (!(SurfaceArea(mesh) > 0)) {
    throw InputError(path.string() + ": has no faces of any area");
  }
  return mesh;
}

std::optional<JointPositions> FindTruthJoints(const fs::path& truth) {
  const fs::path path = truth / "joints.json";
  if (!fs::exists(path)) return std::nullopt;
  return LoadTruthJoints(path);
}

// Fills what is known of joints and surface; false when nothing is.
bool ScoreShape(const fs::path& truth,
                const std::optional<JointPositions>& truth_joints,
                const FittedPose& fitted,
                const EvaluateOptions& options,
                PoseScore* score) {
  bool any = false;
  if (fitted.joints && truth_joints) {
    score->joints = CompareJoints(*fitted.joints, *truth_joints);
    any = true;
  }
  if (fitted.mesh && fs::exists(truth / "surface.ply")) {
    const TriangleMesh surface = LoadSurface(truth / "surface.ply");
    score->fit_to_truth = CompareSurfaces(
        *fitted.mesh, surface, options.surface_samples, options.seed);
    score->truth_to_fit = CompareSurfaces(
        surface, *fitted.mesh, options.surface_samples, options.seed);
    any = true;
  }
  return any;
}

// What the result says of its own fit.
struct FitRecord {
  std::vector<std::string> cameras;
  FitConfig config;
};

FitRecord ReadFitRecord(const fs::path& folder) {
  const fs::path report = folder / kReportFile;
  if (!fs::exists(report)) {
    throw InputError(folder.string() + ": is no result folder: no " +
                     kReportFile);
  }
  FitRecord record;
  const Json json = LoadJson(report);
  try {
    record.cameras = json.at("cameras").get<std::vector<std::string>>();
  } catch (const Json::exception&) {
    throw InputError(report.string() + ": 'cameras' must be a list of names");
  }
  if (fs::exists(folder / "fit.yaml")) {
    LoadFitConfig((folder / "fit.yaml").string(), &record.config);
  }
  return record;
}

std::string Format(const char* format, auto... values) {
  char text[256];
  std::snprintf(text, sizeof(text), format, values...);
  return text;
}

Json ErrorToJson(const JointError& error) {
  Json per_joint = Json::object(), offset = Json::object();
  for (int joint = 0; joint < kNumJoints; ++joint) {
    const std::string name(kJointNames[joint]);
    const Eigen::Vector3d& v = error.offset_in_body[joint];
    per_joint[name] = error.per_joint[joint];
    offset[name] = {v.x(), v.y(), v.z()};
  }
  return {{"mpjpe", error.mpjpe},
          {"limb_mpjpe", error.limb_mpjpe},
          {"pa_mpjpe", error.pa_mpjpe},
          {"bone_length_mae", error.bone_length_mae},
          {"per_joint", per_joint},
          {"offset_in_body", offset}};
}

Json ErrorToJson(const SurfaceError& error) {
  return {{"mean", error.mean},
          {"median", error.median},
          {"p95", error.p95},
          {"max", error.max},
          {"signed_mean", error.signed_mean}};
}

std::string SurfaceLine(const char* name, const SurfaceError& error) {
  return Format(
      "  %-16s mean %.1f  median %.1f  p95 %.1f  max %.1f  signed %+.1f mm\n",
      name,
      1000 * error.mean,
      1000 * error.median,
      1000 * error.p95,
      1000 * error.max,
      1000 * error.signed_mean);
}

std::string GroupLine(std::string_view group,
                      const std::optional<SilhouetteError>& error) {
  if (!error) return "";
  const std::string name = std::string(group) + " cameras";
  return Format("  %-16s IoU %.4f  boundary %.2f px  p95 %.2f px\n",
                name.c_str(),
                error->iou,
                error->boundary_mean,
                error->boundary_p95);
}

}  // namespace

std::optional<SilhouetteError> MeanSilhouetteError(const PoseScore& score,
                                                   std::string_view group) {
  SilhouetteError mean;
  int count = 0;
  for (const CameraScore& camera : score.cameras) {
    if (camera.group != group) continue;
    mean.iou += camera.error.iou;
    mean.boundary_mean += camera.error.boundary_mean;
    mean.boundary_p95 += camera.error.boundary_p95;
    mean.signed_mean += camera.error.signed_mean;
    ++count;
  }
  if (count == 0) return std::nullopt;
  mean.iou /= count;
  mean.boundary_mean /= count;
  mean.boundary_p95 /= count;
  mean.signed_mean /= count;
  return mean;
}

PoseScore ScoreAgainstTruth(const Capture& capture,
                            const std::string& pose_name,
                            const FittedPose& fitted,
                            const std::vector<std::string>& fit_cameras,
                            const EvaluateOptions& options) {
  PoseScore score;
  score.pose = pose_name;
  if (fitted.mesh) {
    score.cameras = ScoreSilhouettes(
        capture,
        *fitted.mesh,
        fit_cameras,
        [&](const Camera& camera, CameraScore* of_camera) {
          return TruthMask(capture, pose_name, camera, of_camera);
        });
  }
  const fs::path truth = TruthFolder(capture, pose_name);
  ScoreShape(truth, FindTruthJoints(truth), fitted, options, &score);
  return score;
}

Evaluation EvaluateResult(const Capture& capture,
                          const fs::path& result_folder,
                          const EvaluateOptions& options,
                          Progress* progress) {
  const FitRecord record = ReadFitRecord(result_folder);
  Evaluation evaluation;
  evaluation.capture =
      fs::weakly_canonical(fs::absolute(capture.folder)).filename().string();
  evaluation.holdout_void =
      !HoldoutCamerasUsed(capture, record.cameras).empty();
  bool has_truth = false;
  for (const CapturePose& pose : capture.poses) {
    if (!fs::exists(result_folder / ("mesh_" + pose.name + ".ply"))) continue;
    if (progress != nullptr) progress->Stage("evaluate", pose.name);
    FittedPose fitted;
    fitted.mesh = LoadSurface(result_folder / ("mesh_" + pose.name + ".ply"));
    // Truth first, then what the fit itself saw, then the picture.
    const Reference reference = [&](const Camera& camera, CameraScore* score) {
      cv::Mat1f mask = TruthMask(capture, pose.name, camera, score);
      if (!mask.empty()) return mask;
      const fs::path own =
          result_folder / "masks" / (pose.name + "_" + camera.id + ".png");
      if (fs::exists(own)) {
        score->reference = "result";
        return LoadResultMask(own, camera);
      }
      if (!pose.images.contains(camera.id)) return mask;
      score->reference = "segmented";
      StageSummary summary;
      const std::optional<View> view = SegmentOne(capture,
                                                  pose,
                                                  camera.id,
                                                  record.config.options.segment,
                                                  progress,
                                                  &summary);
      return view ? view->coverage : mask;
    };
    PoseScore score;
    score.pose = pose.name;
    score.cameras =
        ScoreSilhouettes(capture, *fitted.mesh, record.cameras, reference);
    if (options.truth) {
      const fs::path truth = TruthFolder(capture, pose.name);
      const std::optional<JointPositions> truth_joints = FindTruthJoints(truth);
      if (truth_joints) {
        fitted.joints = FittedJoints(result_folder, pose.name);
        const fs::path landmarks = result_folder / "landmarks.json";
        if (fs::exists(landmarks)) {
          score.landmarks = ScoreLandmarks(landmarks, pose.name, *truth_joints);
        }
      }
      has_truth |= ScoreShape(truth, truth_joints, fitted, options, &score) ||
                   fs::exists(truth / "masks");
    }
    evaluation.poses.push_back(score);
  }
  if (evaluation.poses.empty()) {
    throw InputError(result_folder.string() +
                     ": no mesh_<pose>.ply of a pose of this capture");
  }
  if (options.truth && !has_truth) {
    throw InputError((capture.folder / "truth").string() +
                     ": no ground truth for the poses of this result");
  }
  return evaluation;
}

namespace {

// One line for all and one for each.
std::string LandmarkLines(const std::vector<LandmarkScore>& landmarks) {
  std::vector<double> errors;
  double chi2 = 0;
  std::string each;
  for (const LandmarkScore& landmark : landmarks) {
    const double error = landmark.error_in_world.norm();
    errors.push_back(error);
    chi2 += landmark.chi2_per_dof;
    each += Format("    %-14s %5.1f mm  chi2/dof %.2f  (%s, %d views)\n",
                   landmark.name.c_str(),
                   1000 * error,
                   landmark.chi2_per_dof,
                   landmark.source.c_str(),
                   landmark.num_views);
  }
  std::sort(errors.begin(), errors.end());
  return Format(
             "  %-16s median %.1f  90 %% below %.1f mm  chi2/dof %.2f  "
             "(%zu landmarks)\n",
             "landmarks",
             1000 * errors[errors.size() / 2],
             1000 * errors[9 * (errors.size() - 1) / 10],
             chi2 / static_cast<double>(landmarks.size()),
             landmarks.size()) +
         each;
}

}  // namespace

std::string EvaluationTable(const Evaluation& evaluation) {
  std::string text = evaluation.capture + "\n";
  if (evaluation.holdout_void) {
    text += "  The fit has used holdout cameras: scores on them are void.\n";
  }
  for (const PoseScore& score : evaluation.poses) {
    text += "pose " + score.pose + "\n";
    if (score.joints) {
      text += Format(
          "  %-16s MPJPE %.1f  limbs %.1f  PA-MPJPE %.1f  bone lengths %.1f "
          "mm\n",
          "joints",
          1000 * score.joints->mpjpe,
          1000 * score.joints->limb_mpjpe,
          1000 * score.joints->pa_mpjpe,
          1000 * score.joints->bone_length_mae);
    }
    if (!score.landmarks.empty()) text += LandmarkLines(score.landmarks);
    if (score.fit_to_truth) {
      text += SurfaceLine("surface to truth", *score.fit_to_truth);
      text += SurfaceLine("truth to surface", *score.truth_to_fit);
    }
    for (const std::string_view group : kCameraGroups) {
      text += GroupLine(group, MeanSilhouetteError(score, group));
    }
    for (const CameraScore& camera : score.cameras) {
      text += Format("    %-14s %-7s IoU %.4f  boundary %.2f px  (%s mask)\n",
                     camera.camera_id.c_str(),
                     camera.group.c_str(),
                     camera.error.iou,
                     camera.error.boundary_mean,
                     camera.reference.c_str());
    }
  }
  return text;
}

Json PoseScoreToJson(const PoseScore& score) {
  Json pose = Json::object();
  if (score.joints) pose["joints"] = ErrorToJson(*score.joints);
  if (score.fit_to_truth) {
    pose["surface"] = {{"fit_to_truth", ErrorToJson(*score.fit_to_truth)},
                       {"truth_to_fit", ErrorToJson(*score.truth_to_fit)}};
  }
  for (const LandmarkScore& landmark : score.landmarks) {
    const Eigen::Vector3d& e = landmark.error_in_world;
    pose["landmarks"].push_back({{"name", landmark.name},
                                 {"source", landmark.source},
                                 {"views", landmark.num_views},
                                 {"error", e.norm()},
                                 {"error_xyz", {e.x(), e.y(), e.z()}},
                                 {"chi2_per_dof", landmark.chi2_per_dof}});
  }
  for (const std::string_view group : kCameraGroups) {
    const auto mean = MeanSilhouetteError(score, group);
    if (mean) pose["silhouette"][std::string(group)] = ErrorToJson(*mean);
  }
  for (const CameraScore& camera : score.cameras) {
    Json& entry = pose["cameras"][camera.camera_id];
    entry = ErrorToJson(camera.error);
    entry["group"] = camera.group;
    entry["reference"] = camera.reference;
  }
  return pose;
}

Json EvaluationToJson(const Evaluation& evaluation) {
  Json poses = Json::object();
  for (const PoseScore& score : evaluation.poses) {
    poses[score.pose] = PoseScoreToJson(score);
  }
  return {{"capture", evaluation.capture},
          {"holdout_scores_void", evaluation.holdout_void},
          {"poses", poses}};
}

}  // namespace sweepfit
