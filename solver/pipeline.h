// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "capture/capture.h"
#include "capture/silhouette.h"
#include "model/body.h"
#include "model/lbs.h"
#include "model/progress.h"
#include "model/stage_summary.h"
#include "solver/fit_body.h"
#include "solver/joints.h"
#include "solver/landmarks.h"
#include "solver/rim_evidence.h"
#include "solver/texture.h"
#include "volume/coherence.h"
#include "volume/volume.h"

namespace sweepfit {

// The stages of a fit in the order in which they run: the values of `until`.
inline constexpr std::array<std::string_view, 9> kFitStages = {"segment",
                                                               "volume",
                                                               "landmarks",
                                                               "joints",
                                                               "global",
                                                               "local",
                                                               "refine",
                                                               "texture",
                                                               "export"};

// Position of a stage in kFitStages, or -1.
int FindFitStage(std::string_view stage);

// The body that a fit starts from.
struct TemplateSource {
  // "generic" for the one that comes with the program, or a rigged person as
  // binary glTF (see ImportTemplate).
  std::string file = "generic";
  bool IsGeneric() const { return file == "generic"; }
  std::string names = "auto";  // of its joints, see joint_names.h
};

// What the result's files look like.
struct ExportOptions {
  // Names of the joints in model.glb, a preset of model/export_names.h.
  std::string names = "sweepfit";
  // Morph targets that take each clip of model.glb from linear skinning to the
  // sweeps.
  bool correctives = true;
  // Helper joints besides the 21 in model.glb: nearer to the sweeps in its own
  // clips. Clips made elsewhere do not move them and look better without.
  bool helpers = true;
  // Write mesh_<pose>.obj with texture coordinates beside the PLY.
  bool obj = false;
  std::optional<std::string> Check() const;
};

// Everything that can be configured about a fit, stage by stage.
struct FitOptions {
  TemplateSource body_template;
  SegmentOptions segment;
  IncoherenceOptions coherence;
  VolumeOptions volume;
  LandmarkOptions landmarks;
  JointOptions joints;
  OutlineOptions outlines;
  GlobalOptions global;
  LocalOptions local;
  PhotoEvidenceOptions photo;
  InnerContourOptions inner_contours;
  RefineOptions refine;
  TextureOptions texture;
  ExportOptions exported;
  // The last stage to run: segment, volume, landmarks, joints, global, local,
  // refine, texture or export.
  std::string until = "export";
  std::optional<std::string> Check() const;
};

// What the cameras saw of one pose.
struct Observation {
  std::string pose;
  std::vector<View> views;
  std::optional<Volume> volume;      // from the stage "volume" on
  LandmarkResult landmarks;          // from the stage "landmarks" on
  std::vector<StageSummary> stages;  // in the order they ran
};

// What is known of one pose after a fit.
struct PoseResult {
  std::string name;
  std::shared_ptr<const Observation> seen;
  JointEstimate joints;  // reliability, covariance
  Pose pose;
  JointFrames frames;
  std::vector<Eigen::Vector3d> vertices_in_world;  // of the fitted body
};

struct FitResult {
  Body body;
  std::optional<SkinFit> skin;
  std::optional<Texture> texture;
  std::vector<PoseResult> poses;
  std::vector<std::string> camera_ids;
  std::vector<StageSummary> stages;  // in the order they ran
};

// The stages that look at pictures, for one pose: silhouettes -> volume ->
// landmarks, as far as options.until says.
Observation Observe(const Capture& capture,
                    const std::string& pose_name,
                    const std::vector<std::string>& camera_ids,
                    const FitOptions& options,
                    Progress* progress);

// The stages that fit one body to all observed poses: joints -> body (global,
// local, refined) -> texture -> skin. Observations may be shared by fits that
// differ in these stages only.
FitResult FitObserved(
    const std::vector<std::shared_ptr<const Observation>>& observations,
    const std::vector<std::string>& camera_ids,
    const FitOptions& options,
    Progress* progress);

// Both, in order.
FitResult Fit(const Capture& capture,
              const std::vector<std::string>& pose_names,
              const std::vector<std::string>& camera_ids,
              const FitOptions& options,
              Progress* progress);

}  // namespace sweepfit
