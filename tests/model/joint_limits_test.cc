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

// A posture of the hips, degrees.
Pose HipPose(const JointLimits& limits,
             const SwingTwist& left,
             const SwingTwist& right) {
  Pose pose;
  for (const int hip : {kLHip, kRHip}) {
    const SwingTwist& angles = hip == kLHip ? left : right;
    pose.rotation[hip] = limits.Rotation(
        hip,
        {angles.bend * kDegree, angles.side * kDegree, angles.twist * kDegree});
  }
  return pose;
}

double Adduction(const JointLimits& limits, const Pose& pose, int hip) {
  return -limits.Measure(hip, pose.rotation[hip]).side / kDegree;
}

TEST(JointLimits, ALegStopsAtTheOtherThatStands) {
  const JointLimits limits(ToySkeleton());
  const Pose pose = HipPose(limits, {0, -30, 20}, {0, 0, 0});
  const Pose clamped = limits.Clamp(pose);
  EXPECT_GT(Adduction(limits, clamped, kLHip), 2);
  EXPECT_LT(Adduction(limits, clamped, kLHip), 12);
  EXPECT_NEAR(Adduction(limits, clamped, kRHip), 0, 1e-6);
  // Nothing else had to change.
  EXPECT_NEAR(
      limits.Measure(kLHip, clamped.rotation[kLHip]).twist, 20 * kDegree, 1e-6);
  const std::vector<LimitViolation> found = limits.Violations(pose, 1e-3);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].joint, kLHip);
  EXPECT_EQ(found[0].angle, "leg against leg");
  EXPECT_NEAR(
      found[0].excess / kDegree, 30 - Adduction(limits, clamped, kLHip), 0.5);
}

TEST(JointLimits, BothHipsGiveWayByTheSameShare) {
  const JointLimits limits(ToySkeleton());
  const Pose clamped = limits.Clamp(HipPose(limits, {0, -20, 0}, {0, -10, 0}));
  const double left = Adduction(limits, clamped, kLHip);
  EXPECT_GT(left, 1);
  EXPECT_LT(left, 8);
  EXPECT_NEAR(Adduction(limits, clamped, kRHip), left / 2, 1e-6);
  // The mirrored posture is clamped to the mirrored one.
  const Pose mirrored = limits.Clamp(HipPose(limits, {0, -10, 0}, {0, -20, 0}));
  EXPECT_NEAR(Adduction(limits, mirrored, kRHip), left, 1e-6);
  EXPECT_NEAR(Adduction(limits, mirrored, kLHip), left / 2, 1e-6);
}

TEST(JointLimits, LegsMayStandTogetherAndCross) {
  const JointLimits limits(ToySkeleton());
  const std::pair<SwingTwist, SwingTwist> allowed[] = {
      {{0, 0, 0}, {0, 0, 0}},
      {{0, -2, 0}, {0, -2, 0}},
      {{35, -13, 0}, {-5, 0, 0}},     // crossed in front
      {{-18, -8, 0}, {10, 0, 0}},     // and behind
      {{105, -8, 0}, {70, -8, 0}},  // thigh over thigh
      {{0, -30, 0}, {0, 45, 0}}};     // as adduction is measured
  for (const auto& [left, right] : allowed) {
    const Pose pose = HipPose(limits, left, right);
    EXPECT_TRUE(limits.Violations(pose, 1e-6).empty())
        << left.bend << " " << left.side;
    const Pose clamped = limits.Clamp(pose);
    for (const int hip : {kLHip, kRHip}) {
      EXPECT_LT(AngleBetween(clamped.rotation[hip], pose.rotation[hip]), 1e-7);
    }
  }
}

// Shanks meet under thighs that do not, when hips turn.
TEST(JointLimits, TurnedLegsDoNotCrossAtTheShanks) {
  const JointLimits limits(ToySkeleton());
  int num_changed = 0;
  for (const double twist : {-45.0, 45.0}) {
    Pose pose = HipPose(limits, {0, 0, twist}, {0, 0, twist});
    for (const int knee : {kLKnee, kRKnee}) {
      pose.rotation[knee] = limits.Rotation(knee, {90 * kDegree, 0, 0});
    }
    const Pose clamped = limits.Clamp(pose);
    EXPECT_TRUE(limits.Violations(clamped, 1e-6).empty());
    num_changed +=
        AngleBetween(clamped.rotation[kLHip], pose.rotation[kLHip]) > 0.05;
    // Knees bend as before.
    EXPECT_NEAR(limits.Measure(kLKnee, clamped.rotation[kLKnee]).bend,
                90 * kDegree,
                1e-6);
  }
  EXPECT_EQ(num_changed, 1);
}

TEST(JointLimits, WhoStandsWithCrossedLegsMay) {
  Skeleton skeleton = ToySkeleton();
  for (const int knee : {kLKnee, kRKnee}) {
    skeleton.rest_direction[knee] = skeleton.rest_direction[knee + 1] =
        Eigen::Vector3d(knee == kLKnee ? -0.2 : 0.2, -1, 0).normalized();
  }
  const JointLimits limits(skeleton);
  EXPECT_TRUE(limits.Violations(Pose(), 1e-9).empty());
  const Pose clamped = limits.Clamp(Pose());
  for (int j = 0; j < kNumJoints; ++j) {
    EXPECT_LT(AngleBetween(clamped.rotation[j], Pose().rotation[j]), 1e-7);
  }
}

// Lift and draw are not at right angles where the collar bone leans.
TEST(JointLimits, CollarsAreMeasuredAsTheyAreMade) {
  Skeleton skeleton = ToySkeleton();
  skeleton.rest_direction[kLShoulder] =
      Eigen::Vector3d(0.8, -0.4, 0.3).normalized();
  const JointLimits limits(skeleton);
  Pose pose;
  pose.collar[0] =
      limits.Collar(0, limits.collar_lift().high, limits.collar_draw().low);
  EXPECT_TRUE(limits.Violations(pose, 1e-6).empty());
  EXPECT_LT(AngleBetween(limits.Clamp(pose).collar[0], pose.collar[0]), 1e-7);
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

TEST(JointLimits, LimitPosesAdductToTheOtherLegAndBesideIt) {
  const JointLimits limits(ToySkeleton());
  double standing = 0, abducted = 0;
  for (const Pose& pose : limits.LimitPoses()) {
    for (const LimitViolation& violation : limits.Violations(pose, 1e-6)) {
      EXPECT_NE(violation.angle, "leg against leg");
    }
    const double left = Adduction(limits, pose, kLHip);
    double& most = Adduction(limits, pose, kRHip) < -40 ? abducted : standing;
    if (std::abs(limits.Measure(kLHip, pose.rotation[kLHip]).bend) < 0.01) {
      most = std::max(most, left);
    }
  }
  EXPECT_GT(standing, 2);
  EXPECT_LT(standing, 12);
  EXPECT_NEAR(abducted, -limits.limit(kLHip)->side.low / kDegree, 1e-6);
}

TEST(JointLimits, BadTablesAreErrorsWithALine) {
  const Skeleton skeleton = ToySkeleton();
  const std::string rest =
      "collar: {lift: [-1, 1], draw: [-1, 1]}\n"
      "legs: {knee: 0.15, foot: 0.12}\n";
  const auto table = [&](const std::string& entry) {
    return "joints:\n  " + entry + "\n" + rest;
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
  const std::pair<std::string, std::string> in_legs[] = {
      {"0.15", "-0.15"},
      {"0.15", "1.5"},
      {"0.15", ".nan"},
      {"0.15", "wide"},
      {"0.15", "[0.15]"},
      {"knee: 0.15, ", ""},
      {"foot:", "feet:"},
      {"{knee: 0.15, foot: 0.12}", "0.15"}};
  for (const auto& [from, to] : in_legs) {
    std::string bad = table(good);
    bad.replace(bad.find(from, bad.find("legs:")), from.size(), to);
    try {
      JointLimits(skeleton, bad, "limits");
      ADD_FAILURE() << bad;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("limits: line 4"),
                std::string::npos)
          << error.what();
    }
  }
  std::string without = table(good);
  without.erase(without.find("legs:"));
  EXPECT_THROW(JointLimits(skeleton, without, "limits"), InputError);
}

}  // namespace
}  // namespace sweepfit
