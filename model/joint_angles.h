// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "model/skeleton.h"

namespace sweepfit {

// Bones that share a length: 4 along the axis and 8 limb pairs.
inline constexpr int kNumLengthGroups = 12;

// The length group of the bone that ends in this joint, -1 for the root.
int LengthGroup(int joint);
// A joint (of the axis or the left side) whose bone is in this group.
int LengthGroupJoint(int group);

// One coordinate of a pose.
struct JointAngle {
  enum class Kind {
    kBall,    // one of three components of a rotation vector: Q = exp(B theta)
    kHinge,   // Q = exp(axis theta), multiplied in order
    kCollar,  // one of two components of S = exp(B theta), see Pose::collar
  };
  std::string name;  // "l_elbow_flexion"
  Kind kind;
  int joint;             // for kCollar the shoulder
  Eigen::Vector3d axis;  // unit, in the parent's frame (kBall, kCollar) or
                         // after the joint's earlier hinges (kHinge)
  double lower, upper;   // radians
  double usual, sigma;   // of people who stand for a capture, radians
};

// The coordinates of poses: the root's position (3, metres) followed by the
// joint angles. Ball joints use rotation vectors, which have no gimbal lock
// within a turn; elbows and knees are hinges with a twist. Axes follow the rest
// directions, so they belong to one skeleton shape, whatever its lengths.
class JointAngles {
 public:
  explicit JointAngles(const Skeleton& skeleton);

  const std::vector<JointAngle>& angles() const { return angles_; }
  int num_parameters() const { return 3 + static_cast<int>(angles_.size()); }
  // Index of the parameter with this name, -1 when there is none.
  int Find(const std::string& name) const;

  Pose ToPose(const double* parameters) const;

 private:
  std::vector<JointAngle> angles_;
};

// The skeleton in a posture together with what its derivatives need.
struct KinematicState {
  JointFrames frames;
  // Per joint: direction of its bone in the world (collar applied).
  std::array<Eigen::Vector3d, kNumJoints> bone_direction_in_world;
  // Per angle: the axis in the world around which its subtree turns.
  std::vector<Eigen::Vector3d> axis_in_world;
};

KinematicState EvaluateKinematics(const Skeleton& skeleton,
                                  const JointAngles& angles,
                                  const double* parameters);

// A point of the body that moves with the skeleton:
//   x = sum_b w_b (x_b + R_b p_b) + sum_c g_c (l_c - l0_c) d_c
// with joints b that carry it (as in linear blend skinning), bones c whose
// change of length from l0 moves it by the share g_c, and d_c the bone's
// direction in the world. x_b is taken with the lengths l0.
struct CarriedPoint {
  std::array<int, 4> joint{};
  std::array<double, 4> weight{};
  std::array<Eigen::Vector3d, 4> point_in_joint;
  std::vector<std::pair<int, double>> stretch;  // (joint that ends bone c, g_c)
};

// A carried point in one posture. `state` is evaluated with the current
// lengths, `length_change[j]` = l_j - l0_j; these and `point` must outlive it.
class PosedPoint {
 public:
  // `point_in_joint` takes the place of the point's own.
  PosedPoint(const CarriedPoint& point,
             const std::array<Eigen::Vector3d, 4>& point_in_joint,
             const KinematicState& state,
             const std::array<double, kNumJoints>& length_change);

  const Eigen::Vector3d& in_world() const { return point_in_world_; }
  // gradient . d x / d pose: num_parameters values. Backwards along the chain,
  // by the torque of the gradient about every joint.
  void ByPose(const Eigen::Vector3d& gradient,
              const JointAngles& angles,
              double* by_pose) const;
  // gradient . d x / d l_j, per bone.
  std::array<double, kNumJoints> ByLength(
      const Eigen::Vector3d& gradient) const;

 private:
  const CarriedPoint& point_;
  const KinematicState& state_;
  const std::array<double, kNumJoints>& length_change_;
  std::array<Eigen::Vector3d, 4> carried_in_world_;  // per joint that carries
  // By which the bones' change of length moves the point beyond what the joints
  // carry.
  std::array<double, kNumJoints> share_{};
  Eigen::Vector3d point_in_world_;
};

// Position and derivatives of a carried point; arguments as for PosedPoint.
struct PointDerivative {
  Eigen::Vector3d point_in_world;
  Eigen::Matrix3Xd by_pose;                        // 3 x num_parameters
  Eigen::Matrix<double, 3, kNumJoints> by_length;  // per bone, by metre
};
PointDerivative EvaluatePoint(
    const CarriedPoint& point,
    const KinematicState& state,
    const JointAngles& angles,
    const std::array<double, kNumJoints>& length_change,
    bool with_derivative);

// The carried point that is a joint itself.
CarriedPoint JointAsPoint(int joint);

}  // namespace sweepfit
