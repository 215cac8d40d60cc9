// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "model/skeleton.h"

namespace sweepfit {

enum class BvhChannel {
  kXPosition,
  kYPosition,
  kZPosition,
  kXRotation,
  kYRotation,
  kZRotation
};

// A joint of a BVH file. An End Site is a joint without name and channels.
struct BvhJoint {
  std::string name;
  int parent = -1;         // index, less than the joint's own; -1: the root
  Eigen::Vector3d offset;  // from the parent at rest, file units
  std::vector<BvhChannel> channels;  // in the order of the file
  int first_channel = 0;             // column of BvhMotion::values

  bool is_end_site() const { return name.empty(); }
};

// A BVH file: one skeleton and its motion. Units and axes are whatever the file
// means by them; the format does not say.
struct BvhMotion {
  std::vector<BvhJoint> joints;  // parents first, in the order of the file
  double frame_time = 0;         // seconds
  Eigen::MatrixXd values;        // frames x channels; degrees, file units

  int num_frames() const { return static_cast<int>(values.rows()); }
  // Index of the joint with this name, or -1.
  int Find(const std::string& name) const;
};

// Reads any hierarchy and any order of channels. Throws InputError that names
// file and line for everything that is not BVH, for numbers that are none, for
// rows that are too short or long, and for frames that are missing or too many.
BvhMotion LoadBvh(const std::string& path);
BvhMotion ParseBvh(const std::string& text, const std::string& source);

void SaveBvh(const BvhMotion& motion, const std::string& path);
std::string BvhToText(const BvhMotion& motion);

// Orientation and position of every joint (End Sites too) in the file's world.
struct BvhFrames {
  std::vector<Eigen::Matrix3d> world_from_joint;
  std::vector<Eigen::Vector3d> joint_in_world;
};
// The rest pose: all rotations zero, every joint at its offset.
BvhFrames BvhRestFrames(const BvhMotion& motion);
// Rotations are multiplied in the order in which the file lists them. Position
// channels replace the offset.
BvhFrames BvhFramesAt(const BvhMotion& motion, int frame);

// Our skeleton as BVH: joints by their names, centimetres, +Y up, rotation
// channels Z X Y, six channels for the root. Collar bones become joints
// l_collar and r_collar of length 0 at the neck, the five ends End Sites. Of
// the two sets of angles for a rotation the one nearer to the frame before is
// written, so that curves do not jump. CHECKs that frame_time is positive.
BvhMotion BvhFromPoses(const Skeleton& skeleton,
                       const std::vector<Pose>& poses,
                       double frame_time);

// The inverse: InputError naming `source` unless the hierarchy is that of
// BvhFromPoses. Rest directions and lengths are those of the file.
struct BvhPoses {
  Skeleton skeleton;
  std::vector<Pose> poses;
};
BvhPoses PosesFromBvh(const BvhMotion& motion, const std::string& source);

}  // namespace sweepfit
