// SPDX-License-Identifier: Apache-2.0
#include "model/skeleton.h"

#include <glog/logging.h>

namespace sweepfit {

int FindJoint(std::string_view name) {
  for (int joint = 0; joint < kNumJoints; ++joint) {
    if (kJointNames[joint] == name) return joint;
  }
  return -1;
}

int MirrorJoint(int joint) {
  CHECK(joint >= 0 && joint < kNumJoints) << "joint " << joint;
  constexpr int kArm = kRShoulder - kLShoulder;
  constexpr int kLeg = kRHip - kLHip;
  if (joint >= kLShoulder && joint <= kLHandEnd) return joint + kArm;
  if (joint >= kRShoulder && joint <= kRHandEnd) return joint - kArm;
  if (joint >= kLHip && joint <= kLFootEnd) return joint + kLeg;
  if (joint >= kRHip && joint <= kRFootEnd) return joint - kLeg;
  return joint;
}

JointFrames ForwardKinematics(const Skeleton& skeleton, const Pose& pose) {
  JointFrames frames;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    const Eigen::Matrix3d parent_from_joint =
        pose.rotation[joint].toRotationMatrix();
    const int parent = kJointParents[joint];
    if (parent < 0) {
      frames.world_from_joint[joint] = parent_from_joint;
      frames.joint_in_world[joint] = pose.root_in_world;
      continue;
    }
    const Eigen::Matrix3d& world_from_parent = frames.world_from_joint[parent];
    frames.world_from_joint[joint] = world_from_parent * parent_from_joint;
    Eigen::Vector3d bone_in_parent =
        skeleton.length[joint] * skeleton.rest_direction[joint];
    if (joint == kLShoulder) bone_in_parent = pose.collar[0] * bone_in_parent;
    if (joint == kRShoulder) bone_in_parent = pose.collar[1] * bone_in_parent;
    frames.joint_in_world[joint] =
        frames.joint_in_world[parent] + world_from_parent * bone_in_parent;
  }
  return frames;
}

}  // namespace sweepfit
