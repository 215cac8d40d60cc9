// SPDX-License-Identifier: Apache-2.0
#include "solver/landmarks.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "model/input_error.h"
#include "solver/landmark_body.h"
#include "solver/landmark_graph.h"
#include "solver/landmark_keypoints.h"
#include "solver/landmark_paper.h"
#include "solver/landmark_refine.h"

namespace sweepfit {
namespace {

// Points of the solid graph per body height.
constexpr double kGraphResolution = 140;
// Ends that stick out less than this share of the body height are none.
constexpr double kMinProminence = 0.2;
// More than a body has: hulls of few cameras have false ends between the legs.
constexpr int kMaxExtrema = 8;

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

// Appends what was triangulated from keypoints, and doubts the sides when they
// contradict the outline's.
void AddKeypoints(const std::vector<View>& views,
                  const std::vector<Keypoint2>& keypoints,
                  std::vector<std::string>* warnings,
                  LandmarkResult* result) {
  if (keypoints.empty()) return;
  const std::vector<Landmark3> found =
      TriangulateKeypoints(views, keypoints, &result->points);
  if (found.empty()) {
    warnings->push_back("no keypoint is agreed on by two views");
  }
  Eigen::Vector3d left = Eigen::Vector3d::Zero();
  for (const Landmark3& landmark : found) {
    if (landmark.name == "l_hip" || landmark.name == "l_shoulder") {
      left += landmark.point_in_world;
    } else if (landmark.name == "r_hip" || landmark.name == "r_shoulder") {
      left -= landmark.point_in_world;
    }
    (landmark.joint >= 0 ? result->landmarks : result->features)
        .push_back(landmark);
  }
  // Half a person (one shoulder only) would leave a position, not a direction.
  const bool has_sides =
      std::count_if(found.begin(), found.end(), [](const Landmark3& landmark) {
        return landmark.joint == kLHip || landmark.joint == kRHip ||
               landmark.joint == kLShoulder || landmark.joint == kRShoulder;
      }) == 4;
  const Eigen::Vector3d outline_left =
      Eigen::Vector3d::UnitY().cross(result->facing_in_world);
  if (has_sides && left.dot(outline_left) < 0) {
    warnings->push_back(
        "the keypoints' left is the outline's right: check their names");
  }
}

void Summarize(const LandmarkResult& result,
               const BodyTrace& body,
               const LandmarkOptions& options,
               Progress* progress,
               StageSummary* summary) {
  for (const std::string& warning : body.warnings) {
    if (progress != nullptr) progress->Warning("landmarks: " + warning);
  }
  if (summary == nullptr) return;
  summary->status = body.warnings.empty() ? "ok" : "weak";
  summary->warnings = body.warnings;
  auto& figures = summary->figures;
  figures["mode"] = options.mode;
  figures["facing_confidence"] = result.facing_confidence;
  figures["stature"] = result.stature;
  figures["stature_sigma"] = result.stature_sigma;
  figures["crotch_height"] = body.crotch_height;
  figures["unsafe_limbs"] = result.unsafe_limbs;
  auto& found = figures["landmarks"];
  found = nlohmann::ordered_json::object();
  for (const auto* list : {&result.landmarks, &result.features}) {
    for (const Landmark3& landmark : *list) {
      const std::string name =
          (landmark.source == "keypoint" ? "keypoint " : "") + landmark.name;
      found[name] = {{"source", landmark.source},
                     {"num_views", landmark.num_views},
                     {"sigma_rms", std::sqrt(landmark.covariance.trace() / 3)}};
    }
  }
}

}  // namespace

std::optional<std::string> LandmarkOptions::Check() const {
  if (mode != "multiview" && mode != "paper") {
    return "landmarks.mode: must be multiview or paper, not '" + mode + "'";
  }
  return std::nullopt;
}

const Landmark3* LandmarkResult::Find(std::string_view name) const {
  for (const auto* list : {&landmarks, &features}) {
    for (const Landmark3& landmark : *list) {
      if (landmark.name == name) return &landmark;
    }
  }
  return nullptr;
}

LandmarkResult FindLandmarks(const std::vector<View>& views,
                             const Volume& volume,
                             const std::vector<Keypoint2>& keypoints,
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
      FindExtrema(graph, height, kMinProminence * height, kMaxExtrema);
  const BodyEnds ends = NameExtrema(extrema, height, result.floor_height);
  BodyTrace body = TraceBody(volume,
                             ends,
                             height,
                             result.floor_height,
                             [&](const std::vector<Landmark3>& rough) {
                               return TriangulateCorners(
                                   views, rough, height, &result.points);
                             });
  result.landmarks = std::move(body.landmarks);
  result.features = std::move(body.corners);
  std::sort(result.landmarks.begin(),
            result.landmarks.end(),
            [](const auto& a, const auto& b) { return a.joint < b.joint; });
  result.facing_in_world = body.facing_in_world;
  result.facing_confidence = body.facing_confidence;
  result.unsafe_limbs = body.unsafe_limbs;
  EstimateStature(height, &result);
  if (options.mode == "paper") {
    result.points.clear();
    result.features.clear();
    result.landmarks = FindPaperLandmarks(
        views, volume, graph, result.facing_in_world, &result.points);
  } else {
    RefineInViews(views, body, &result);
  }
  AddKeypoints(views, keypoints, &body.warnings, &result);
  Summarize(result, body, options, progress, summary);
  return result;
}

}  // namespace sweepfit
