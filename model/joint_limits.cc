// SPDX-License-Identifier: Apache-2.0
#include "model/joint_limits.h"

#include <glog/logging.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>

#include "model/embedded_data.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

[[noreturn]] void Fail(const std::string& source,
                       const YAML::Node& node,
                       const std::string& what) {
  throw InputError(source + ": line " + std::to_string(node.Mark().line + 1) +
                   ": " + what);
}

std::vector<double> Numbers(const std::string& source,
                            const YAML::Node& map,
                            const std::string& key,
                            std::size_t size) {
  const YAML::Node node = map[key];
  if (!node) Fail(source, map, "the key " + key + " is missing");
  if (!node.IsSequence() || node.size() != size) {
    Fail(source, node, key + " needs " + std::to_string(size) + " numbers");
  }
  std::vector<double> numbers;
  for (const YAML::Node& entry : node) {
    double number = 0;
    try {
      number = entry.as<double>();
    } catch (const YAML::Exception&) {
      Fail(source, entry, key + " needs numbers");
    }
    if (!std::isfinite(number)) Fail(source, entry, key + " is not finite");
    numbers.push_back(number);
  }
  return numbers;
}

AngleRange Range(const std::string& source,
                 const YAML::Node& map,
                 const std::string& key) {
  const std::vector<double> ends = Numbers(source, map, key, 2);
  if (ends[0] > 0 || ends[1] < 0 || ends[0] < -180 || ends[1] > 180) {
    Fail(source,
         map[key],
         key + " needs a range of degrees that holds 0, within -180 .. 180");
  }
  return {ends[0] * kDegree, ends[1] * kDegree};
}

double Share(const std::string& source,
             const YAML::Node& map,
             const std::string& key) {
  const YAML::Node node = map[key];
  if (!node) Fail(source, map, "the key " + key + " is missing");
  double share = -1;
  if (!YAML::convert<double>::decode(node, share) ||
      !(share >= 0 && share <= 1)) {
    Fail(source, node, key + " needs a share within 0 and 1");
  }
  return share;
}

void CheckKeys(const std::string& source,
               const YAML::Node& map,
               const std::set<std::string>& known,
               const std::string& where) {
  if (!map || !map.IsMap()) Fail(source, map, where + " must be a map");
  for (const auto& entry : map) {
    const std::string key = entry.first.as<std::string>();
    if (!known.contains(key)) {
      Fail(source, entry.first, "unknown key " + key + " in " + where);
    }
  }
}

// The joint that ends the bone which this joint turns; of several, the one
// that continues the axis of the body.
int MainChild(int joint) {
  for (int child = joint + 1; child < kNumJoints; ++child) {
    if (kJointParents[child] == joint) return child;
  }
  return -1;
}

Vector3d Mirrored(const Vector3d& v) { return {-v.x(), v.y(), v.z()}; }

Quaterniond Exp(const Vector3d& v) {
  const double angle = v.norm();
  if (angle < 1e-12) return Quaterniond::Identity();
  return Quaterniond(Eigen::AngleAxisd(angle, v / angle));
}

// Length of a swing in units of the ellipse's radius in its direction.
double EllipseNorm(const JointLimit& limit, double bend, double side) {
  const auto share = [](double value, const AngleRange& range) {
    const double end = value < 0 ? range.low : range.high;
    if (value == 0) return 0.0;
    return end == 0 ? 1e12 : value / end;
  };
  return std::hypot(share(bend, limit.bend), share(side, limit.side));
}

double Excess(double value, const AngleRange& range) {
  return std::max({0.0, value - range.high, range.low - value});
}

double Cut(double value, const AngleRange& range) {
  return std::clamp(value, range.low, range.high);
}

Vector3d Log(const Quaterniond& q) {
  const Eigen::AngleAxisd turn(q.w() < 0 ? Quaterniond(-q.coeffs()) : q);
  return turn.angle() * turn.axis();
}

}  // namespace

JointLimits::JointLimits(const Skeleton& skeleton) {
  constexpr const char* kFile = "joint_limits.yaml";
  Read(skeleton, std::string(EmbeddedData(kFile)), kFile);
}

JointLimits::JointLimits(const Skeleton& skeleton,
                         const std::string& text,
                         const std::string& source) {
  Read(skeleton, text, source);
}

void JointLimits::Read(const Skeleton& skeleton,
                       const std::string& text,
                       const std::string& source) {
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw InputError(source + ": " + error.what());
  }
  CheckKeys(source, root, {"joints", "collar", "legs"}, "the table");
  const YAML::Node joints = root["joints"];
  if (!joints || !joints.IsMap()) Fail(source, root, "joints must be a map");
  for (const auto& entry : joints) {
    const std::string name = entry.first.as<std::string>();
    const YAML::Node node = entry.second;
    const int joint = FindJoint(name);
    if (joint < 0 || MainChild(joint) < 0 || joint == kRoot ||
        MirrorJoint(joint) < joint) {
      Fail(source, entry.first, name + " is no joint of the axis or left side");
    }
    CheckKeys(source, node, {"zero", "towards", "bend", "side", "twist"}, name);
    const std::vector<double> towards = Numbers(source, node, "towards", 3);
    JointLimit limit;
    limit.bend = Range(source, node, "bend");
    limit.side = Range(source, node, "side");
    limit.twist = Range(source, node, "twist");
    for (const int own : {joint, MirrorJoint(joint)}) {
      const bool right = own != joint;
      const auto on_side = [right](const Vector3d& v) {
        return right ? Mirrored(v) : v;
      };
      const Vector3d& rest = skeleton.rest_direction[MainChild(own)];
      const YAML::Node zero = node["zero"];
      if (!zero) Fail(source, node, "the key zero is missing");
      if (zero.IsSequence()) {
        const std::vector<double> v = Numbers(source, node, "zero", 3);
        limit.zero = on_side({v[0], v[1], v[2]});
      } else if (zero.as<std::string>() == "straight") {
        limit.zero = skeleton.rest_direction[own];
      } else if (zero.as<std::string>() == "rest") {
        limit.zero = rest;
      } else {
        Fail(source, zero, "zero is a direction, straight or rest");
      }
      if (limit.zero.norm() < 1e-6) Fail(source, zero, "zero has no direction");
      limit.zero.normalize();
      limit.towards = on_side({towards[0], towards[1], towards[2]});
      limit.bend_axis = limit.zero.cross(limit.towards);
      if (limit.bend_axis.norm() < 1e-3) {
        Fail(source, node, "towards lies along the bone at zero");
      }
      limit.bend_axis.normalize();
      // Turns the bone across `towards`; away from the other side.
      limit.side_axis = limit.zero.cross(limit.bend_axis);
      const double outside = right ? -1 : 1;
      const Vector3d to_side = limit.side_axis.cross(limit.zero);
      // Bones that lie across the body have no outside: up instead.
      if (outside * to_side.x() + 0.01 * to_side.y() < 0) {
        limit.side_axis = -limit.side_axis;
      }
      limit.twist_axis = outside * limit.zero;
      limit.zero_from_rest = Quaterniond::FromTwoVectors(rest, limit.zero);
      limits_[own] = limit;
    }
  }
  const YAML::Node collar = root["collar"];
  CheckKeys(source, collar, {"lift", "draw"}, "collar");
  collar_lift_ = Range(source, collar, "lift");
  collar_draw_ = Range(source, collar, "draw");
  for (int side = 0; side < 2; ++side) {
    const Vector3d& bone =
        skeleton.rest_direction[side == 0 ? kLShoulder : kRShoulder];
    lift_axis_[side] = bone.cross(Vector3d::UnitY()).normalized();
    draw_axis_[side] = bone.cross(Vector3d::UnitZ()).normalized();
  }
  const YAML::Node legs = root["legs"];
  CheckKeys(source, legs, {"knee", "foot"}, "legs");
  legs_.emplace(
      skeleton, Share(source, legs, "knee"), Share(source, legs, "foot"));
  // A person whose legs are closer at rest stands like that.
  least_gap_ = std::min(0.0, legs_->Gap(Pose()));
}

// rotation zero_from_rest^-1 carries the zero direction to the bone's posed
// direction: swing times twist about zero.
SwingTwist JointLimits::Measure(int joint, const Quaterniond& rotation) const {
  CHECK(limits_[joint].has_value()) << kJointNames[joint];
  const JointLimit& limit = *limits_[joint];
  const Quaterniond from_zero = rotation * limit.zero_from_rest.conjugate();
  Quaterniond twist(from_zero.w(), 0, 0, 0);
  twist.vec() = from_zero.vec().dot(limit.zero) * limit.zero;
  if (twist.norm() < 1e-9) twist.setIdentity();  // half a turn of swing
  twist.normalize();
  if (twist.w() < 0) twist.coeffs() *= -1;
  const Vector3d swing = Log(from_zero * twist.conjugate());
  SwingTwist angles;
  angles.bend = swing.dot(limit.bend_axis);
  angles.side = swing.dot(limit.side_axis);
  angles.twist = 2 * std::atan2(twist.vec().dot(limit.twist_axis), twist.w());
  return angles;
}

Quaterniond JointLimits::Rotation(int joint, const SwingTwist& angles) const {
  CHECK(limits_[joint].has_value()) << kJointNames[joint];
  const JointLimit& limit = *limits_[joint];
  return Exp(angles.bend * limit.bend_axis + angles.side * limit.side_axis) *
         Exp(angles.twist * limit.twist_axis) * limit.zero_from_rest;
}

Quaterniond JointLimits::Collar(int side, double lift, double draw) const {
  return Exp(lift * lift_axis_[side] + draw * draw_axis_[side]);
}

std::array<double, 2> JointLimits::MeasureCollar(
    int side, const Quaterniond& rotation) const {
  const Vector3d turn = Log(rotation);
  const double across = lift_axis_[side].dot(draw_axis_[side]);
  const double along_lift = turn.dot(lift_axis_[side]);
  const double along_draw = turn.dot(draw_axis_[side]);
  const double scale = 1 - across * across;
  return {(along_lift - across * along_draw) / scale,
          (along_draw - across * along_lift) / scale};
}

SwingTwist JointLimits::Clamp(int joint, const SwingTwist& angles) const {
  CHECK(limits_[joint].has_value()) << kJointNames[joint];
  const JointLimit& limit = *limits_[joint];
  SwingTwist clamped = angles;
  // An axis that may not turn at all is no part of the ellipse.
  if (Excess(angles.bend,
             {limit.bend.low < 0 ? -1e9 : 0, limit.bend.high > 0 ? 1e9 : 0}) >
      0) {
    clamped.bend = 0;
  }
  if (Excess(angles.side,
             {limit.side.low < 0 ? -1e9 : 0, limit.side.high > 0 ? 1e9 : 0}) >
      0) {
    clamped.side = 0;
  }
  const double norm = EllipseNorm(limit, clamped.bend, clamped.side);
  if (norm > 1) {
    clamped.bend /= norm;
    clamped.side /= norm;
  }
  clamped.twist = Cut(angles.twist, limit.twist);
  return clamped;
}

Pose JointLimits::Clamp(const Pose& pose) const {
  Pose clamped = pose;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    if (!limits_[joint]) continue;
    clamped.rotation[joint] =
        Rotation(joint, Clamp(joint, Measure(joint, pose.rotation[joint])));
  }
  for (int side = 0; side < 2; ++side) {
    const auto [lift, draw] = MeasureCollar(side, pose.collar[side]);
    clamped.collar[side] =
        Collar(side, Cut(lift, collar_lift_), Cut(draw, collar_draw_));
  }
  return PartLegs(clamped);
}

Pose JointLimits::PartLegs(const Pose& pose) const {
  // Rounding must not count as contact.
  constexpr double kTouch = 1e-9;  // metres
  const auto is_parted = [this](const Pose& p) {
    return legs_->Gap(p) >= least_gap_ - kTouch;
  };
  if (is_parted(pose)) return pose;
  // From 2, the posture, to 1 adductions vanish, from 1 to 0 turns of the hips
  // and what knees bend sideways.
  const auto reduced = [&](double keep) {
    const double adduction = std::clamp(keep - 1, 0.0, 1.0);
    const double turn = std::min(keep, 1.0);
    Pose result = pose;
    for (const int hip : {kLHip, kRHip}) {
      if (limits_[hip]) {
        SwingTwist angles = Measure(hip, pose.rotation[hip]);
        if (angles.side < 0) angles.side *= adduction;
        angles.twist *= turn;
        result.rotation[hip] = Rotation(hip, angles);
      }
      const int knee = hip + 1;
      if (limits_[knee] && turn < 1) {
        SwingTwist angles = Measure(knee, pose.rotation[knee]);
        angles.side *= turn;
        result.rotation[knee] = Rotation(knee, angles);
      }
    }
    return result;
  };
  // The way may part the legs more than once: the first time counts.
  constexpr int kSteps = 32, kHalvings = 36;
  double overlapping = 2, parted = 0;
  for (int i = kSteps - 1; i > 0; --i) {
    const double keep = 2.0 * i / kSteps;
    if (is_parted(reduced(keep))) {
      parted = keep;
      break;
    }
    overlapping = keep;
  }
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (parted + overlapping) / 2;
    (is_parted(reduced(middle)) ? parted : overlapping) = middle;
  }
  return reduced(parted);
}

std::vector<LimitViolation> JointLimits::Violations(const Pose& pose,
                                                    double tolerance) const {
  std::vector<LimitViolation> violations;
  const auto add = [&](int joint, const char* angle, double excess) {
    if (excess > tolerance) violations.push_back({joint, angle, excess});
  };
  Pose clamped = pose;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    if (!limits_[joint]) continue;
    const SwingTwist angles = Measure(joint, pose.rotation[joint]);
    const SwingTwist inside = Clamp(joint, angles);
    clamped.rotation[joint] = Rotation(joint, inside);
    add(joint,
        "swing",
        std::hypot(angles.bend - inside.bend, angles.side - inside.side));
    add(joint, "twist", std::abs(angles.twist - inside.twist));
  }
  for (int side = 0; side < 2; ++side) {
    const int joint = side == 0 ? kLShoulder : kRShoulder;
    const auto [lift, draw] = MeasureCollar(side, pose.collar[side]);
    add(joint, "collar lift", Excess(lift, collar_lift_));
    add(joint, "collar draw", Excess(draw, collar_draw_));
  }
  const Pose parted = PartLegs(clamped);
  for (const int joint : {kLHip, kLKnee, kRHip, kRKnee}) {
    add(joint,
        "leg against leg",
        clamped.rotation[joint].angularDistance(parted.rotation[joint]));
  }
  return violations;
}

std::vector<Pose> JointLimits::RandomPoses(int num, unsigned seed) const {
  std::mt19937 generator(seed);
  // Own mapping to [0, 1): that of the standard library is not specified.
  const auto uniform = [&generator] { return generator() / 4294967296.0; };
  const auto within = [&](const AngleRange& range) {
    return range.low + uniform() * (range.high - range.low);
  };
  std::vector<Pose> poses(num);
  for (Pose& pose : poses) {
    for (int joint = 0; joint < kNumJoints; ++joint) {
      if (!limits_[joint]) continue;
      const JointLimit& limit = *limits_[joint];
      SwingTwist angles;
      do {
        angles.bend = within(limit.bend);
        angles.side = within(limit.side);
      } while (EllipseNorm(limit, angles.bend, angles.side) > 1);
      angles.twist = within(limit.twist);
      pose.rotation[joint] = Rotation(joint, angles);
    }
    for (int side = 0; side < 2; ++side) {
      const double lift = within(collar_lift_);
      const double draw = within(collar_draw_);
      pose.collar[side] = Collar(side, lift, draw);
    }
    pose = PartLegs(pose);
  }
  return poses;
}

std::vector<Pose> JointLimits::LimitPoses() const {
  std::vector<Pose> poses;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    if (!limits_[joint] || MirrorJoint(joint) < joint) continue;
    const JointLimit& limit = *limits_[joint];
    const auto add = [&](double bend, double side, double twist) {
      Pose pose;
      pose.rotation[joint] = Rotation(joint, {bend, side, twist});
      poses.push_back(PartLegs(pose));
      if (joint != kLHip ||
          poses.back().rotation[joint].isApprox(pose.rotation[joint])) {
        return;
      }
      pose.rotation[kRHip] = Rotation(kRHip, {0, limit.side.high, 0});
      poses.push_back(PartLegs(pose));
    };
    const double diagonal = std::numbers::sqrt2 / 2;
    for (const double bend : {limit.bend.low, limit.bend.high}) {
      add(bend, 0, 0);
      for (const double side : {limit.side.low, limit.side.high}) {
        add(diagonal * bend, diagonal * side, 0);
      }
      for (const double twist : {limit.twist.low, limit.twist.high}) {
        add(bend, 0, twist);
      }
    }
    for (const double side : {limit.side.low, limit.side.high}) {
      add(0, side, 0);
      for (const double twist : {limit.twist.low, limit.twist.high}) {
        add(0, side, twist);
      }
    }
    for (const double twist : {limit.twist.low, limit.twist.high}) {
      add(0, 0, twist);
    }
  }
  return poses;
}

}  // namespace sweepfit
