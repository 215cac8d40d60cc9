// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "model/skeleton.h"

namespace sweepfit {

// Proportions of one person; lengths in metres. Nothing here is read from the
// template's tables: an own, wider family that also holds children.
struct PersonShape {
  double stature = 1.7;
  double sex = 0.5;      // 0 female .. 1 male
  double childhood = 0;  // 0 adult .. 1 about six years old
  double body_mass_index = 22;
  // Factors on breadth and depth of the trunk and on the girth of the limbs.
  double trunk_breadth = 1, trunk_depth = 1, arm_girth = 1, leg_girth = 1;
  double head_scale = 1, bust = 0, foot_scale = 1;
  bool long_hair = false;
  // Offset from the parent joint in the rest pose (arms straight out, legs
  // straight down, facing +Z); entry 0 is the root above the floor.
  std::array<Eigen::Vector3d, kNumJoints> rest_offset;

  // Joint positions in the rest pose, floor at y = 0.
  std::array<Eigen::Vector3d, kNumJoints> RestJoints() const;
};
PersonShape DrawPersonShape(unsigned seed);

// A tapered capsule a-b in a stretched frame: the level set of
//   (|v| - r) / |grad|,  v = M (p - axis point),
// exact on the surface and first-order right near it.
struct BodyPart {
  int bone = 0;  // joint whose frame carries it
  Eigen::Vector3d a;
  double radius_a = 0, radius_b = 0;
  Eigen::Matrix3d stretched_from_world;  // M
  Eigen::Vector3d stretched_axis;        // M (b - a)
  double blend = 0;  // width of the smooth union with the parts before, metres

  double Distance(const Eigen::Vector3d& p) const;
};

enum BodyGroup { kTrunkGroup, kLArmGroup, kRArmGroup, kLLegGroup, kRLegGroup };
inline constexpr int kNumBodyGroups = 5;

// A person standing with the soles on y = 0, hips above the origin, facing +Z.
struct PosedPerson {
  std::array<Eigen::Vector3d, kNumJoints> joint_in_world;
  std::array<Eigen::Matrix3d, kNumJoints> world_from_joint;
  std::array<std::vector<BodyPart>, kNumBodyGroups> parts;
};
// pose: "A" (arms about 45 degrees), "T" or "N" (arms hanging, clear of the
// body). The exact posture depends on the seed and on the pose.
PosedPerson PosePerson(const PersonShape& shape,
                       const std::string& pose,
                       unsigned seed);

}  // namespace sweepfit
