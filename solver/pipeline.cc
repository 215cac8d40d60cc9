// SPDX-License-Identifier: Apache-2.0
#include "solver/pipeline.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <functional>

#include "model/input_error.h"
#include "model/template.h"

namespace sweepfit {
namespace {

// Skin weights are fitted over this many sampled poses.
constexpr int kSkinPoses = 40;
constexpr unsigned kSkinSeed = 1;

// Runs one stage, timed, and keeps its summary whatever happens in it.
void RunStage(const std::string& stage,
              const std::string& pose,
              const std::function<void(StageSummary*)>& run,
              Progress* progress,
              FitResult* result) {
  StageSummary summary;
  summary.stage = pose.empty() ? stage : stage + " " + pose;
  if (progress != nullptr) progress->Stage(stage, pose);
  const auto start = std::chrono::steady_clock::now();
  run(&summary);
  summary.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
          .count();
  result->stages.push_back(std::move(summary));
}

// The images' stature, from the pose that knows it best.
double BestStature(const std::vector<LandmarkResult>& landmarks) {
  const auto best =
      std::min_element(landmarks.begin(),
                       landmarks.end(),
                       [](const LandmarkResult& a, const LandmarkResult& b) {
                         return a.stature_sigma < b.stature_sigma;
                       });
  return std::clamp(best->stature, 0.6, 2.5);
}

void StorePoses(const JointResult& joints, FitResult* result) {
  for (size_t p = 0; p < result->poses.size(); ++p) {
    PoseResult& pose = result->poses[p];
    pose.joints = joints.poses[p];
    pose.pose = joints.poses[p].pose;
    pose.frames = joints.poses[p].frames;
    pose.vertices_in_world = PoseVertices(result->body, pose.pose);
  }
}

}  // namespace

int FindFitStage(std::string_view stage) {
  const auto it = std::find(kFitStages.begin(), kFitStages.end(), stage);
  return it == kFitStages.end() ? -1
                                : static_cast<int>(it - kFitStages.begin());
}

std::optional<std::string> FitOptions::Check() const {
  for (const auto& error : {segment.Check(),
                            volume.Check(),
                            landmarks.Check(),
                            joints.Check(),
                            global.Check(),
                            local.Check(),
                            refine.Check(),
                            texture.Check()}) {
    if (error) return error;
  }
  if (FindFitStage(until) < 0) {
    std::string names;
    for (const std::string_view stage : kFitStages) {
      names += (names.empty() ? "" : ", ") + std::string(stage);
    }
    return "until must be one of " + names + ", not '" + until + "'";
  }
  return std::nullopt;
}

FitResult Fit(const Capture& capture,
              const std::vector<std::string>& pose_names,
              const std::vector<std::string>& camera_ids,
              const FitOptions& options,
              Progress* progress) {
  if (const auto error = options.Check()) throw InputError(*error);
  if (pose_names.empty()) throw InputError("no pose to fit");
  if (camera_ids.size() < 2) {
    throw InputError("a fit needs at least two cameras");
  }
  const int until = FindFitStage(options.until);
  FitResult result;
  result.camera_ids = camera_ids;

  // What the cameras saw, pose by pose.
  std::vector<LandmarkResult> landmarks;
  for (const std::string& name : pose_names) {
    PoseResult& pose = result.poses.emplace_back();
    pose.name = name;
    RunStage(
        "segment",
        name,
        [&](StageSummary* summary) {
          pose.views = Segment(capture,
                               capture.FindPose(name),
                               camera_ids,
                               options.segment,
                               progress,
                               summary);
        },
        progress,
        &result);
    if (until < FindFitStage("volume")) continue;
    RunStage(
        "volume",
        name,
        [&](StageSummary* summary) {
          pose.volume =
              BuildVisualHull(pose.views, options.volume, progress, summary);
        },
        progress,
        &result);
    if (until < FindFitStage("landmarks")) continue;
    RunStage(
        "landmarks",
        name,
        [&](StageSummary* summary) {
          pose.landmarks = FindLandmarks(
              pose.views, *pose.volume, options.landmarks, progress, summary);
        },
        progress,
        &result);
    landmarks.push_back(pose.landmarks);
  }
  if (until < FindFitStage("joints")) return result;

  // One body for all poses.
  TemplateOptions template_options;
  template_options.stature = BestStature(landmarks);
  result.body = BuildTemplate(template_options);
  JointResult joints;
  RunStage(
      "joints",
      "",
      [&](StageSummary* summary) {
        joints = EstimateJoints(landmarks,
                                result.body.skeleton,
                                template_options.stature,
                                options.joints,
                                summary);
      },
      progress,
      &result);
  SetBoneLengths(joints.skeleton.length, &result.body);
  StorePoses(joints, &result);
  if (until < FindFitStage("global")) return result;

  std::vector<std::vector<ObservedContour>> contours;
  for (const PoseResult& pose : result.poses) {
    auto& of_pose = contours.emplace_back();
    for (const View& view : pose.views) {
      constexpr double kSpacing = 6;  // pixels
      of_pose.push_back(ObserveContour(view, kSpacing));
    }
  }
  std::vector<PoseEvidence> evidence;
  for (size_t p = 0; p < result.poses.size(); ++p) {
    const PoseResult& pose = result.poses[p];
    evidence.push_back(
        {&pose.views, &contours[p], &*pose.volume, &pose.landmarks});
  }
  RunStage(
      "global",
      "",
      [&](StageSummary* summary) {
        FitGlobal(evidence,
                  options.global,
                  options.joints,
                  &result.body,
                  &joints,
                  summary);
      },
      progress,
      &result);
  if (until >= FindFitStage("local")) {
    RunStage(
        "local",
        "",
        [&](StageSummary* summary) {
          FitLocal(evidence,
                   options.local,
                   options.joints,
                   &result.body,
                   &joints,
                   summary);
          for (const std::string& warning : summary->warnings) {
            if (progress != nullptr) progress->Warning("local: " + warning);
          }
        },
        progress,
        &result);
  }
  if (until >= FindFitStage("refine")) {
    RunStage(
        "refine",
        "",
        [&](StageSummary* summary) {
          RefineSurface(
              evidence, options.refine, joints, &result.body, summary);
        },
        progress,
        &result);
  }
  result.body.stature = joints.stature;
  result.body.sex = joints.sex;
  StorePoses(joints, &result);
  if (until < FindFitStage("texture")) return result;

  RunStage(
      "texture",
      "",
      [&](StageSummary* summary) {
        std::vector<std::vector<Eigen::Vector3d>> vertices;
        std::vector<std::vector<View>> views;
        for (const PoseResult& pose : result.poses) {
          vertices.push_back(pose.vertices_in_world);
          views.push_back(pose.views);
        }
        result.texture = SolveTexture(
            result.body, vertices, views, options.texture, progress, summary);
      },
      progress,
      &result);
  if (until < FindFitStage("export")) return result;
  RunStage(
      "skin",
      "",
      [&](StageSummary* summary) {
        result.skin = FitSkinWeights(result.body, kSkinPoses, kSkinSeed);
        summary->figures["rms_mm"] = 1000 * result.skin->rms;
        summary->figures["max_mm"] = 1000 * result.skin->max;
        summary->status = "ok";
      },
      progress,
      &result);
  return result;
}

}  // namespace sweepfit
