// SPDX-License-Identifier: Apache-2.0
#include "solver/landmarks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "solver/landmark_body.h"
#include "solver/landmark_limbs.h"
#include "tests/volume/capsule_person.h"

namespace sweepfit {
namespace {

using testing::CapsulePerson;
using ::testing::Contains;
using testing::MakePerson;
using testing::RenderRing;

constexpr double kA = 0.8;  // arms, radians from the vertical
constexpr double kT = std::numbers::pi / 2;
constexpr double kN = 0.3;

LandmarkResult Find(const CapsulePerson& person,
                    StageSummary* summary = nullptr,
                    double roll = 0,
                    const std::string& mode = "multiview",
                    const std::vector<Joint>& keypoints = {}) {
  const Eigen::Vector3d target(
      person.joint[kRoot].x(), 0.85, person.joint[kRoot].z());
  const std::vector<View> views =
      RenderRing(person.capsules, target, 8, 300, roll);
  HullOptions hull;
  hull.voxel_size = 0.006;
  const Volume volume = BuildVisualHull(views, hull, nullptr, nullptr);
  std::vector<Keypoint2> seen;
  for (const Joint joint : keypoints) {
    for (const View& view : views) {
      seen.push_back({view.camera.id,
                      "A",
                      std::string(kJointNames[joint]),
                      view.camera.Project(person.joint[joint]),
                      2});
    }
  }
  LandmarkOptions options;
  options.mode = mode;
  return FindLandmarks(views, volume, seen, options, nullptr, summary);
}

struct Stance {
  double arm;
  double yaw;
  Eigen::Vector3d shift;
};

class StanceTest : public ::testing::TestWithParam<Stance> {};

TEST_P(StanceTest, FindsJointsOnTheirSides) {
  const Stance& stance = GetParam();
  const CapsulePerson person = MakePerson(stance.arm, stance.yaw, stance.shift);
  StageSummary summary;
  const LandmarkResult result = Find(person, &summary);

  const Eigen::Vector3d facing(std::sin(stance.yaw), 0, std::cos(stance.yaw));
  EXPECT_GT(result.facing_in_world.dot(facing), 0.97);
  EXPECT_GT(result.facing_confidence, 0.5);
  EXPECT_NEAR(result.stature, 1.70, 0.03);
  EXPECT_LT(result.stature_sigma, 0.03);

  for (const Landmark3& landmark : result.landmarks) {
    const Eigen::Vector3d error =
        landmark.point_in_world - person.joint[landmark.joint];
    // No left landmark near a right joint, and none far off.
    EXPECT_LT(error.norm(), 0.11) << landmark.name;
    // The covariance is honest.
    EXPECT_LT(error.dot(landmark.covariance.ldlt().solve(error)), 25)
        << landmark.name << " " << error.transpose();
    EXPECT_GT(landmark.covariance.selfadjointView<Eigen::Lower>()
                  .eigenvalues()
                  .minCoeff(),
              0);
  }
  for (const char* name : {"root",
                           "neck",
                           "head_end",
                           "l_wrist",
                           "r_wrist",
                           "l_ankle",
                           "r_ankle",
                           "l_foot_end",
                           "r_foot_end",
                           "l_knee",
                           "r_knee",
                           "l_hand_end",
                           "r_hand_end",
                           "l_elbow",
                           "r_elbow",
                           "l_shoulder",
                           "r_shoulder"}) {
    ASSERT_NE(result.Find(name), nullptr) << name;
  }
  for (const char* name : {"l_wrist", "r_wrist", "l_ankle", "r_ankle"}) {
    const Landmark3& landmark = *result.Find(name);
    EXPECT_LT((landmark.point_in_world - person.joint[landmark.joint]).norm(),
              0.04)
        << name;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Stances,
    StanceTest,
    ::testing::Values(Stance{kA, 0, {0, 0, 0}},
                      Stance{kA, 0.5 * std::numbers::pi, {1, 0, 0}},
                      Stance{kA, std::numbers::pi, {0, 0, -1}},
                      Stance{kA, 1.5 * std::numbers::pi, {-3, 0, 2}},
                      Stance{kT, 0.3, {0, 0, 0}},
                      Stance{kT, std::numbers::pi + 0.2, {1, 0, 1}},
                      Stance{kN, 0.5 * std::numbers::pi, {0, 0, 0}},
                      Stance{kN, std::numbers::pi, {0, 0, 0}}));

TEST(LandmarksTest, RolledCamerasSeeTheSame) {
  const CapsulePerson person = MakePerson(kA, 0.4, {0, 0, 0});
  const LandmarkResult upright = Find(person);
  const LandmarkResult rolled = Find(person, nullptr, 0.5 * std::numbers::pi);
  EXPECT_GT(upright.facing_in_world.dot(rolled.facing_in_world), 0.99);
  ASSERT_EQ(upright.landmarks.size(), rolled.landmarks.size());
  for (const Landmark3& landmark : upright.landmarks) {
    const Landmark3* other = rolled.Find(landmark.name);
    ASSERT_NE(other, nullptr) << landmark.name;
    EXPECT_LT((landmark.point_in_world - other->point_in_world).norm(), 0.04)
        << landmark.name;
  }
}

TEST(LandmarksTest, MidpointsOfEdgesCentreTheLimb) {
  const CapsulePerson person = MakePerson(kA, 0.4, {0, 0, 0});
  const LandmarkResult result = Find(person);
  for (const char* name : {"l_elbow", "r_elbow", "l_wrist", "r_wrist"}) {
    const Landmark3& landmark = *result.Find(name);
    EXPECT_EQ(landmark.source, "contour") << name;
    EXPECT_GE(landmark.num_views, 2) << name;
    const int joint = landmark.joint;
    const Eigen::Vector3d axis =
        (person.joint[joint] - person.joint[kJointParents[joint]]).normalized();
    const Eigen::Vector3d error = landmark.point_in_world - person.joint[joint];
    EXPECT_LT((error - axis * axis.dot(error)).norm(), 0.006) << name;
    const auto seen = std::count_if(
        result.points.begin(),
        result.points.end(),
        [&](const Landmark2& point) { return point.name == name; });
    EXPECT_EQ(seen, landmark.num_views) << name;
  }
}

// Corners between limbs are seen where the limbs do not hide each other.
TEST(LandmarksTest, FindsCornersOfTheOutline) {
  const CapsulePerson person = MakePerson(kA, 0.0, Eigen::Vector3d::Zero());
  const LandmarkResult result = Find(person);
  for (const char* name : {"crotch", "l_armpit", "r_armpit"}) {
    const auto seen = std::count_if(
        result.points.begin(), result.points.end(), [&](const Landmark2& p) {
          return p.name == name;
        });
    EXPECT_GE(seen, 2) << name;
    const Landmark3* corner = result.Find(name);
    ASSERT_NE(corner, nullptr) << name;
    EXPECT_EQ(corner->joint, -1) << name;
    EXPECT_EQ(corner->num_views, seen) << name;
    const int joint = name[0] == 'c'   ? kRoot
                      : name[0] == 'l' ? kLShoulder
                                       : kRShoulder;
    EXPECT_LT((corner->point_in_world - person.joint[joint]).norm(), 0.16)
        << name;
    // Below the joint, between the limbs.
    EXPECT_LT(corner->point_in_world.y(), person.joint[joint].y()) << name;
  }
  for (const Landmark2& point : result.points) {
    EXPECT_GT(point.covariance.determinant(), 0) << point.name;
  }
}

// Tips are the farthest points of the outline: a capsule's end.
TEST(LandmarksTest, TipsComeFromTheOutline) {
  const CapsulePerson person = MakePerson(kA, 0.4, {0, 0, 0});
  const LandmarkResult result = Find(person);
  for (const char* name :
       {"head_end", "l_hand_end", "r_hand_end", "l_foot_end", "r_foot_end"}) {
    const Landmark3& landmark = *result.Find(name);
    EXPECT_EQ(landmark.source, "contour") << name;
    EXPECT_GE(landmark.num_views, 2) << name;
  }
  for (const int joint : {kLHandEnd, kRHandEnd, kHeadEnd}) {
    const Landmark3& landmark = *result.Find(kJointNames[joint]);
    EXPECT_LT((landmark.point_in_world - person.joint[joint]).norm(), 0.02)
        << landmark.name;
  }
}

TEST(LandmarksTest, KeypointsAreFurtherLandmarks) {
  const CapsulePerson person = MakePerson(kA, 0.4, {0, 0, 0});
  StageSummary summary;
  const LandmarkResult result =
      Find(person, &summary, 0, "multiview", {kLShoulder, kRElbow});
  int count = 0;
  for (const Landmark3& landmark : result.landmarks) {
    if (landmark.source != "keypoint") continue;
    ++count;
    EXPECT_LT((landmark.point_in_world - person.joint[landmark.joint]).norm(),
              1e-3)
        << landmark.name;
  }
  EXPECT_EQ(count, 2);
  // The outline's own come first.
  EXPECT_NE(result.Find("l_shoulder")->source, "keypoint");
  EXPECT_TRUE(summary.figures["landmarks"].contains("keypoint l_shoulder"));
}

TEST(LandmarksTest, DoubtsKeypointsOfTheWrongSide) {
  CapsulePerson person = MakePerson(kA, 0.4, {0, 0, 0});
  StageSummary summary;
  Find(
      person, &summary, 0, "multiview", {kLShoulder, kRShoulder, kLHip, kRHip});
  EXPECT_TRUE(summary.warnings.empty());
  std::swap(person.joint[kLShoulder], person.joint[kRShoulder]);
  std::swap(person.joint[kLHip], person.joint[kRHip]);
  Find(
      person, &summary, 0, "multiview", {kLShoulder, kRShoulder, kLHip, kRHip});
  EXPECT_FALSE(summary.warnings.empty());
}

// The paper's two views and linear map: a baseline, several centimetres off.
TEST(LandmarksTest, PaperModeFindsTheBody) {
  for (const double yaw : {0.0, 2.0}) {
    const CapsulePerson person = MakePerson(kA, yaw, {0.5, 0, 0});
    StageSummary summary;
    const LandmarkResult result = Find(person, &summary, 0, "paper");
    EXPECT_EQ(summary.figures["mode"], "paper");
    for (const int joint : {kRoot,
                            kNeck,
                            kHeadEnd,
                            kLShoulder,
                            kRShoulder,
                            kLElbow,
                            kRElbow,
                            kLWrist,
                            kRWrist,
                            kLHandEnd,
                            kRHandEnd,
                            kLKnee,
                            kRKnee,
                            kLAnkle,
                            kRAnkle,
                            kLFootEnd,
                            kRFootEnd}) {
      const Landmark3* landmark = result.Find(kJointNames[joint]);
      ASSERT_NE(landmark, nullptr) << kJointNames[joint];
      EXPECT_LT((landmark->point_in_world - person.joint[joint]).norm(), 0.12)
          << landmark->name << " at yaw " << yaw;
    }
    EXPECT_FALSE(result.points.empty());
  }
}

TEST(LandmarksTest, ReportsAMissingArm) {
  const CapsulePerson person = MakePerson(kA, 0.4, {0, 0, 0}, false);
  StageSummary summary;
  const LandmarkResult result = Find(person, &summary);
  EXPECT_THAT(result.unsafe_limbs, Contains("l_arm"));
  EXPECT_EQ(result.Find("l_wrist"), nullptr);
  ASSERT_NE(result.Find("r_wrist"), nullptr);
  EXPECT_LT(
      (result.Find("r_wrist")->point_in_world - person.joint[kRWrist]).norm(),
      0.04);
  EXPECT_EQ(summary.status, "weak");
  EXPECT_FALSE(summary.warnings.empty());
}

TEST(LandmarksTest, ReportsASkirt) {
  CapsulePerson person = MakePerson(kA, 0.4, {0, 0, 0});
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector3d center(0, 0.45 + 0.1 * i, 0);
    person.capsules.push_back({center, center, 0.24 - 0.02 * i});
  }
  const LandmarkResult result = Find(person);
  EXPECT_THAT(result.unsafe_limbs, Contains("l_leg"));
  EXPECT_THAT(result.unsafe_limbs, Contains("r_leg"));
  ASSERT_NE(result.Find("l_ankle"), nullptr);
  EXPECT_LT(
      (result.Find("l_ankle")->point_in_world - person.joint[kLAnkle]).norm(),
      0.04);
}

// An end of a body of 1.7 m.
Extremum End(const Eigen::Vector3d& point_in_world, double thickness) {
  Extremum end;
  end.point_in_world = point_in_world;
  end.thickness = thickness;
  end.prominence = 0.5;
  return end;
}

TEST(NameExtremaTest, AHandThatMergesWithTheHipIsNoHead) {
  const std::vector<Extremum> extrema = {End({0.1, 0.02, 0}, 0.04),
                                         End({-0.1, 0.02, 0}, 0.04),
                                         End({0.25, 0.7, 0}, 0.11),
                                         End({0, 1.68, 0}, 0.08),
                                         End({-0.5, 0.9, 0}, 0.02)};
  const BodyEnds ends = NameExtrema(extrema, 1.7, 0);
  ASSERT_TRUE(ends.head);
  EXPECT_EQ(ends.head->point_in_world.y(), 1.68);
  EXPECT_EQ(ends.hands.size(), 2u);
}

TEST(NameExtremaTest, ARaisedHandIsNoHead) {
  const std::vector<Extremum> extrema = {End({0.1, 0.02, 0}, 0.04),
                                         End({-0.1, 0.02, 0}, 0.04),
                                         End({0.25, 2.1, 0}, 0.025),
                                         End({0, 1.68, 0}, 0.062),
                                         End({-0.5, 0.9, 0}, 0.02)};
  const BodyEnds ends = NameExtrema(extrema, 1.7, 0);
  ASSERT_TRUE(ends.head);
  EXPECT_EQ(ends.head->point_in_world.y(), 1.68);
}

TEST(NameExtremaTest, WhatIsLeftSolidBetweenTheLegsIsNoHead) {
  // Four cameras that look down: as thick as a head, and sticks out as far.
  const std::vector<Extremum> extrema = {End({0.1, 0.02, 0}, 0.04),
                                         End({-0.1, 0.02, 0}, 0.04),
                                         End({0.5, 0.9, 0}, 0.02),
                                         End({-0.5, 0.9, 0}, 0.02),
                                         End({0, 0.2, 0.2}, 0.09),
                                         End({0, 0.2, -0.2}, 0.07),
                                         End({0, 1.68, 0}, 0.062)};
  const BodyEnds ends = NameExtrema(extrema, 1.7, 0);
  ASSERT_TRUE(ends.head);
  EXPECT_EQ(ends.head->point_in_world.y(), 1.68);
  ASSERT_EQ(ends.hands.size(), 2u);
  for (const Extremum& hand : ends.hands) {
    EXPECT_EQ(hand.point_in_world.y(), 0.9);
  }
}

// Sections across a shank that is a broad slab to few cameras, traced along a
// way that wanders in it.
TEST(TraceLimbTest, TheLineRunsIntoNoKnot) {
  std::vector<testing::Capsule> slab;
  for (double z = -0.1; z <= 0.1; z += 0.02) {
    slab.push_back({{0, 0.1, z}, {0, 0.7, 0.5 * z}, 0.04});
  }
  const std::vector<View> views = RenderRing(slab, {0, 0.4, 0}, 8, 300, 0);
  HullOptions hull;
  hull.voxel_size = 0.008;
  const Volume volume = BuildVisualHull(views, hull, nullptr, nullptr);
  TraceOptions options;
  options.max_area = 0.03;
  const LimbLine line = TraceLimb(volume,
                                  {{0, 0.09, 0.1},
                                   {0, 0.12, -0.08},
                                   {0, 0.2, 0.08},
                                   {0, 0.22, -0.06},
                                   {0, 0.65, 0}},
                                  options);
  ASSERT_GT(line.size(), 20u);
  for (size_t i = 1; i < line.size(); ++i) {
    EXPECT_GT(line[i].s, line[i - 1].s);
    EXPECT_GT((line[i].point_in_world - line[i - 1].point_in_world)
                  .dot(line[i].tangent),
              0)
        << i;
  }
}

TEST(LandmarksTest, SameTwice) {
  const CapsulePerson person = MakePerson(kA, 0.4, {0, 0, 0});
  const LandmarkResult first = Find(person);
  const LandmarkResult second = Find(person);
  ASSERT_EQ(first.landmarks.size(), second.landmarks.size());
  for (size_t i = 0; i < first.landmarks.size(); ++i) {
    EXPECT_EQ(first.landmarks[i].point_in_world,
              second.landmarks[i].point_in_world);
    EXPECT_EQ(first.landmarks[i].covariance, second.landmarks[i].covariance);
  }
}

TEST(LandmarkOptionsTest, KnowsItsModes) {
  LandmarkOptions options;
  EXPECT_FALSE(options.Check());
  options.mode = "paper";
  EXPECT_FALSE(options.Check());
  options.mode = "guess";
  EXPECT_TRUE(options.Check());
}

}  // namespace
}  // namespace sweepfit
