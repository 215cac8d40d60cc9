// SPDX-License-Identifier: Apache-2.0
#include "solver/limb_retry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kRimReach = 20;  // pixels
// Shares of the outlines that find no rim of the body: more than folds, hair
// and skirts make, and as little as they may.
constexpr double kWrong = 0.04;
constexpr double kFine = 0.015;
// What an outline without a rim costs against one that is so far off, metres.
constexpr double kUnexplainedError = 0.03;
// The cost must fall to this share of what it was.
constexpr double kClearlyBetter = 0.93;
// Of the guess that a limb mirrors the other, metres.
constexpr double kMirrorSigma = 0.08;

struct Limb {
  const char* name;
  std::array<BodyPart, 2> parts;
  std::vector<int> joints;
  std::vector<int> mirrored;
};
const std::array<Limb, 4> kLimbs = {{
    {"l_arm",
     {BodyPart::kLArm, BodyPart::kLHand},
     {kLShoulder, kLElbow, kLWrist, kLHandEnd},
     {kRShoulder, kRElbow, kRWrist, kRHandEnd}},
    {"r_arm",
     {BodyPart::kRArm, BodyPart::kRHand},
     {kRShoulder, kRElbow, kRWrist, kRHandEnd},
     {kLShoulder, kLElbow, kLWrist, kLHandEnd}},
    {"l_leg",
     {BodyPart::kLLeg, BodyPart::kLFoot},
     {kLKnee, kLAnkle, kLFootEnd},
     {kRKnee, kRAnkle, kRFootEnd}},
    {"r_leg",
     {BodyPart::kRLeg, BodyPart::kRFoot},
     {kRKnee, kRAnkle, kRFootEnd},
     {kLKnee, kLAnkle, kLFootEnd}},
}};

double UnexplainedShare(const RimEvidence& rims) {
  const double all =
      static_cast<double>(rims.contour.size()) + rims.num_unexplained;
  return all > 0 ? rims.num_unexplained / all : 0;
}

// How badly the body explains the outlines, metres.
double OutlineCost(const StandingBody& standing) {
  double unexplained = 0;
  for (const RimEvidence& rims : standing.rims) {
    unexplained +=
        UnexplainedShare(rims) / static_cast<double>(standing.rims.size());
  }
  return standing.rim_error + kUnexplainedError * unexplained;
}

// Mean distance of a limb's own rims from the silhouettes, metres.
double LimbError(const Limb& limb,
                 const RimEvidence& rims,
                 const std::vector<View>& views,
                 const Body& body) {
  RimEvidence own;
  for (const RimPoint& rim : rims.rim) {
    const BodyPart part = body.topology.part[rim.vertex];
    if (part == limb.parts[0] || part == limb.parts[1]) own.rim.push_back(rim);
  }
  return MeanRimError(own, views);
}

// The landmarks with the limb's replaced by the mirror image of the other
// limb's joints, in the plane between left and right of the pelvis.
LandmarkResult WithMirroredLimb(const LandmarkResult& landmarks,
                                const Limb& limb,
                                const JointFrames& frames) {
  const auto at = [&](int joint) { return frames.joint_in_world[joint]; };
  const Vector3d middle = 0.5 * (at(kLHip) + at(kRHip));
  const Vector3d left = (at(kLHip) - at(kRHip)).normalized();
  LandmarkResult result = landmarks;
  std::erase_if(result.landmarks, [&](const Landmark3& landmark) {
    return landmark.source != "keypoint" &&
           std::find(limb.joints.begin(), limb.joints.end(), landmark.joint) !=
               limb.joints.end();
  });
  for (size_t i = 0; i < limb.joints.size(); ++i) {
    const Vector3d other = at(limb.mirrored[i]);
    Landmark3 guess;
    guess.joint = limb.joints[i];
    guess.name = kJointNames[guess.joint];
    guess.point_in_world = other - 2 * left.dot(other - middle) * left;
    guess.covariance = kMirrorSigma * kMirrorSigma * Matrix3d::Identity();
    guess.source = "mirror";
    result.landmarks.push_back(std::move(guess));
  }
  return result;
}

// A fit with other landmarks.
struct Trial {
  LandmarkResult landmarks;  // of the pose they were changed in
  JointResult start;         // joints as estimated from them
  GlobalFit fit;
  StandingBody standing;
  double cost = 0;
};

}  // namespace

void RetryLimbs(const std::vector<PoseEvidence>& evidence,
                const GlobalOptions& options,
                const JointOptions& joint_options,
                const Body& template_body,
                double stature,
                JointResult start,
                std::vector<LandmarkResult>* landmarks,
                GlobalFit* fit) {
  StandingBody standing = Stand(evidence, fit->joints, fit->body, kRimReach);
  double cost = OutlineCost(standing);
  // `evidence` points to the landmarks: they are changed for as long as it
  // takes.
  const auto run = [&](size_t pose, LandmarkResult changed) {
    Trial trial;
    trial.landmarks = std::move(changed);
    std::swap((*landmarks)[pose], trial.landmarks);
    trial.fit.summary.stage = fit->summary.stage;
    trial.fit.body = template_body;
    trial.start = EstimateJoints(*landmarks,
                                 template_body.skeleton,
                                 stature,
                                 joint_options,
                                 &trial.fit.summary);
    trial.fit.joints = trial.start;
    SetBoneLengths(trial.start.skeleton.length, &trial.fit.body);
    FitGlobal(evidence,
              options,
              joint_options,
              &trial.fit.body,
              &trial.fit.joints,
              &trial.fit.summary);
    std::swap((*landmarks)[pose], trial.landmarks);
    trial.standing =
        Stand(evidence, trial.fit.joints, trial.fit.body, kRimReach);
    trial.cost = OutlineCost(trial.standing);
    return trial;
  };
  for (size_t p = 0; p < evidence.size(); ++p) {
    if (UnexplainedShare(standing.rims[p]) <= kWrong) continue;
    std::vector<std::pair<double, const Limb*>> worst_first;
    for (const Limb& limb : kLimbs) {
      worst_first.emplace_back(
          LimbError(limb, standing.rims[p], *evidence[p].views, fit->body),
          &limb);
    }
    std::stable_sort(
        worst_first.begin(),
        worst_first.end(),
        [](const auto& a, const auto& b) { return a.first > b.first; });
    for (const auto& [error, limb] : worst_first) {
      if (UnexplainedShare(standing.rims[p]) <= kFine) break;
      // The fit knows the pelvis better, the landmarks may know the other limb
      // better.
      for (const JointFrames& frames :
           {fit->joints.poses[p].frames, start.poses[p].frames}) {
        Trial trial = run(p, WithMirroredLimb((*landmarks)[p], *limb, frames));
        if (trial.fit.summary.status != "ok" ||
            trial.cost > kClearlyBetter * cost) {
          continue;
        }
        (*landmarks)[p] = std::move(trial.landmarks);
        trial.fit.summary.status = "weak";
        trial.fit.summary.warnings = std::move(fit->summary.warnings);
        trial.fit.summary.warnings.push_back(
            std::string(limb->name) +
            ": its landmarks leave outlines unexplained and are left out");
        *fit = std::move(trial.fit);
        start = std::move(trial.start);
        standing = std::move(trial.standing);
        cost = trial.cost;
        break;
      }
    }
  }
}

}  // namespace sweepfit
