// SPDX-License-Identifier: Apache-2.0
#include "model/skeleton.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

TEST(SkeletonTest, JointsAreFoundByName) {
  EXPECT_EQ(FindJoint("root"), kRoot);
  EXPECT_EQ(FindJoint("r_foot_end"), kRFootEnd);
  EXPECT_EQ(FindJoint("tail"), -1);
  EXPECT_EQ(FindJoint(""), -1);
  for (int joint = 0; joint < kNumJoints; ++joint) {
    EXPECT_EQ(FindJoint(kJointNames[joint]), joint);
  }
}

TEST(SkeletonTest, MirrorSwapsTheSidesInName) {
  for (int joint = 0; joint < kNumJoints; ++joint) {
    std::string name(kJointNames[joint]);
    if (name.starts_with("l_")) {
      name[0] = 'r';
    } else if (name.starts_with("r_")) {
      name[0] = 'l';
    }
    EXPECT_EQ(kJointNames[MirrorJoint(joint)], name);
    EXPECT_EQ(MirrorJoint(MirrorJoint(joint)), joint);
  }
  EXPECT_DEATH(MirrorJoint(kNumJoints), "joint 21");
}

TEST(SkeletonTest, ParentsComeFirst) {
  EXPECT_EQ(kJointParents[kRoot], -1);
  for (int joint = 1; joint < kNumJoints; ++joint) {
    EXPECT_GE(kJointParents[joint], 0);
    EXPECT_LT(kJointParents[joint], joint);
  }
}

TEST(SkeletonTest, ForwardKinematicsByHand) {
  Skeleton skeleton = ToySkeleton();
  skeleton.rest_direction[kLShoulder] = Eigen::Vector3d::UnitX();
  skeleton.rest_direction[kLElbow] = Eigen::Vector3d::UnitX();
  skeleton.rest_direction[kLWrist] = Eigen::Vector3d::UnitX();
  skeleton.length[kLShoulder] = 0.2;
  skeleton.length[kLElbow] = 0.3;
  skeleton.length[kLWrist] = 0.25;
  Pose pose;
  pose.root_in_world = Eigen::Vector3d(1, 2, 3);
  // The arm up at the shoulder, then the elbow bent to the front: turning
  // about the bone's own x by the rotated frame.
  const double right_angle = std::numbers::pi / 2;
  pose.rotation[kLShoulder] = Eigen::Quaterniond(
      Eigen::AngleAxisd(right_angle, Eigen::Vector3d::UnitZ()));
  pose.rotation[kLElbow] = Eigen::Quaterniond(
      Eigen::AngleAxisd(-right_angle, Eigen::Vector3d::UnitY()));
  const JointFrames frames = ForwardKinematics(skeleton, pose);
  const Eigen::Vector3d shoulder =
      frames.joint_in_world[kNeck] + Eigen::Vector3d(0.2, 0, 0);
  const Eigen::Vector3d elbow = shoulder + Eigen::Vector3d(0, 0.3, 0);
  const Eigen::Vector3d wrist = elbow + Eigen::Vector3d(0, 0, 0.25);
  EXPECT_LT((frames.joint_in_world[kRoot] - pose.root_in_world).norm(), 1e-15);
  EXPECT_LT((frames.joint_in_world[kLShoulder] - shoulder).norm(), 1e-14);
  EXPECT_LT((frames.joint_in_world[kLElbow] - elbow).norm(), 1e-14);
  EXPECT_LT((frames.joint_in_world[kLWrist] - wrist).norm(), 1e-14);
}

TEST(SkeletonTest, CollarMovesTheArmWithoutTurningIt) {
  const Skeleton skeleton = ToySkeleton();
  Pose pose;
  pose.collar[1] =
      Eigen::Quaterniond(Eigen::AngleAxisd(-0.5, Eigen::Vector3d::UnitZ()));
  const JointFrames rest = ForwardKinematics(skeleton, Pose());
  const JointFrames frames = ForwardKinematics(skeleton, pose);
  const Eigen::Vector3d moved =
      frames.joint_in_world[kRShoulder] - rest.joint_in_world[kRShoulder];
  EXPECT_GT(moved.y(), 0.05);
  for (const int joint : {kRElbow, kRWrist, kRHandEnd}) {
    EXPECT_LT(
        (frames.joint_in_world[joint] - rest.joint_in_world[joint] - moved)
            .norm(),
        1e-14);
    EXPECT_TRUE(frames.world_from_joint[joint].isIdentity());
  }
  EXPECT_EQ(frames.joint_in_world[kLShoulder], rest.joint_in_world[kLShoulder]);
}

// Position of a joint by walking up from it, with quaternions.
Eigen::Vector3d JointFromBelow(const Skeleton& skeleton,
                               const Pose& pose,
                               int joint) {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  for (int j = joint; j >= 0; j = kJointParents[j]) {
    point = pose.rotation[j] * point;
    if (kJointParents[j] < 0) continue;
    const bool is_shoulder = j == kLShoulder || j == kRShoulder;
    const Eigen::Quaterniond collar = is_shoulder
                                          ? pose.collar[j == kRShoulder]
                                          : Eigen::Quaterniond::Identity();
    point += collar * (skeleton.length[j] * skeleton.rest_direction[j]);
  }
  return point + pose.root_in_world;
}

TEST(SkeletonTest, ForwardKinematicsAgreesWithTheWalkFromBelow) {
  const Skeleton skeleton = ToySkeleton();
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Pose pose = RandomPose(2.0, seed);
    const JointFrames frames = ForwardKinematics(skeleton, pose);
    for (int joint = 0; joint < kNumJoints; ++joint) {
      EXPECT_LT(
          (frames.joint_in_world[joint] - JointFromBelow(skeleton, pose, joint))
              .norm(),
          1e-13);
      Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
      for (int j = joint; j >= 0; j = kJointParents[j]) {
        rotation = pose.rotation[j] * rotation;
      }
      EXPECT_LT(
          (frames.world_from_joint[joint] - rotation.toRotationMatrix()).norm(),
          1e-13);
    }
  }
}

}  // namespace
}  // namespace sweepfit
