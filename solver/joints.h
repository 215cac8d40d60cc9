// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "model/body.h"
#include "model/stage_summary.h"
#include "solver/landmarks.h"

namespace sweepfit {

struct JointOptions {
  // sigma: every residual is weighted by its own standard deviation.
  // simplex: explicit w_image + w_template + w_anthropometric = 1 per bone.
  // paper: closed form, parent to child, with the simplex weights.
  std::string mode = "sigma";
  // Multipliers of the residual families in mode sigma, the convex weights in
  // modes simplex and paper.
  struct Weights {
    double landmark = 1;
    double template_ratio = 0;  // the template comes from the same tables
    double anthropometric = 1;
    double pose = 1;
    double stature = 1;
    double silhouette = 0.05;  // a template is not the person: its outline errs
    double photo = 0.12;  // points of the surface that the photographs matched
  } weights;
  // The multipliers of the residual families in any mode: convex weights weigh
  // joints against each other, the families they are named after stay whole.
  Weights FamilyWeights() const;
  double template_sigma = 0.05;  // of a bone's ln(length / stature)
  std::optional<std::string> Check() const;
};

// The joints of one pose as estimated.
struct JointEstimate {
  Pose pose;
  JointFrames frames;
  // 3 x 3 covariance per joint, square metres, from landmarks, tables and
  // priors.
  std::array<Eigen::Matrix3d, kNumJoints> covariance;
  // 1 - trace(posterior) / trace(prior), 0 (priors only) .. 1 (images only).
  std::array<double, kNumJoints> reliability{};
  // What part of what is known of the joint's place each family of residuals
  // brings, by its name; the parts sum to 1.
  std::array<std::map<std::string, double>, kNumJoints> evidence;
};

struct JointResult {
  Skeleton base;      // where log_length starts from
  Skeleton skeleton;  // as estimated, shared by all poses
  double sex = 0.5;
  double stature = 0;
  std::vector<JointEstimate> poses;
  // Pose coordinates (JointAngles) per pose, for the stages that go on.
  std::vector<std::vector<double>> coordinates;
  std::array<double, 12> log_length{};  // against the base skeleton
  double stature_sigma = 0;
};

// One Ceres problem over all poses of a person: pose per pose, bone lengths
// shared by poses and by left and right. `base` gives rest directions, the
// lengths to start from and the template's ratios (base_stature its stature).
JointResult EstimateJoints(const std::vector<LandmarkResult>& landmarks,
                           const Skeleton& base,
                           double base_stature,
                           const JointOptions& options,
                           StageSummary* summary);

}  // namespace sweepfit
