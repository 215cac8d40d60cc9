// SPDX-License-Identifier: Apache-2.0
#include "model/joint_limits.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "model/input_error.h"
#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

double AngleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return a.angularDistance(b);
}

// Arms straight to the sides, legs straight down.
Skeleton PlainSkeleton() {
  Skeleton skeleton = ToySkeleton();
  for (const int shoulder : {kLShoulder, kRShoulder}) {
    const double side = shoulder == kLShoulder ? 1 : -1;
    for (int j = 1; j <= 3; ++j) {
      skeleton.rest_direction[shoulder + j] = Eigen::Vector3d(side, 0, 0);
    }
  }
  return skeleton;
}

TEST(JointLimits, MeasuresWhatItMakes) {
  const JointLimits limits(ToySkeleton());
  for (int joint = 0; joint < kNumJoints; ++joint) {
    if (!limits.limit(joint)) continue;
    const SwingTwist angles{0.7, -0.4, 0.3};
    const SwingTwist measured =
        limits.Measure(joint, limits.Rotation(joint, angles));
    EXPECT_NEAR(measured.bend, angles.bend, 1e-9) << kJointNames[joint];
    EXPECT_NEAR(measured.side, angles.side, 1e-9) << kJointNames[joint];
    EXPECT_NEAR(measured.twist, angles.twist, 1e-9) << kJointNames[joint];
  }
}

TEST(JointLimits, AnglesDoNotDependOnTheRestPose) {
  // The same posture of the bones, from two rest poses: the arm points
  // straight to the front.
  for (const Skeleton& skeleton : {ToySkeleton(), PlainSkeleton()}) {
    const JointLimits limits(skeleton);
    const Eigen::Quaterniond to_front = Eigen::Quaterniond::FromTwoVectors(
        skeleton.rest_direction[kLElbow], Eigen::Vector3d::UnitZ());
    const SwingTwist angles = limits.Measure(kLShoulder, to_front);
    EXPECT_NEAR(angles.bend, 90 * kDegree, 1e-6);
    EXPECT_NEAR(angles.side, 0, 1e-6);
  }
}

TEST(JointLimits, ElbowsBendToTheFrontAndKneesToTheBack) {
  const Skeleton skeleton = ToySkeleton();
  const JointLimits limits(skeleton);
  for (const int elbow : {kLElbow, kRElbow}) {
    const Eigen::Vector3d bent =
        limits.Rotation(elbow, {1, 0, 0}) * skeleton.rest_direction[elbow + 1];
    EXPECT_GT(bent.z(), 0.5);
  }
  for (const int knee : {kLKnee, kRKnee}) {
    const Eigen::Vector3d bent =
        limits.Rotation(knee, {1, 0, 0}) * skeleton.rest_direction[knee + 1];
    EXPECT_LT(bent.z(), -0.5);
  }
  for (const int shoulder : {kLShoulder, kRShoulder}) {
    const double side = shoulder == kLShoulder ? 1 : -1;
    const Eigen::Vector3d raised = limits.Rotation(shoulder, {0, 1, 0}) *
                                   skeleton.rest_direction[shoulder + 1];
    EXPECT_GT(side * raised.x(), 0.5);
    EXPECT_GT(raised.y(), 0);
  }
}

TEST(JointLimits, SidesMirrorEachOther) {
  const JointLimits limits(ToySkeleton());
  const auto mirrored = [](const Eigen::Quaterniond& q) {
    return Eigen::Quaterniond(q.w(), q.x(), -q.y(), -q.z());
  };
  for (int joint = 0; joint < kNumJoints; ++joint) {
    if (!limits.limit(joint) || MirrorJoint(joint) <= joint) continue;
    const SwingTwist angles{0.5, 0.2, -0.3};
    EXPECT_LT(AngleBetween(mirrored(limits.Rotation(joint, angles)),
                           limits.Rotation(MirrorJoint(joint), angles)),
              1e-7)
        << kJointNames[joint];
  }
}

TEST(JointLimits, ClampedPosesAreWithinAndStay) {
  const JointLimits limits(ToySkeleton());
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Pose wild = RandomPose(2.5, seed);
    EXPECT_FALSE(limits.Violations(wild, 1e-6).empty());
    const Pose clamped = limits.Clamp(wild);
    EXPECT_TRUE(limits.Violations(clamped, 1e-6).empty()) << seed;
    const Pose again = limits.Clamp(clamped);
    for (int j = 0; j < kNumJoints; ++j) {
      EXPECT_LT(AngleBetween(clamped.rotation[j], again.rotation[j]), 1e-6);
    }
    EXPECT_LT(AngleBetween(clamped.rotation[kRoot], wild.rotation[kRoot]),
              1e-12);
  }
}

TEST(JointLimits, ViolationsNameTheJointAndTheExcess) {
  const JointLimits limits(ToySkeleton());
  Pose pose;
  const double high = limits.limit(kLKnee)->bend.high;
  pose.rotation[kLKnee] = limits.Rotation(kLKnee, {high + 0.1, 0, 0});
  const std::vector<LimitViolation> found = limits.Violations(pose, 1e-3);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].joint, kLKnee);
  EXPECT_EQ(found[0].angle, "swing");
  EXPECT_NEAR(found[0].excess, 0.1, 1e-6);
}

TEST(JointLimits, RandomPosesAreWithinAndRepeat) {
  const JointLimits limits(ToySkeleton());
  const std::vector<Pose> poses = limits.RandomPoses(50, 3);
  const std::vector<Pose> again = limits.RandomPoses(50, 3);
  double largest_bend = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_TRUE(limits.Violations(poses[i], 1e-9).empty());
    EXPECT_EQ(poses[i].rotation[kLElbow].coeffs(),
              again[i].rotation[kLElbow].coeffs());
    largest_bend = std::max(
        largest_bend, limits.Measure(kLElbow, poses[i].rotation[kLElbow]).bend);
  }
  EXPECT_GT(largest_bend, 100 * kDegree);
}

TEST(JointLimits, LimitPosesReachTheEnds) {
  const JointLimits limits(ToySkeleton());
  double highest = 0;
  for (const Pose& pose : limits.LimitPoses()) {
    EXPECT_TRUE(limits.Violations(pose, 0.2).empty());
    highest =
        std::max(highest, limits.Measure(kLKnee, pose.rotation[kLKnee]).bend);
  }
  EXPECT_NEAR(highest, limits.limit(kLKnee)->bend.high, 1e-9);
}

TEST(JointLimits, BadTablesAreErrorsWithALine) {
  const Skeleton skeleton = ToySkeleton();
  const std::string collar = "collar: {lift: [-1, 1], draw: [-1, 1]}\n";
  const auto table = [&](const std::string& entry) {
    return "joints:\n  " + entry + "\n" + collar;
  };
  const std::string good =
      "l_knee: {zero: straight, towards: [0, 0, -1], bend: [-5, 140], "
      "side: [0, 0], twist: [-1, 1]}";
  EXPECT_NO_THROW(JointLimits(skeleton, table(good), "limits"));
  const std::pair<std::string, std::string> replaced[] = {
      {"l_knee", "r_knee"},
      {"l_knee", "nose"},
      {"straight", "sideways"},
      {"[-5, 140]", "[5, 140]"},
      {"[-5, 140]", "[-5]"},
      {"[-5, 140]", "[-5, .nan]"},
      {"[-5, 140]", "[-5, many]"},
      {"[0, 0, -1]", "[0, 0, 0]"},
      {"bend:", "bent:"}};
  for (const auto& [from, to] : replaced) {
    std::string bad = good;
    bad.replace(bad.find(from), from.size(), to);
    try {
      JointLimits(skeleton, table(bad), "limits");
      ADD_FAILURE() << bad;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("limits: line 2"),
                std::string::npos)
          << error.what();
    }
  }
}

}  // namespace
}  // namespace sweepfit
