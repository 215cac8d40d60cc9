// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <string_view>

namespace sweepfit {

inline constexpr int kNumJoints = 21;

enum Joint : int {
  kRoot,
  kSpine,
  kNeck,
  kHead,
  kHeadEnd,
  kLShoulder,
  kLElbow,
  kLWrist,
  kLHandEnd,
  kRShoulder,
  kRElbow,
  kRWrist,
  kRHandEnd,
  kLHip,
  kLKnee,
  kLAnkle,
  kLFootEnd,
  kRHip,
  kRKnee,
  kRAnkle,
  kRFootEnd,
};

inline constexpr std::array<std::string_view, kNumJoints> kJointNames = {
    "root",       "spine",      "neck",       "head",       "head_end",
    "l_shoulder", "l_elbow",    "l_wrist",    "l_hand_end", "r_shoulder",
    "r_elbow",    "r_wrist",    "r_hand_end", "l_hip",      "l_knee",
    "l_ankle",    "l_foot_end", "r_hip",      "r_knee",     "r_ankle",
    "r_foot_end"};

// Parent of each joint, -1 for the root; a parent precedes its children.
inline constexpr std::array<int, kNumJoints> kJointParents = {
    -1,    kRoot,      kSpine,  kNeck,   kHead,  // axis
    kNeck, kLShoulder, kLElbow, kLWrist,         // left arm
    kNeck, kRShoulder, kRElbow, kRWrist,         // right arm
    kRoot, kLHip,      kLKnee,  kLAnkle,         // left leg
    kRoot, kRHip,      kRKnee,  kRAnkle};        // right leg

// Joint with this name, or -1.
int FindJoint(std::string_view name);

// The joint on the other side; joints of the axis are their own mirror image.
int MirrorJoint(int joint);

// A skeleton at rest. All joint frames are parallel to the world at rest
// (x left, y up, z front), so only directions and lengths are left to say.
// Bone j joins the parent of joint j to joint j; the root has none.
struct Skeleton {
  // Unit vectors from the parent to the joint at rest.
  std::array<Eigen::Vector3d, kNumJoints> rest_direction;
  // Bone lengths in metres; 0 for the root.
  std::array<double, kNumJoints> length;
};

// One posture of a skeleton.
struct Pose {
  // Position of the root joint in the world, metres.
  Eigen::Vector3d root_in_world = Eigen::Vector3d::Zero();
  // parent_from_joint rotation of every joint, identity at rest; for the root
  // world_from_root. Rotating a joint moves the bones that start there.
  std::array<Eigen::Quaterniond, kNumJoints> rotation;

  // Rotation S of the collar bone (neck -> shoulder; left, right) against its
  // rest direction, in the neck's frame. It moves the shoulder, so the whole
  // arm, without turning it: raising an arm lifts the shoulder joint.
  std::array<Eigen::Quaterniond, 2> collar;

  Pose() {
    rotation.fill(Eigen::Quaterniond::Identity());
    collar.fill(Eigen::Quaterniond::Identity());
  }
};

// Orientation and position of all joints in the world.
struct JointFrames {
  std::array<Eigen::Matrix3d, kNumJoints> world_from_joint;
  std::array<Eigen::Vector3d, kNumJoints> joint_in_world;
};

// Forward kinematics: R_j = R_p Q_j, x_j = x_p + R_p S_j (l_j d_j), where S is
// the collar rotation for the shoulders and the identity elsewhere.
JointFrames ForwardKinematics(const Skeleton& skeleton, const Pose& pose);

}  // namespace sweepfit
