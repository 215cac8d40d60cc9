// SPDX-License-Identifier: Apache-2.0
#include "solver/landmarks.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "model/input_error.h"
#include "solver/landmark_body.h"
#include "solver/landmark_contours.h"
#include "solver/landmark_graph.h"

namespace sweepfit {
namespace {

// Points of the solid graph per body height.
constexpr double kGraphResolution = 140;
// Ends that stick out less than this share of the body height are none.
constexpr double kMinProminence = 0.2;

// Looks for the edges of limbs and for tips in every picture.
void MeasureInViews(const std::vector<View>& views,
                    const BodyTrace& body,
                    LandmarkResult* result) {
  for (Landmark3& landmark : result->landmarks) {
    for (const BodyTrace::LimbPlace& place : body.limb_places) {
      if (place.joint != landmark.joint) continue;
      RefineAcrossLimb(views,
                       place.direction,
                       place.max_half_width,
                       &landmark,
                       &result->points);
    }
    for (const BodyTrace::TipPlace& place : body.tip_places) {
      if (place.joint != landmark.joint) continue;
      MeasureTip(views, landmark, place.base_in_world, &result->points);
    }
  }
}

// Corners of the outline lie this close to the joint behind them, of stature.
constexpr double kCornerReach = 0.09;

// Armpits, crotch and the corners of the neck, between the limbs beside them.
void MeasureCorners(const std::vector<View>& views, LandmarkResult* result) {
  const auto measure = [&](const std::string& name,
                           std::string_view limb,
                           std::string_view other_limb,
                           std::string_view joint) {
    const Landmark3* a = result->Find(limb);
    const Landmark3* b = result->Find(other_limb);
    const Landmark3* corner = result->Find(joint);
    if (a == nullptr || b == nullptr || corner == nullptr) return;
    MeasureCorner(views,
                  name,
                  a->point_in_world,
                  b->point_in_world,
                  corner->point_in_world,
                  kCornerReach * result->stature,
                  &result->points);
  };
  measure("crotch", "l_ankle", "r_ankle", "root");
  measure("l_armpit", "l_wrist", "l_hip", "l_shoulder");
  measure("r_armpit", "r_wrist", "r_hip", "r_shoulder");
  measure("l_neck", "head_end", "l_elbow", "neck");
  measure("r_neck", "head_end", "r_elbow", "neck");
}

// Standing upright, the crown's height above the floor, with hair and shoes in
// the spread; else the limbs' usual shares of the stature.
void EstimateStature(double height, LandmarkResult* result) {
  const auto find = [&](int joint) { return result->Find(kJointNames[joint]); };
  const Landmark3* crown = find(kHeadEnd);
  const Landmark3* neck = find(kNeck);
  const Landmark3* root = find(kRoot);
  result->stature = height;
  result->stature_sigma = 0.1;
  if (crown == nullptr || neck == nullptr || root == nullptr) return;
  const Eigen::Vector3d trunk = neck->point_in_world - root->point_in_world;
  const Eigen::Vector3d head = crown->point_in_world - neck->point_in_world;
  const double standing = crown->point_in_world.y() - result->floor_height;
  bool upright =
      trunk.y() > 0.97 * trunk.norm() && head.y() > 0.9 * head.norm();
  for (const auto& [hip, ankle] :
       {std::pair{kLHip, kLAnkle}, std::pair{kRHip, kRAnkle}}) {
    if (find(hip) == nullptr || find(ankle) == nullptr) continue;
    const Eigen::Vector3d leg =
        find(hip)->point_in_world - find(ankle)->point_in_world;
    // A straight standing leg is nearly half the stature.
    upright =
        upright && leg.y() > 0.94 * leg.norm() && leg.norm() > 0.4 * standing;
  }
  if (upright) {
    result->stature = standing;
    result->stature_sigma = 0.02;
    return;
  }
  // Along the body: head and trunk, then the longer leg and its foot's height.
  double leg_length = 0;
  for (const auto& [hip, ankle] :
       {std::pair{kLHip, kLAnkle}, std::pair{kRHip, kRAnkle}}) {
    if (find(hip) == nullptr || find(ankle) == nullptr) continue;
    leg_length = std::max(
        leg_length,
        (find(hip)->point_in_world - find(ankle)->point_in_world).norm());
  }
  if (leg_length == 0) return;
  constexpr double kAnkleShare = 0.045;
  result->stature =
      (head.norm() + trunk.norm() + leg_length) / (1 - kAnkleShare);
  result->stature_sigma = 0.05;
}

void Summarize(const LandmarkResult& result,
               const BodyTrace& body,
               Progress* progress,
               StageSummary* summary) {
  for (const std::string& warning : body.warnings) {
    if (progress != nullptr) progress->Warning("landmarks: " + warning);
  }
  if (summary == nullptr) return;
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
  if (const auto error = options.Check()) throw InputError(*error);
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
  MeasureInViews(views, body, &result);
  std::sort(result.landmarks.begin(),
            result.landmarks.end(),
            [](const auto& a, const auto& b) { return a.joint < b.joint; });
  result.facing_in_world = body.facing_in_world;
  result.facing_confidence = body.facing_confidence;
  result.unsafe_limbs = body.unsafe_limbs;
  EstimateStature(height, &result);
  MeasureCorners(views, &result);
  Summarize(result, body, progress, summary);
  return result;
}

}  // namespace sweepfit
