// SPDX-License-Identifier: Apache-2.0
#include "solver/pipeline.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <functional>
#include <utility>

#include "capture/keypoints.h"
#include "model/export_names.h"
#include "model/input_error.h"
#include "model/template.h"
#include "model/template_import.h"
#include "solver/limb_retry.h"

namespace sweepfit {
namespace {

// Runs one stage, timed, and keeps its summary whatever happens in it.
void RunStage(const std::string& stage,
              const std::string& pose,
              const std::function<void(StageSummary*)>& run,
              Progress* progress,
              std::vector<StageSummary>* stages) {
  StageSummary summary;
  summary.stage = pose.empty() ? stage : stage + " " + pose;
  if (progress != nullptr) progress->Stage(stage, pose);
  const auto start = std::chrono::steady_clock::now();
  run(&summary);
  summary.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
          .count();
  stages->push_back(std::move(summary));
}

// Finds cameras that disagree with the others before anything is built on them,
// and by default repairs them: silhouettes that do not belong together carve
// the person away. Pose by pose: what is seen of a pose is shared by fits of
// different poses, and a camera may be pushed between two of them.
void CheckCoherence(const IncoherenceOptions& options,
                    Progress* progress,
                    Observation* seen,
                    StageSummary* summary) {
  summary->status = "ok";
  if (options.mode == "off") return;
  std::vector<std::vector<View>> views = {seen->views};
  const std::vector<Incoherence> found = FindIncoherence(views, options);
  const bool repair = options.mode == "repair";
  std::vector<bool> repaired;
  if (repair) repaired = RepairIncoherence(found, &views);
  auto& figures = summary->figures["found"] = nlohmann::ordered_json::array();
  for (size_t i = 0; i < found.size(); ++i) {
    const Incoherence& item = found[i];
    const std::string text = "pose " + seen->pose + ", " + item.Text() +
                             (repair ? item.RepairText(repaired[i]) : "");
    summary->warnings.push_back(text);
    if (progress != nullptr) progress->Warning(text);
    const Eigen::Vector3d& turn = item.camera.turn;
    figures.push_back({{"camera", item.camera.camera_id},
                       {"miss_px", item.camera.miss},
                       {"others_with_px", item.camera.others_with},
                       {"others_without_px", item.camera.others_without},
                       {"turn", {turn.x(), turn.y(), turn.z()}},
                       {"shift_px", item.camera.shift}});
  }
  if (!found.empty()) summary->status = "weak";
  seen->views = std::move(views.front());
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

// The body to start from, whatever its stature.
Body ReadTemplate(const TemplateSource& source, Progress* progress) {
  if (source.IsGeneric()) return BuildTemplate(TemplateOptions());
  return ImportTemplate(source.file, source.names, progress);
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

// What the pictures say of every pose, ready to be compared with a body. Empty
// where it is not asked for.
struct PreparedEvidence {
  std::vector<std::vector<ObservedContour>> contours;  // per pose and view
  std::vector<PhotoEvidence> photo;                    // per pose
  std::vector<std::vector<InnerContour>> inner;        // per pose and view
};

// `with_pictures`: more than outlines.
PreparedEvidence PrepareEvidence(const std::vector<PoseResult>& poses,
                                 const FitOptions& options,
                                 bool with_pictures) {
  PreparedEvidence prepared;
  const auto observe_contours = [&] {
    for (const PoseResult& pose : poses) {
      const std::vector<View>& views = pose.seen->views;
      auto& of_pose = prepared.contours.emplace_back(views.size());
      tbb::parallel_for(size_t{0}, views.size(), [&](size_t v) {
        constexpr double kSpacing = 6;  // pixels
        of_pose[v] = ObserveContour(views[v], kSpacing);
      });
    }
  };
  const auto prepare_photographs = [&] {
    if (!with_pictures || !options.photo.enabled) return;
    for (const PoseResult& pose : poses) {
      prepared.photo.emplace_back(
          pose.seen->views, *pose.seen->volume, options.photo);
    }
  };
  const auto prepare_inner_contours = [&] {
    if (!with_pictures || !options.inner_contours.enabled) return;
    for (const PoseResult& pose : poses) {
      auto& of_pose = prepared.inner.emplace_back();
      for (const View& view : pose.seen->views) {
        of_pose.emplace_back(view, options.inner_contours);
      }
    }
  };
  tbb::parallel_invoke(
      observe_contours, prepare_photographs, prepare_inner_contours);
  return prepared;
}

// Work beside other work, which is waited for also when that fails: a group that
// goes without would cancel loops halfway, and what follows them would run on
// what they left.
struct Building {
  ~Building() { group.wait(); }
  tbb::task_group group;
};

// FitObserved from a template that was read before, of any stature.
FitResult FitTemplate(
    const std::vector<std::shared_ptr<const Observation>>& observations,
    const std::vector<std::string>& camera_ids,
    Body body_template,
    const FitOptions& options,
    Progress* progress) {
  const int until = FindFitStage(options.until);
  FitResult result;
  result.camera_ids = camera_ids;
  std::vector<LandmarkResult> landmarks;
  for (const auto& seen : observations) {
    PoseResult& pose = result.poses.emplace_back();
    pose.name = seen->pose;
    pose.seen = seen;
    landmarks.push_back(seen->landmarks);
    result.stages.insert(
        result.stages.end(), seen->stages.begin(), seen->stages.end());
  }
  if (until < FindFitStage("joints")) return result;

  // One body for all poses.
  const auto run_stage = [&](const std::string& stage,
                             const std::function<void(StageSummary*)>& run) {
    RunStage(stage, "", run, progress, &result.stages);
    // Nothing may be built on a solution that is none.
    if (result.stages.back().status != "failed") return;
    std::string names;
    for (const PoseResult& pose : result.poses) {
      names += (names.empty() ? "" : ", ") + pose.name;
    }
    throw FitError(stage + ": no usable solution (pose " + names +
                   "): look at what it starts from (--until landmarks) and fit "
                   "single poses (--poses)");
  };
  const auto warn_of = [&](const std::string& stage,
                           const StageSummary& summary) {
    for (const std::string& warning : summary.warnings) {
      if (progress != nullptr) progress->Warning(stage + ": " + warning);
    }
  };
  const double stature = BestStature(landmarks);
  ScaleBody(stature / body_template.stature, &body_template);
  result.body = body_template;
  JointResult joints;
  run_stage("joints", [&](StageSummary* summary) {
    joints = EstimateJoints(
        landmarks, result.body.skeleton, stature, options.joints, summary);
  });
  SetBoneLengths(joints.skeleton.length, &result.body);
  StorePoses(joints, &result);
  if (until < FindFitStage("global")) return result;

  const PreparedEvidence prepared =
      PrepareEvidence(result.poses, options, until >= FindFitStage("local"));
  std::vector<PoseEvidence> evidence;
  for (size_t p = 0; p < result.poses.size(); ++p) {
    const PoseResult& pose = result.poses[p];
    evidence.push_back({&pose.seen->views,
                        &prepared.contours[p],
                        &*pose.seen->volume,
                        &landmarks[p],
                        prepared.photo.empty() ? nullptr : &prepared.photo[p],
                        prepared.inner.empty() ? nullptr : &prepared.inner[p],
                        options.outlines});
  }
  run_stage("global", [&](StageSummary* summary) {
    GlobalFit fit{result.body, joints, *summary};
    FitGlobal(evidence,
              options.global,
              options.joints,
              &fit.body,
              &fit.joints,
              &fit.summary);
    if (options.global.retry_limbs && fit.summary.status == "ok") {
      RetryLimbs(evidence,
                 options.global,
                 options.joints,
                 body_template,
                 stature,
                 joints,
                 &landmarks,
                 &fit);
    }
    result.body = std::move(fit.body);
    joints = std::move(fit.joints);
    *summary = std::move(fit.summary);
    warn_of("global", *summary);
  });
  const std::vector<Eigen::Vector3d> reference_rest = RestVertices(result.body);
  if (until >= FindFitStage("local")) {
    run_stage("local", [&](StageSummary* summary) {
      FitLocal(evidence,
               options.local,
               options.joints,
               &result.body,
               &joints,
               summary);
      warn_of("local", *summary);
    });
  }
  if (until >= FindFitStage("refine")) {
    run_stage("refine", [&](StageSummary* summary) {
      RefineSurface(evidence,
                    options.refine,
                    reference_rest,
                    joints,
                    &result.body,
                    summary);
    });
  }
  result.body.stature = joints.stature;
  result.body.sex = joints.sex;
  StorePoses(joints, &result);
  if (until < FindFitStage("texture")) return result;

  const auto solve_texture = [&] {
    run_stage("texture", [&](StageSummary* summary) {
      std::vector<std::vector<Eigen::Vector3d>> vertices;
      std::vector<std::vector<View>> views;
      for (const PoseResult& pose : result.poses) {
        vertices.push_back(pose.vertices_in_world);
        views.push_back(pose.seen->views);
      }
      result.texture = SolveTexture(
          result.body, vertices, views, options.texture, progress, summary);
    });
  };
  std::vector<StageSummary> skin_stages;
  const auto fit_skin = [&] {
    if (until < FindFitStage("export")) return;
    RunStage(
        "skin",
        "",
        [&](StageSummary* summary) {
          result.skin = FitSkinWeights(
              result.body, kSkinPoses, kSkinSeed, options.exported.helpers);
          summary->figures["rms_mm"] = 1000 * result.skin->rms;
          summary->figures["max_mm"] = 1000 * result.skin->max;
          summary->status = "ok";
        },
        nullptr,
        &skin_stages);
  };
  // Neither needs the other.
  tbb::parallel_invoke(solve_texture, fit_skin);
  result.stages.insert(
      result.stages.end(), skin_stages.begin(), skin_stages.end());
  return result;
}

}  // namespace

int FindFitStage(std::string_view stage) {
  const auto it = std::find(kFitStages.begin(), kFitStages.end(), stage);
  return it == kFitStages.end() ? -1
                                : static_cast<int>(it - kFitStages.begin());
}

std::optional<std::string> ExportOptions::Check() const {
  const std::vector<std::string>& known = ExportNamePresets();
  if (std::find(known.begin(), known.end(), names) == known.end()) {
    std::string list;
    for (const std::string& name : known) list += " " + name;
    return "export.names must be one of" + list;
  }
  return std::nullopt;
}

std::optional<std::string> FitOptions::Check() const {
  for (const auto& error : {segment.Check(),
                            coherence.Check(),
                            volume.Check(),
                            landmarks.Check(),
                            joints.Check(),
                            outlines.Check(),
                            global.Check(),
                            local.Check(),
                            photo.Check(),
                            inner_contours.Check(),
                            refine.Check(),
                            texture.Check(),
                            exported.Check()}) {
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

Observation Observe(const Capture& capture,
                    const std::string& pose_name,
                    const std::vector<std::string>& camera_ids,
                    const FitOptions& options,
                    Progress* progress) {
  const int until = FindFitStage(options.until);
  Observation seen;
  seen.pose = pose_name;
  // Bad keypoints are told before any work.
  std::vector<Keypoint2> keypoints;
  if (options.landmarks.keypoints != "none") {
    for (Keypoint2& keypoint :
         LoadKeypoints(options.landmarks.keypoints, capture)) {
      if (keypoint.pose == pose_name) keypoints.push_back(std::move(keypoint));
    }
  }
  RunStage(
      "segment",
      pose_name,
      [&](StageSummary* summary) {
        seen.views = Segment(capture,
                             capture.FindPose(pose_name),
                             camera_ids,
                             options.segment,
                             progress,
                             summary);
      },
      progress,
      &seen.stages);
  RunStage(
      "coherence",
      pose_name,
      [&](StageSummary* summary) {
        CheckCoherence(options.coherence, progress, &seen, summary);
      },
      progress,
      &seen.stages);
  if (until < FindFitStage("volume")) return seen;
  RunStage(
      "volume",
      pose_name,
      [&](StageSummary* summary) {
        seen.volume =
            BuildVolume(seen.views, options.volume, progress, summary);
      },
      progress,
      &seen.stages);
  if (until < FindFitStage("landmarks")) return seen;
  RunStage(
      "landmarks",
      pose_name,
      [&](StageSummary* summary) {
        seen.landmarks = FindLandmarks(seen.views,
                                       *seen.volume,
                                       keypoints,
                                       options.landmarks,
                                       progress,
                                       summary);
      },
      progress,
      &seen.stages);
  return seen;
}

FitResult FitObserved(
    const std::vector<std::shared_ptr<const Observation>>& observations,
    const std::vector<std::string>& camera_ids,
    const FitOptions& options,
    Progress* progress) {
  return FitTemplate(observations,
                     camera_ids,
                     ReadTemplate(options.body_template, nullptr),
                     options,
                     progress);
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
  // A file that does not serve is told before the pictures are looked at; the
  // generic body is built while they are.
  Body body_template;
  Building building;
  const auto read_template = [&] {
    body_template = ReadTemplate(options.body_template, progress);
  };
  if (options.body_template.IsGeneric()) {
    building.group.run(read_template);
  } else {
    read_template();
  }
  std::vector<std::shared_ptr<const Observation>> observations;
  for (const std::string& name : pose_names) {
    observations.push_back(std::make_shared<Observation>(
        Observe(capture, name, camera_ids, options, progress)));
  }
  building.group.wait();
  return FitTemplate(
      observations, camera_ids, std::move(body_template), options, progress);
}

}  // namespace sweepfit
