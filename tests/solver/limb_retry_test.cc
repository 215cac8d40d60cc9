// SPDX-License-Identifier: Apache-2.0
#include "solver/limb_retry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "model/template.h"
#include "tests/solver/seen_mesh.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

constexpr double kStature = 1.7;

// The template itself, seen by four cameras, and where its joints are.
class FourCameras : public ::testing::Test {
 protected:
  FourCameras() : template_(BuildTemplate({.stature = kStature})) {
    Pose pose;
    pose.root_in_world = {0, 0.95, 0};
    const PosedBody posed = PoseForFit(template_, pose);
    std::vector<Vector3d> places;
    for (const double azimuth : {0.4, 2.0, 3.5, 5.1}) {
      places.emplace_back(3 * std::sin(azimuth), 1.3, 3 * std::cos(azimuth));
    }
    seen_ = testing::SeeMesh(posed.mesh, places, 600, 500);
    hull_ = std::make_unique<Volume>(
        BuildVisualHull(seen_.views, {0.012}, nullptr, nullptr));
    truth_ = ForwardKinematics(template_.skeleton, pose);
    LandmarkResult result;
    for (int j = 0; j < kNumJoints; ++j) {
      Landmark3 landmark;
      landmark.name = kJointNames[j];
      landmark.joint = j;
      landmark.point_in_world = truth_.joint_in_world[j];
      landmark.covariance = 0.012 * 0.012 * Eigen::Matrix3d::Identity();
      landmark.source = "volume";
      result.landmarks.push_back(landmark);
    }
    result.stature = kStature;
    result.stature_sigma = 0.02;
    landmarks_ = {result};
  }

  Landmark3& LandmarkOf(int joint) {
    return *std::find_if(
        landmarks_[0].landmarks.begin(),
        landmarks_[0].landmarks.end(),
        [&](const Landmark3& landmark) { return landmark.joint == joint; });
  }

  // In its landmarks only.
  void RaiseRightArm() {
    const Vector3d& shoulder = truth_.joint_in_world[kRShoulder];
    for (const int joint : {kRElbow, kRWrist, kRHandEnd}) {
      Vector3d& point = LandmarkOf(joint).point_in_world;
      point.y() = 2 * shoulder.y() - point.y();
    }
  }

  double Error(const JointResult& joints, int joint) const {
    return (joints.poses[0].frames.joint_in_world[joint] -
            truth_.joint_in_world[joint])
        .norm();
  }

  // The fit before and after its limbs were tried again.
  void Run() {
    const std::vector<PoseEvidence> evidence = {
        {&seen_.views, &seen_.contours, hull_.get(), &landmarks_[0]}};
    fit_.body = template_;
    fit_.joints = EstimateJoints(
        landmarks_, template_.skeleton, kStature, {}, &fit_.summary);
    const JointResult start = fit_.joints;
    FitGlobal(evidence, {}, {}, &fit_.body, &fit_.joints, &fit_.summary);
    before_ = fit_.joints;
    RetryLimbs(
        evidence, {}, {}, template_, kStature, start, &landmarks_, &fit_);
  }

  Body template_;
  JointFrames truth_;
  testing::SeenMesh seen_;
  std::unique_ptr<Volume> hull_;
  std::vector<LandmarkResult> landmarks_;
  JointResult before_;
  GlobalFit fit_;
};

TEST_F(FourCameras, AnArmOnAFalseLimbIsFoundAgain) {
  RaiseRightArm();
  Run();
  EXPECT_GT(Error(before_, kRWrist), 0.1);
  EXPECT_LT(Error(fit_.joints, kRWrist), 0.04);
  EXPECT_LT(Error(fit_.joints, kLWrist), 0.03);
  EXPECT_EQ(LandmarkOf(kRWrist).source, "mirror");
  EXPECT_EQ(LandmarkOf(kLWrist).source, "volume");
  ASSERT_EQ(fit_.summary.warnings.size(), 1u);
  EXPECT_EQ(fit_.summary.warnings[0].find("r_arm: "), 0u);
  EXPECT_EQ(fit_.summary.status, "weak");
}

TEST_F(FourCameras, WhatExplainsTheOutlinesStays) {
  Run();
  EXPECT_TRUE(fit_.summary.warnings.empty());
  EXPECT_EQ(fit_.summary.status, "ok");
  EXPECT_EQ(fit_.joints.coordinates, before_.coordinates);
  EXPECT_EQ(LandmarkOf(kRWrist).source, "volume");
}

// Somebody else's keypoints are not taken away.
TEST_F(FourCameras, KeypointsStay) {
  RaiseRightArm();
  for (const int joint : {kRElbow, kRWrist, kRHandEnd}) {
    LandmarkOf(joint).source = "keypoint";
  }
  Run();
  EXPECT_EQ(LandmarkOf(kRWrist).source, "keypoint");
}

}  // namespace
}  // namespace sweepfit
