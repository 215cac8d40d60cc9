// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "model/leg_contact.h"
#include "model/skeleton.h"

namespace sweepfit {

// The rotation of a joint, radians: the bone that starts there swings by a
// rotation vector with the components bend and side, after it has twisted about
// itself. Angles count from the joint's zero, see model/data/joint_limits.yaml.
struct SwingTwist {
  double bend = 0;
  double side = 0;
  double twist = 0;
};

// Closed range of an angle, radians; holds 0.
struct AngleRange {
  double low = 0;
  double high = 0;
};

// Ranges of motion of one joint and the axes its angles are about.
struct JointLimit {
  AngleRange bend, side, twist;
  // Unit axes in the frame of the joint's parent: a positive angle turns by
  // the right hand about them. Orthogonal to each other; `zero` is the
  // direction of the bone at zero angles.
  Eigen::Vector3d bend_axis, side_axis, zero, twist_axis;
  // A positive bend takes the bone there from zero.
  Eigen::Vector3d towards;
  // Turns the bone's rest direction onto its zero.
  Eigen::Quaterniond zero_from_rest;
};

// Which limit a posture leaves, and by how much.
struct LimitViolation {
  int joint = -1;
  // "swing", "twist", "collar lift", "collar draw"; "leg against leg" for hips
  // and knees that would take one leg through the other
  std::string angle;
  double excess = 0;  // radians beyond the limit
};

// Joint limits for one skeleton. Joints without an entry in the table (root,
// ends) are free.
class JointLimits {
 public:
  // The table that comes with the program.
  explicit JointLimits(const Skeleton& skeleton);
  // A table given as YAML text; throws InputError that names `source` and line.
  JointLimits(const Skeleton& skeleton,
              const std::string& text,
              const std::string& source);

  const std::optional<JointLimit>& limit(int joint) const {
    return limits_[joint];
  }
  const AngleRange& collar_lift() const { return collar_lift_; }
  const AngleRange& collar_draw() const { return collar_draw_; }

  // Angles of a rotation (parent_from_joint) of a limited joint, and back. The
  // swing of a bone turned exactly backwards has no direction; one is chosen.
  SwingTwist Measure(int joint, const Eigen::Quaterniond& rotation) const;
  Eigen::Quaterniond Rotation(int joint, const SwingTwist& angles) const;
  // A collar rotation (side 0 left, 1 right) from lift and draw, radians.
  Eigen::Quaterniond Collar(int side, double lift, double draw) const;

  // The nearest angles within the limits: the swing shortened to the ellipse,
  // the twist cut.
  SwingTwist Clamp(int joint, const SwingTwist& angles) const;
  // The posture with every joint and collar clamped. What then takes one leg
  // through the other is reduced: the adductions of both hips by the least
  // common share that parts the legs; where that is not enough, hips also turn
  // less and knees bend less sideways. The rest pose is left as it is.
  Pose Clamp(const Pose& pose) const;
  // What of a posture is beyond the limits by more than `tolerance` radians.
  std::vector<LimitViolation> Violations(const Pose& pose,
                                         double tolerance) const;

  // `num` postures within the limits: swing uniform over the ellipse, twist and
  // collars over their ranges, then legs parted as by Clamp. Root at the
  // origin. Deterministic for a seed on every platform.
  std::vector<Pose> RandomPoses(int num, unsigned seed) const;
  // Postures at the limits, one joint at a time: the ends of bend, side and
  // twist, the ellipse's diagonals, and bend ends with twist ends; left joints
  // and the axis only, since right ones mirror them. Where the other leg stands
  // in the way of a hip there are two: the hip as far as the other leg lets it,
  // and at its limit while the other leg is out of the way, at the limit of its
  // abduction.
  std::vector<Pose> LimitPoses() const;

 private:
  // Lift and draw of a collar rotation. The axes of the two are not quite at
  // right angles.
  std::array<double, 2> MeasureCollar(int side,
                                      const Eigen::Quaterniond& rotation) const;

  void Read(const Skeleton& skeleton,
            const std::string& text,
            const std::string& source);
  // The posture, within the limits of its joints, with legs that do not go
  // through each other.
  Pose PartLegs(const Pose& pose) const;

  std::array<std::optional<JointLimit>, kNumJoints> limits_;
  AngleRange collar_lift_, collar_draw_;
  std::array<Eigen::Vector3d, 2> lift_axis_, draw_axis_;
  std::optional<LegContact> legs_;
  double least_gap_ = 0;  // that the legs keep, metres
};

}  // namespace sweepfit
