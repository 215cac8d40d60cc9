// SPDX-License-Identifier: Apache-2.0
#include "model/joint_angles.h"

#include <gtest/gtest.h>

#include "tests/support/test_person.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

std::array<double, kNumJoints> NoChange() { return {}; }

TEST(JointAngles, NamesAreUniqueAndFound) {
  const JointAngles angles(TestSkeleton());
  for (size_t i = 0; i < angles.angles().size(); ++i) {
    EXPECT_EQ(angles.Find(angles.angles()[i].name), 3 + static_cast<int>(i));
  }
  EXPECT_EQ(angles.Find("third_arm"), -1);
}

TEST(JointAngles, ZeroIsRest) {
  const Skeleton skeleton = TestSkeleton();
  const JointAngles angles(skeleton);
  const std::vector<double> zero(angles.num_parameters(), 0.0);
  const Pose pose = angles.ToPose(zero.data());
  for (int j = 0; j < kNumJoints; ++j) {
    EXPECT_LT(pose.rotation[j].angularDistance(Eigen::Quaterniond::Identity()),
              1e-12);
  }
}

TEST(JointAngles, ElbowFlexionBringsTheHandForward) {
  const Skeleton skeleton = TestSkeleton();
  const JointAngles angles(skeleton);
  for (const char* side : {"l", "r"}) {
    std::vector<double> pose(angles.num_parameters(), 0.0);
    pose[angles.Find(std::string(side) + "_elbow_flexion")] = 1.5;
    const auto state = EvaluateKinematics(skeleton, angles, pose.data());
    const int wrist = FindJoint(std::string(side) + "_wrist");
    EXPECT_GT(state.frames.joint_in_world[wrist].z(), 0.2) << side;
    pose.assign(angles.num_parameters(), 0.0);
    pose[angles.Find(std::string(side) + "_knee_flexion")] = 1.5;
    const auto bent = EvaluateKinematics(skeleton, angles, pose.data());
    const int ankle = FindJoint(std::string(side) + "_ankle");
    EXPECT_LT(bent.frames.joint_in_world[ankle].z(), -0.3) << side;
  }
}

TEST(JointAngles, CollarMovesTheArmWithoutTurningIt) {
  const Skeleton skeleton = TestSkeleton();
  const JointAngles angles(skeleton);
  std::vector<double> pose(angles.num_parameters(), 0.0);
  const auto rest = EvaluateKinematics(skeleton, angles, pose.data());
  pose[angles.Find("l_shoulder_lift")] = 0.3;
  const auto lifted = EvaluateKinematics(skeleton, angles, pose.data());
  const Vector3d moved = lifted.frames.joint_in_world[kLShoulder] -
                         rest.frames.joint_in_world[kLShoulder];
  EXPECT_GT(moved.norm(), 0.04);
  EXPECT_LT((lifted.frames.joint_in_world[kLHandEnd] -
             rest.frames.joint_in_world[kLHandEnd] - moved)
                .norm(),
            1e-12);
  EXPECT_LT((lifted.frames.joint_in_world[kRHandEnd] -
             rest.frames.joint_in_world[kRHandEnd])
                .norm(),
            1e-12);
}

// The derivative of a point that hangs on two joints and stretches with bones.
TEST(JointAngles, PointDerivativesMatchDifferences) {
  const Skeleton skeleton = TestSkeleton();
  const JointAngles angles(skeleton);
  CarriedPoint point;
  point.joint = {kLElbow, kLShoulder, 0, 0};
  point.weight = {0.7, 0.3, 0, 0};
  point.point_in_joint[0] = Vector3d(0.05, -0.1, 0.03);
  point.point_in_joint[1] = Vector3d(0.2, -0.3, 0.02);
  point.stretch = {
      {kSpine, 1}, {kNeck, 1}, {kLShoulder, 1}, {kLElbow, 1}, {kLWrist, 0.4}};
  for (unsigned seed = 0; seed < 5; ++seed) {
    std::vector<double> pose = RandomCoordinates(angles, seed, 2);
    std::array<double, kNumJoints> change{};
    change[kLElbow] = 0.03;
    change[kLWrist] = -0.02;
    change[kNeck] = 0.01;
    const auto at = [&](const std::vector<double>& p,
                        const std::array<double, kNumJoints>& c) {
      Skeleton current = skeleton;
      for (int j = 1; j < kNumJoints; ++j) current.length[j] += c[j];
      return EvaluatePoint(point,
                           EvaluateKinematics(current, angles, p.data()),
                           angles,
                           c,
                           true);
    };
    const PointDerivative here = at(pose, change);
    const double step = 1e-6;
    for (int k = 0; k < angles.num_parameters(); ++k) {
      std::vector<double> plus = pose, minus = pose;
      plus[k] += step;
      minus[k] -= step;
      const Vector3d numeric =
          (at(plus, change).point_in_world - at(minus, change).point_in_world) /
          (2 * step);
      EXPECT_LT((numeric - here.by_pose.col(k)).norm(), 1e-7)
          << (k < 3 ? "root position" : angles.angles()[k - 3].name);
    }
    for (int j = 1; j < kNumJoints; ++j) {
      auto plus = change, minus = change;
      plus[j] += step;
      minus[j] -= step;
      const Vector3d numeric =
          (at(pose, plus).point_in_world - at(pose, minus).point_in_world) /
          (2 * step);
      EXPECT_LT((numeric - here.by_length.col(j)).norm(), 1e-7)
          << kJointNames[j];
    }
  }
}

TEST(JointAngles, JointAsPointIsTheJoint) {
  const Skeleton skeleton = TestSkeleton();
  const JointAngles angles(skeleton);
  const auto pose = RandomCoordinates(angles, 3);
  const auto state = EvaluateKinematics(skeleton, angles, pose.data());
  for (int j = 0; j < kNumJoints; ++j) {
    const auto x =
        EvaluatePoint(JointAsPoint(j), state, angles, NoChange(), false);
    EXPECT_LT((x.point_in_world - state.frames.joint_in_world[j]).norm(),
              1e-12);
  }
}

TEST(JointAngles, LengthGroupsPairTheSides) {
  EXPECT_EQ(LengthGroup(kRoot), -1);
  for (int j = 1; j < kNumJoints; ++j) {
    EXPECT_EQ(LengthGroup(j), LengthGroup(MirrorJoint(j)));
  }
  for (int g = 0; g < kNumLengthGroups; ++g) {
    EXPECT_EQ(LengthGroup(LengthGroupJoint(g)), g);
  }
}

}  // namespace
}  // namespace sweepfit
