// SPDX-License-Identifier: Apache-2.0
#include "model/joint_angles.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

// The joints whose bones stand for the groups; the right side follows its
// mirror image.
constexpr std::array<int, kNumLengthGroups> kGroupJoints = {kSpine,
                                                            kNeck,
                                                            kHead,
                                                            kHeadEnd,
                                                            kLShoulder,
                                                            kLElbow,
                                                            kLWrist,
                                                            kLHandEnd,
                                                            kLHip,
                                                            kLKnee,
                                                            kLAnkle,
                                                            kLFootEnd};

Quaterniond Exp(const Vector3d& v) {
  const double angle = v.norm();
  if (angle < 1e-12) {
    return Quaterniond(1, 0.5 * v.x(), 0.5 * v.y(), 0.5 * v.z()).normalized();
  }
  return Quaterniond(Eigen::AngleAxisd(angle, v / angle));
}

Matrix3d Cross(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// Left Jacobian of SO(3): exp(v + dv) = exp(J dv) exp(v) to first order.
Matrix3d LeftJacobian(const Vector3d& v) {
  const double angle = v.norm();
  const Matrix3d cross = Cross(v);
  if (angle < 1e-6) return Matrix3d::Identity() + 0.5 * cross;
  const double a2 = angle * angle;
  return Matrix3d::Identity() + (1 - std::cos(angle)) / a2 * cross +
         (angle - std::sin(angle)) / (a2 * angle) * cross * cross;
}

// An orthonormal basis with the bone direction last.
Matrix3d BoneBasis(const Vector3d& direction, const Vector3d& reference) {
  Matrix3d basis;
  const Vector3d first =
      (reference - reference.dot(direction) * direction).normalized();
  basis.col(0) = first;
  basis.col(1) = direction.cross(first);
  basis.col(2) = direction;
  return basis;
}

}  // namespace

int LengthGroup(int joint) {
  // Asked for every residual: the search is done once.
  static const std::array<int, kNumJoints> kGroups = [] {
    std::array<int, kNumJoints> groups;
    groups.fill(-1);
    for (int g = 0; g < kNumLengthGroups; ++g) {
      groups[kGroupJoints[g]] = groups[MirrorJoint(kGroupJoints[g])] = g;
    }
    return groups;
  }();
  return kGroups[joint];
}

int LengthGroupJoint(int group) { return kGroupJoints[group]; }

JointAngles::JointAngles(const Skeleton& skeleton) {
  const auto& rest = skeleton.rest_direction;
  const auto add = [&](const std::string& name,
                       JointAngle::Kind kind,
                       int joint,
                       const Vector3d& axis,
                       double limit_low,
                       double limit_high,
                       double usual,
                       double sigma) {
    angles_.push_back({std::string(kJointNames[joint]) + "_" + name,
                       kind,
                       joint,
                       axis.normalized(),
                       limit_low * kDegree,
                       limit_high * kDegree,
                       usual * kDegree,
                       sigma * kDegree});
  };
  const auto ball = [&](int joint,
                        const Matrix3d& basis,
                        const Vector3d& sigma,
                        double limit) {
    const char* names[] = {"bend", "swing", "twist"};
    for (int k = 0; k < 3; ++k) {
      add(names[k],
          JointAngle::Kind::kBall,
          joint,
          basis.col(k),
          -limit,
          limit,
          0,
          sigma[k]);
    }
  };
  const Vector3d left = Vector3d::UnitX();
  const Vector3d front = Vector3d::UnitZ();
  ball(kRoot, BoneBasis(Vector3d::UnitY(), left), {15, 15, 1e4}, 360);
  ball(kSpine, BoneBasis(rest[kNeck], left), {8, 6, 6}, 60);
  ball(kNeck, BoneBasis(rest[kHead], left), {10, 8, 8}, 50);
  ball(kHead, BoneBasis(rest[kHeadEnd], left), {10, 8, 15}, 60);
  for (const int shoulder : {kLShoulder, kRShoulder}) {
    const int elbow = shoulder + 1, wrist = shoulder + 2, hand = shoulder + 3;
    const Matrix3d collar = BoneBasis(rest[shoulder], front);
    add("lift",
        JointAngle::Kind::kCollar,
        shoulder,
        collar.col(0),
        -45,
        45,
        0,
        8);
    add("draw",
        JointAngle::Kind::kCollar,
        shoulder,
        collar.col(1),
        -45,
        45,
        0,
        6);
    ball(shoulder, BoneBasis(rest[elbow], front), {40, 30, 25}, 170);
    // Positive flexion brings the forearm to the front.
    const Vector3d hinge = rest[wrist].cross(front).normalized();
    add("flexion", JointAngle::Kind::kHinge, elbow, hinge, -5, 150, 10, 25);
    add("twist",
        JointAngle::Kind::kHinge,
        elbow,
        rest[wrist],
        -100,
        100,
        0,
        20);
    ball(wrist, BoneBasis(rest[hand], front), {12, 12, 12}, 80);
  }
  for (const int hip : {kLHip, kRHip}) {
    const int knee = hip + 1, ankle = hip + 2, foot = hip + 3;
    ball(hip, BoneBasis(rest[knee], left), {20, 12, 12}, 130);
    const Vector3d hinge = rest[ankle].cross(-front).normalized();
    add("flexion", JointAngle::Kind::kHinge, knee, hinge, -5, 150, 3, 15);
    add("twist", JointAngle::Kind::kHinge, knee, rest[ankle], -30, 30, 0, 5);
    ball(ankle, BoneBasis(rest[foot], left), {12, 8, 8}, 60);
  }
}

int JointAngles::Find(const std::string& name) const {
  for (size_t i = 0; i < angles_.size(); ++i) {
    if (angles_[i].name == name) return 3 + static_cast<int>(i);
  }
  return -1;
}

namespace {

// Walks over the angles joint by joint: ball and collar triples or pairs give
// one rotation vector, hinges one factor each.
struct LocalRotations {
  Pose pose;
  // Axis of every angle in the parent's frame, derivative of the rotation.
  std::vector<Vector3d> axis_in_parent;
};

LocalRotations Rotations(const JointAngles& joint_angles,
                         const double* parameters) {
  LocalRotations result;
  const auto& angles = joint_angles.angles();
  result.axis_in_parent.resize(angles.size());
  result.pose.root_in_world = Eigen::Map<const Vector3d>(parameters);
  for (size_t i = 0; i < angles.size();) {
    const JointAngle& angle = angles[i];
    if (angle.kind == JointAngle::Kind::kHinge) {
      Quaterniond& q = result.pose.rotation[angle.joint];
      result.axis_in_parent[i] = q * angle.axis;
      q = q * Quaterniond(Eigen::AngleAxisd(parameters[3 + i], angle.axis));
      ++i;
      continue;
    }
    const size_t size = angle.kind == JointAngle::Kind::kBall ? 3 : 2;
    Vector3d v = Vector3d::Zero();
    for (size_t k = i; k < i + size; ++k)
      v += angles[k].axis * parameters[3 + k];
    const Matrix3d jacobian = LeftJacobian(v);
    for (size_t k = i; k < i + size; ++k) {
      result.axis_in_parent[k] = jacobian * angles[k].axis;
    }
    if (angle.kind == JointAngle::Kind::kBall) {
      result.pose.rotation[angle.joint] = Exp(v);
    } else {
      result.pose.collar[angle.joint == kLShoulder ? 0 : 1] = Exp(v);
    }
    i += size;
  }
  return result;
}

}  // namespace

Pose JointAngles::ToPose(const double* parameters) const {
  return Rotations(*this, parameters).pose;
}

KinematicState EvaluateKinematics(const Skeleton& skeleton,
                                  const JointAngles& angles,
                                  const double* parameters) {
  const LocalRotations local = Rotations(angles, parameters);
  KinematicState state;
  state.frames = ForwardKinematics(skeleton, local.pose);
  state.bone_direction_in_world[kRoot].setZero();
  for (int j = 1; j < kNumJoints; ++j) {
    const Vector3d bone = state.frames.joint_in_world[j] -
                          state.frames.joint_in_world[kJointParents[j]];
    state.bone_direction_in_world[j] = bone / skeleton.length[j];
  }
  state.axis_in_world.resize(angles.angles().size());
  for (size_t i = 0; i < angles.angles().size(); ++i) {
    const int parent = kJointParents[angles.angles()[i].joint];
    state.axis_in_world[i] =
        parent < 0
            ? local.axis_in_parent[i]
            : state.frames.world_from_joint[parent] * local.axis_in_parent[i];
  }
  return state;
}

PosedPoint::PosedPoint(const CarriedPoint& point,
                       const std::array<Vector3d, 4>& point_in_joint,
                       const KinematicState& state,
                       const std::array<double, kNumJoints>& length_change)
    : point_(point), state_(state), length_change_(length_change) {
  const JointFrames& frames = state.frames;
  point_in_world_.setZero();
  // The state has the current lengths in its joint positions; the stretch terms
  // say how this point follows a change, so the joints' own share is undone.
  for (const auto& [bone, g] : point.stretch) share_[bone] += g;
  for (int b = 0; b < 4; ++b) {
    const double w = point.weight[b];
    if (w == 0) continue;
    for (int j = point.joint[b]; j > 0; j = kJointParents[j]) share_[j] -= w;
    carried_in_world_[b] =
        frames.joint_in_world[point.joint[b]] +
        frames.world_from_joint[point.joint[b]] * point_in_joint[b];
    point_in_world_ += w * carried_in_world_[b];
  }
  for (int j = 1; j < kNumJoints; ++j) {
    if (share_[j] == 0) continue;
    point_in_world_ +=
        share_[j] * length_change[j] * state.bone_direction_in_world[j];
  }
}

void PosedPoint::ByPose(const Vector3d& gradient,
                        const JointAngles& angles,
                        double* by_pose) const {
  const JointFrames& frames = state_.frames;
  // Per joint what its rotation turns: a weight, and weighted positions.
  std::array<double, kNumJoints> weight{};
  std::array<Vector3d, kNumJoints> turned;
  turned.fill(Vector3d::Zero());
  double total = 0;
  for (int b = 0; b < 4; ++b) {
    if (point_.weight[b] == 0) continue;
    total += point_.weight[b];
    const Vector3d moved = point_.weight[b] * carried_in_world_[b];
    for (int j = point_.joint[b]; j >= 0; j = kJointParents[j]) {
      weight[j] += point_.weight[b];
      turned[j] += moved;
    }
  }
  // A joint's rotation turns the bones that start in it and beyond.
  std::array<Vector3d, kNumJoints> stretched;
  for (int bone = 1; bone < kNumJoints; ++bone) {
    if (share_[bone] == 0) continue;
    stretched[bone] = share_[bone] * length_change_[bone] *
                      state_.bone_direction_in_world[bone];
    for (int j = kJointParents[bone]; j >= 0; j = kJointParents[j]) {
      turned[j] += stretched[bone];
    }
  }
  std::array<Vector3d, kNumJoints> torque;
  for (int j = 0; j < kNumJoints; ++j) {
    torque[j] =
        (turned[j] - weight[j] * frames.joint_in_world[j]).cross(gradient);
  }
  Eigen::Map<Vector3d> by_root(by_pose);
  by_root = total * gradient;
  for (size_t i = 0; i < angles.angles().size(); ++i) {
    const JointAngle& angle = angles.angles()[i];
    const int j = angle.joint;
    const Vector3d& axis = state_.axis_in_world[i];
    if (angle.kind != JointAngle::Kind::kCollar) {
      by_pose[3 + i] = axis.dot(torque[j]);
      continue;
    }
    // A collar turns its own bone only, and shifts what lies beyond.
    Vector3d moved =
        weight[j] * (frames.joint_in_world[j] -
                     frames.joint_in_world[std::max(0, kJointParents[j])]);
    if (share_[j] != 0) moved += stretched[j];
    by_pose[3 + i] = axis.dot(moved.cross(gradient));
  }
}

std::array<double, kNumJoints> PosedPoint::ByLength(
    const Vector3d& gradient) const {
  std::array<double, kNumJoints> by_length{};
  for (const auto& [bone, g] : point_.stretch) {
    by_length[bone] += g * gradient.dot(state_.bone_direction_in_world[bone]);
  }
  return by_length;
}

PointDerivative EvaluatePoint(
    const CarriedPoint& point,
    const KinematicState& state,
    const JointAngles& angles,
    const std::array<double, kNumJoints>& length_change,
    bool with_derivative) {
  const PosedPoint posed(point, point.point_in_joint, state, length_change);
  PointDerivative result;
  result.point_in_world = posed.in_world();
  if (!with_derivative) return result;
  result.by_pose.resize(3, angles.num_parameters());
  std::vector<double> by_pose(angles.num_parameters());
  for (int row = 0; row < 3; ++row) {
    const Vector3d unit = Vector3d::Unit(row);
    posed.ByPose(unit, angles, by_pose.data());
    result.by_pose.row(row) = Eigen::Map<const Eigen::RowVectorXd>(
        by_pose.data(), angles.num_parameters());
    const std::array<double, kNumJoints> by_length = posed.ByLength(unit);
    result.by_length.row(row) =
        Eigen::Map<const Eigen::Matrix<double, 1, kNumJoints>>(
            by_length.data());
  }
  return result;
}

CarriedPoint JointAsPoint(int joint) {
  CarriedPoint point;
  point.joint[0] = joint;
  point.weight[0] = 1;
  point.point_in_joint[0].setZero();
  for (int j = joint; j > 0; j = kJointParents[j]) {
    point.stretch.emplace_back(j, 1.0);
  }
  return point;
}

}  // namespace sweepfit
