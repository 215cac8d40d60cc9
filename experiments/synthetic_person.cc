// SPDX-License-Identifier: Apache-2.0
#include "experiments/synthetic_person.h"

#include <glog/logging.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "experiments/random.h"

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
// Height of the ankle joint above the sole, fraction of stature.
constexpr double kAnkleHeight = 0.046;

struct SideJoints {
  int shoulder, elbow, wrist, hand_end, hip, knee, ankle, foot_end;
  double sign;  // +1 left (+X)
  BodyGroup arm, leg;
};
constexpr std::array<SideJoints, 2> kSides = {{{kLShoulder,
                                                kLElbow,
                                                kLWrist,
                                                kLHandEnd,
                                                kLHip,
                                                kLKnee,
                                                kLAnkle,
                                                kLFootEnd,
                                                1,
                                                kLArmGroup,
                                                kLLegGroup},
                                               {kRShoulder,
                                                kRElbow,
                                                kRWrist,
                                                kRHandEnd,
                                                kRHip,
                                                kRKnee,
                                                kRAnkle,
                                                kRFootEnd,
                                                -1,
                                                kRArmGroup,
                                                kRLegGroup}}};

double Mix(double a, double b, double t) { return a + t * (b - a); }

// ---------------------------------------------------------------- posture

Matrix3d Turn(double degrees, const Vector3d& axis) {
  return Eigen::AngleAxisd(degrees * kDegree, axis).toRotationMatrix();
}

// Frame of an arm bone: rest x runs along the arm, z stays as near to
// `forward` as it can.
Matrix3d ArmFrame(double sign, const Vector3d& along, const Vector3d& forward) {
  Matrix3d frame;
  frame.col(0) = sign * along;
  frame.col(2) = (forward - along * along.dot(forward)).normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

// Frame of a leg bone: rest -y runs along the leg.
Matrix3d LegFrame(const Vector3d& along, const Vector3d& forward) {
  Matrix3d frame;
  frame.col(1) = -along;
  frame.col(2) = (forward - along * along.dot(forward)).normalized();
  frame.col(0) = frame.col(1).cross(frame.col(2));
  return frame;
}

void PlaceChild(const PersonShape& shape, int joint, PosedPerson* person) {
  const int parent = kJointParents[joint];
  person->joint_in_world[joint] =
      person->joint_in_world[parent] +
      person->world_from_joint[parent] * shape.rest_offset[joint];
}

void PoseTrunk(const PersonShape& shape, Random* random, PosedPerson* person) {
  const auto bend = [&](double pitch, double roll, double yaw) -> Matrix3d {
    return Turn(random->Spread(yaw), Vector3d::UnitY()) *
           Turn(random->Spread(pitch), Vector3d::UnitX()) *
           Turn(random->Spread(roll), Vector3d::UnitZ());
  };
  auto& frame = person->world_from_joint;
  person->joint_in_world[kRoot] = shape.rest_offset[kRoot];
  frame[kRoot] = bend(1, 0.7, 1);
  PlaceChild(shape, kSpine, person);
  frame[kSpine] = frame[kRoot] * bend(1.5, 1, 1.5);
  PlaceChild(shape, kNeck, person);
  frame[kNeck] = frame[kSpine] * bend(2, 1, 2);
  PlaceChild(shape, kHead, person);
  frame[kHead] = frame[kNeck] * bend(4, 2, 7);
  frame[kHeadEnd] = frame[kHead];
  PlaceChild(shape, kHeadEnd, person);
}

// Angle of the upper arm from the vertical, degrees.
double ArmAngle(const PersonShape& shape, const std::string& pose) {
  if (pose == "T") return 88;
  if (pose == "A") return 46;
  CHECK(pose == "N") << pose;
  // Hanging, but the hands clear of the hips.
  const double arm = std::abs(shape.rest_offset[kLElbow].x()) +
                     std::abs(shape.rest_offset[kLWrist].x());
  const double hip_breadth =
      shape.stature * (0.108 * shape.trunk_breadth + 0.022);
  const double clear =
      hip_breadth + 0.055 * shape.stature - shape.rest_offset[kLShoulder].x();
  return std::max(13.0, std::asin(std::min(0.5, clear / arm)) / kDegree);
}

void PoseArm(const PersonShape& shape,
             const SideJoints& side,
             double arm_angle,
             Random* random,
             PosedPerson* person) {
  auto& frame = person->world_from_joint;
  // A raised arm lifts its shoulder about the inner end of the collar bone.
  const double lift = 0.22 * std::max(0.0, arm_angle - 25);
  const Matrix3d collar =
      Turn(side.sign * lift + random->Spread(1), Vector3d::UnitZ());
  person->joint_in_world[side.shoulder] =
      person->joint_in_world[kNeck] +
      frame[kSpine] * collar * shape.rest_offset[side.shoulder];

  const double angle = (arm_angle + random->Spread(1.5)) * kDegree;
  const Vector3d trunk_forward = frame[kSpine].col(2);
  const Vector3d sideways(side.sign * std::sin(angle), -std::cos(angle), 0);
  const Vector3d upper =
      (sideways + random->Spread(0.05) * trunk_forward).normalized();
  frame[side.shoulder] = ArmFrame(side.sign, upper, trunk_forward);
  PlaceChild(shape, side.elbow, person);
  const double bend = random->Uniform(5, 20) * kDegree;
  const Vector3d fore =
      std::cos(bend) * upper + std::sin(bend) * frame[side.shoulder].col(2);
  frame[side.elbow] = ArmFrame(side.sign, fore, frame[side.shoulder].col(2));
  PlaceChild(shape, side.wrist, person);
  frame[side.wrist] = frame[side.elbow] *
                      Turn(random->Spread(5), Vector3d::UnitZ()) *
                      Turn(random->Spread(4), Vector3d::UnitY());
  PlaceChild(shape, side.hand_end, person);
  frame[side.hand_end] = frame[side.wrist];
}

// Both soles on the floor: the ankles are placed first, the knees follow from
// the lengths of thigh and shank.
void PoseLegs(const PersonShape& shape, Random* random, PosedPerson* person) {
  const double stature = shape.stature;
  std::array<Vector3d, 2> ankle;
  double root_above_ankle = stature;
  const double stance = random->Uniform(0.055, 0.095) * stature;
  const double step = random->Spread(0.012) * stature;
  for (int i = 0; i < 2; ++i) {
    const SideJoints& side = kSides[i];
    PlaceChild(shape, side.hip, person);
    const Vector3d& hip = person->joint_in_world[side.hip];
    ankle[i] = {side.sign * stance, 0, hip.z() + side.sign * step};
    const double reach = 0.997 * (shape.rest_offset[side.knee].norm() +
                                  shape.rest_offset[side.ankle].norm());
    const double drop =
        std::sqrt(reach * reach - std::pow(ankle[i].x() - hip.x(), 2) -
                  std::pow(ankle[i].z() - hip.z(), 2));
    root_above_ankle = std::min(
        root_above_ankle, drop - (hip.y() - person->joint_in_world[kRoot].y()));
  }
  const double floor = person->joint_in_world[kRoot].y() - root_above_ankle -
                       kAnkleHeight * stature;
  for (Vector3d& joint : person->joint_in_world) joint.y() -= floor;
  for (int i = 0; i < 2; ++i) {
    const SideJoints& side = kSides[i];
    auto& frame = person->world_from_joint;
    const Vector3d& hip = person->joint_in_world[side.hip];
    ankle[i].y() = kAnkleHeight * stature;
    const double toe_out = random->Uniform(5, 16) * side.sign;
    const Vector3d forward(
        std::sin(toe_out * kDegree), 0, std::cos(toe_out * kDegree));
    const double thigh = shape.rest_offset[side.knee].norm();
    const double shank = shape.rest_offset[side.ankle].norm();
    const Vector3d line = ankle[i] - hip;
    const double length = line.norm();
    const double along =
        (thigh * thigh - shank * shank + length * length) / (2 * length);
    const double out = std::sqrt(std::max(0.0, thigh * thigh - along * along));
    const Vector3d axis = line / length;
    const Vector3d knee_direction =
        (forward - axis * axis.dot(forward)).normalized();
    const Vector3d knee = hip + along * axis + out * knee_direction;
    frame[side.hip] = LegFrame((knee - hip).normalized(), forward);
    frame[side.knee] = LegFrame((ankle[i] - knee).normalized(), forward);
    frame[side.ankle] = LegFrame(-Vector3d::UnitY(), forward);
    frame[side.foot_end] = frame[side.ankle];
    person->joint_in_world[side.knee] = knee;
    person->joint_in_world[side.ankle] = ankle[i];
    PlaceChild(shape, side.foot_end, person);
  }
}

// ------------------------------------------------------------------- flesh

// Adds parts given in fractions of stature in the frames of the joints.
class PartBuilder {
 public:
  PartBuilder(double unit, PosedPerson* person)
      : unit_(unit), person_(person) {}

  Vector3d At(int joint, double x, double y, double z) const {
    return person_->joint_in_world[joint] +
           person_->world_from_joint[joint] * (unit_ * Vector3d(x, y, z));
  }

  // Tapered capsule between two world points, its section stretched by `axes`
  // in the bone's frame.
  void Limb(BodyGroup group,
            int bone,
            const Vector3d& a,
            double radius_a,
            const Vector3d& b,
            double radius_b,
            double blend,
            const Vector3d& axes = Vector3d::Ones()) {
    BodyPart part;
    part.bone = bone;
    part.a = a;
    part.radius_a = unit_ * radius_a;
    part.radius_b = unit_ * radius_b;
    part.stretched_from_world = axes.cwiseInverse().asDiagonal() *
                                person_->world_from_joint[bone].transpose();
    part.stretched_axis = part.stretched_from_world * (b - a);
    part.blend = unit_ * blend;
    person_->parts[group].push_back(part);
  }

  void Ellipsoid(BodyGroup group,
                 int bone,
                 const Vector3d& center,
                 const Vector3d& radii,
                 double blend) {
    Limb(group,
         bone,
         center,
         1 / unit_,
         center,
         1 / unit_,
         blend,
         unit_ * radii);
  }

 private:
  double unit_;
  PosedPerson* person_;
};

void AddTrunk(const PersonShape& shape, PosedPerson* person) {
  PartBuilder add(shape.stature, person);
  const double w = shape.trunk_breadth, d = shape.trunk_depth;
  const double female = 1 - shape.sex;
  const double fat = std::max(0.0, shape.body_mass_index / 22 - 1.05);
  add.Ellipsoid(kTrunkGroup,
                kRoot,
                add.At(kRoot, 0, 0.02, -0.004),
                {w * Mix(0.098, 0.092, shape.sex), 0.085, 0.066 * d},
                0);
  for (const SideJoints& side : kSides) {
    add.Ellipsoid(kTrunkGroup,
                  kRoot,
                  add.At(kRoot, side.sign * 0.046 * w, -0.012, -0.034 * d),
                  {0.050 * w, 0.056, 0.044 * d},
                  0.03);
  }
  add.Ellipsoid(
      kTrunkGroup,
      kSpine,
      add.At(kSpine, 0, 0.015, 0.003 + 0.045 * fat),
      {w * Mix(0.078, 0.086, shape.sex), 0.11, 0.058 * d + 0.05 * fat},
      0.06);
  add.Ellipsoid(kTrunkGroup,
                kSpine,
                add.At(kSpine, 0, 0.112, 0.0),
                {w * Mix(0.083, 0.092, shape.sex), 0.108, 0.064 * d},
                0.06);
  for (const SideJoints& side : kSides) {
    const double s = side.sign;
    const Vector3d& shoulder = person->joint_in_world[side.shoulder];
    // Shoulder girdle and the slope from neck to shoulder.
    add.Limb(kTrunkGroup,
             kSpine,
             add.At(kSpine, s * 0.02, 0.172, -0.008),
             0.042,
             0.85 * shoulder + 0.15 * add.At(kSpine, s * 0.02, 0.172, -0.008),
             0.031,
             0.03,
             {1, 1, 1.05});
    add.Limb(kTrunkGroup,
             kNeck,
             add.At(kNeck, s * 0.008, 0.022, -0.004),
             0.021,
             0.72 * shoulder + 0.28 * person->joint_in_world[kNeck],
             0.023,
             0.025);
    const double muscle = 0.012 + 0.012 * shape.sex * (1 - shape.childhood);
    add.Ellipsoid(kTrunkGroup,
                  kSpine,
                  add.At(kSpine, s * 0.042, 0.128, 0.050 * d),
                  {0.045, 0.036, muscle},
                  0.02);
    if (shape.bust > 0) {
      const double bust = shape.bust * female;
      add.Ellipsoid(kTrunkGroup,
                    kSpine,
                    add.At(kSpine, s * 0.042, 0.108, 0.046 * d + 0.008 * bust),
                    {0.038, 0.038, 0.014 + 0.024 * bust},
                    0.02);
    }
  }
  const double neck = Mix(0.0285, 0.0345, shape.sex) *
                      std::sqrt(shape.arm_girth) *
                      Mix(1, 0.95, shape.childhood);
  add.Limb(kTrunkGroup,
           kNeck,
           add.At(kNeck, 0, -0.015, 0.008),
           neck * 1.06,
           add.At(kHead, 0, 0.01, 0.004),
           neck * 0.95,
           0.025);
}

void AddHead(const PersonShape& shape, PosedPerson* person) {
  PartBuilder add(shape.stature * shape.head_scale, person);
  const auto at = [&](double x, double y, double z) {
    return add.At(kHead, x, y, z);
  };
  add.Ellipsoid(
      kTrunkGroup, kHead, at(0, 0.045, 0.004), {0.0435, 0.051, 0.056}, 0.012);
  add.Ellipsoid(
      kTrunkGroup, kHead, at(0, 0.008, 0.022), {0.036, 0.046, 0.036}, 0.02);
  add.Limb(kTrunkGroup,
           kHead,
           at(-0.008, -0.023, 0.044),
           0.0125,
           at(0.008, -0.023, 0.044),
           0.0125,
           0.015);
  add.Limb(kTrunkGroup,
           kHead,
           at(-0.018, 0.036, 0.049),
           0.008,
           at(0.018, 0.036, 0.049),
           0.008,
           0.01);
  add.Limb(kTrunkGroup,
           kHead,
           at(0, 0.028, 0.0575),
           0.0045,
           at(0, 0.010, 0.066),
           0.0078,
           0.006);
  add.Limb(kTrunkGroup,
           kHead,
           at(-0.009, -0.006, 0.0525),
           0.006,
           at(0.009, -0.006, 0.0525),
           0.006,
           0.006);
  for (const SideJoints& side : kSides) {
    add.Ellipsoid(kTrunkGroup,
                  kHead,
                  at(side.sign * 0.0435, 0.014, -0.006),
                  {0.0065, 0.018, 0.011},
                  0.005);
  }
  if (shape.long_hair) {
    add.Ellipsoid(
        kTrunkGroup, kHead, at(0, 0.012, -0.026), {0.044, 0.070, 0.036}, 0.02);
  }
}

void AddArm(const PersonShape& shape,
            const SideJoints& side,
            PosedPerson* person) {
  PartBuilder add(shape.stature, person);
  const double g = shape.arm_girth, s = side.sign;
  const BodyGroup arm = side.arm;
  const auto& joint = person->joint_in_world;
  const double elbow = 0.0238 * std::sqrt(g);
  add.Limb(arm,
           side.shoulder,
           add.At(side.shoulder, s * 0.008, 0, 0),
           0.0285 * g,
           joint[side.elbow],
           elbow,
           0);
  add.Ellipsoid(arm,
                side.shoulder,
                add.At(side.shoulder, s * 0.012, 0.004, 0),
                Vector3d(0.038, 0.031, 0.031) * g,
                0.02);
  add.Ellipsoid(arm,
                side.shoulder,
                add.At(side.shoulder, s * 0.085, 0, 0.005),
                {0.050, 0.0265 * g, 0.028 * g},
                0.02);
  add.Limb(arm,
           side.elbow,
           joint[side.elbow],
           elbow,
           joint[side.wrist],
           0.0162 * std::sqrt(g),
           0.012);
  add.Ellipsoid(arm,
                side.elbow,
                add.At(side.elbow, s * 0.042, 0, 0.003),
                {0.045, 0.0260 * g, 0.0275 * g},
                0.015);
  // A mitten of three merged fingers, and a thumb on the front side.
  const double scale =
      std::abs(shape.rest_offset[side.hand_end].x()) / (0.110 * shape.stature);
  PartBuilder hand(shape.stature * scale, person);
  const Vector3d flat(1, 0.72, 1);
  const auto at = [&](double x, double y, double z) {
    return hand.At(side.wrist, s * x, y, z);
  };
  const auto bone = [&](const Vector3d& a,
                        double radius_a,
                        const Vector3d& b,
                        double radius_b,
                        double blend) {
    hand.Limb(arm, side.wrist, a, radius_a, b, radius_b, blend, flat);
  };
  bone(at(0.000, 0, 0.006), 0.0145, at(0.050, 0, 0.013), 0.0125, 0.012);
  bone(at(0.000, 0, -0.004), 0.0145, at(0.048, 0, -0.012), 0.0125, 0.010);
  bone(at(0.050, 0, 0.014), 0.0100, at(0.097, -0.004, 0.010), 0.0075, 0.005);
  bone(at(0.050, 0, 0.000), 0.0105, at(0.103, -0.004, 0.000), 0.0078, 0.005);
  bone(at(0.048, 0, -0.012), 0.0100, at(0.090, -0.004, -0.010), 0.0072, 0.005);
  hand.Limb(arm,
            side.wrist,
            at(0.014, -0.003, 0.014),
            0.0110,
            at(0.046, -0.007, 0.037),
            0.0075,
            0.008);
}

void AddLeg(const PersonShape& shape,
            const SideJoints& side,
            PosedPerson* person) {
  PartBuilder add(shape.stature, person);
  const double g = shape.leg_girth, s = side.sign;
  const BodyGroup leg = side.leg;
  const auto& joint = person->joint_in_world;
  const double knee = 0.0300 * std::sqrt(g);
  add.Limb(leg,
           side.hip,
           add.At(side.hip, s * 0.004, -0.012, 0),
           g * Mix(0.054, 0.051, shape.sex),
           joint[side.knee],
           knee,
           0);
  add.Ellipsoid(leg,
                side.hip,
                add.At(side.hip, s * 0.004, -0.095, 0.008),
                {0.044 * g, 0.10, 0.046 * g},
                0.03);
  add.Limb(leg,
           side.knee,
           joint[side.knee],
           knee,
           add.At(side.ankle, 0, 0.012, -0.002),
           0.0190,
           0.015);
  add.Ellipsoid(leg,
                side.knee,
                add.At(side.knee, 0, 0.0, 0.008),
                Vector3d(0.024, 0.028, 0.0245),
                0.012);
  add.Ellipsoid(leg,
                side.knee,
                add.At(side.knee, s * 0.003, -0.068, -0.013),
                {0.0295 * g, 0.062, 0.031 * g},
                0.025);
  const double f = shape.foot_scale;
  const auto at = [&](double x, double y, double z) {
    return add.At(side.ankle, s * f * x, y, f * z);
  };
  add.Limb(leg,
           side.ankle,
           at(0, -0.024, -0.020),
           0.0215 * f,
           at(0, -0.030, 0.030),
           0.020 * f,
           0.012);
  add.Limb(leg,
           side.ankle,
           at(0, -0.004, 0.002),
           0.0235,
           at(0, -0.028, 0.072),
           0.017,
           0.012);
  add.Limb(leg,
           side.ankle,
           at(-0.016, -0.031, 0.074),
           0.0155 * f,
           at(0.016, -0.031, 0.068),
           0.0155 * f,
           0.012);
  add.Limb(leg,
           side.ankle,
           at(-0.010, -0.031, 0.078),
           0.0145 * f,
           at(-0.007, -0.033, 0.107),
           0.0120 * f,
           0.010);
  add.Limb(leg,
           side.ankle,
           at(0.014, -0.031, 0.068),
           0.0140 * f,
           at(0.011, -0.034, 0.095),
           0.0110 * f,
           0.010);
}

}  // namespace

std::array<Vector3d, kNumJoints> PersonShape::RestJoints() const {
  std::array<Vector3d, kNumJoints> joints;
  joints[kRoot] = rest_offset[kRoot];
  for (int j = 1; j < kNumJoints; ++j) {
    joints[j] = joints[kJointParents[j]] + rest_offset[j];
  }
  return joints;
}

double BodyPart::Distance(const Vector3d& p) const {
  const Vector3d ap = stretched_from_world * (p - a);
  const double length_squared = stretched_axis.squaredNorm();
  const double t =
      length_squared > 0
          ? std::clamp(ap.dot(stretched_axis) / length_squared, 0.0, 1.0)
          : 0.0;
  const Vector3d v = ap - t * stretched_axis;
  const double norm = v.norm();
  const double radius = radius_a + t * (radius_b - radius_a);
  // At the very axis any direction serves.
  const Vector3d direction =
      norm > 1e-9 ? Vector3d(v / norm) : Vector3d(Vector3d::UnitX());
  const double slope = (stretched_from_world.transpose() * direction).norm();
  return (norm - radius) / slope;
}

PersonShape DrawPersonShape(unsigned seed) {
  Random random(0x70657273ull * 1000003 + seed);
  PersonShape shape;
  const bool child = random.Chance(0.2);
  shape.sex = std::clamp(
      (random.Chance(0.5) ? 0.9 : 0.1) + random.Spread(0.08), 0.0, 1.0);
  if (child) {
    shape.stature = random.Uniform(1.2, 1.5);
    shape.childhood = (1.6 - shape.stature) / 0.4;
    shape.body_mass_index = 17 + random.Spread(1.3);
    shape.sex = Mix(0.5, shape.sex, 0.3);
  } else {
    shape.stature =
        std::clamp(Mix(1.64, 1.77, shape.sex) + random.Spread(0.07), 1.5, 2.0);
    shape.body_mass_index = 23.5 + random.Spread(3);
  }
  const double c = shape.childhood;
  // The girths below, dressed lightly, weigh what an index of 24.5 weighs.
  const double fat = shape.body_mass_index / 24.5;
  const auto vary = [&](double sigma) { return 1 + random.Spread(sigma); };
  shape.trunk_breadth = std::pow(fat, 0.35) * vary(0.03);
  shape.trunk_depth = std::pow(fat, 0.55) * vary(0.04);
  shape.arm_girth = std::pow(fat, 0.45) * vary(0.05);
  shape.leg_girth = std::pow(fat, 0.45) * vary(0.04);
  shape.bust = child ? 0 : random.Uniform(0.4, 1.1) * (shape.sex < 0.5);
  shape.foot_scale = vary(0.03);
  shape.long_hair = random.Chance(shape.sex < 0.5 ? 0.7 : 0.05);
  shape.head_scale = Mix(1, 1.26, c) * vary(0.025);

  // Heights along the body before they are scaled to the stature.
  const double leg = Mix(1, 0.93, c) * vary(0.02);
  const double thigh = 0.238 * leg * vary(0.02);
  const double shank = 0.238 * leg * vary(0.02);
  const double lumbar = 0.095 * vary(0.05), chest = 0.224 * vary(0.03);
  const double neck = 0.062 * vary(0.06), head = 0.096 * shape.head_scale;
  const double unit = shape.stature / (kAnkleHeight + shank + thigh + lumbar +
                                       chest + neck + head);
  // Parts are measured in statures, so the head keeps its size against them.
  shape.head_scale *= unit / shape.stature;
  const double arm = vary(0.025);
  const double upper_arm = Mix(0.160, 0.165, shape.sex) * arm * vary(0.02);
  const double forearm = Mix(0.142, 0.149, shape.sex) * arm * vary(0.02);
  const double hand = 0.110 * arm * vary(0.02);
  const double shoulder = Mix(0.092, 0.106, shape.sex) * vary(0.03) *
                          std::pow(shape.trunk_breadth, 0.3);
  const double hip = Mix(0.052, 0.049, shape.sex) * vary(0.03);

  auto& offset = shape.rest_offset;
  offset[kRoot] = {0, kAnkleHeight * shape.stature / unit + shank + thigh, 0};
  offset[kSpine] = {0, lumbar, 0.004};
  offset[kNeck] = {0, chest, -0.020};
  offset[kHead] = {0, neck, 0.022};
  offset[kHeadEnd] = {0, head, 0};
  for (const SideJoints& side : kSides) {
    const double s = side.sign;
    offset[side.shoulder] = {s * shoulder, -0.040, 0.012};
    offset[side.elbow] = {s * upper_arm, 0, 0};
    offset[side.wrist] = {s * forearm, 0, 0};
    offset[side.hand_end] = {s * hand, 0, 0};
    offset[side.hip] = {s * hip, 0, 0};
    offset[side.knee] = {0, -thigh, 0};
    offset[side.ankle] = {0, -shank, 0};
    offset[side.foot_end] = {
        -s * 0.007 * shape.foot_scale, -0.033, 0.118 * shape.foot_scale};
  }
  for (Vector3d& o : offset) o *= unit;
  return shape;
}

PosedPerson PosePerson(const PersonShape& shape,
                       const std::string& pose,
                       unsigned seed) {
  Random random(0x706f7365ull * 1000003 + 31 * seed + pose[0]);
  PosedPerson person;
  person.world_from_joint.fill(Matrix3d::Identity());
  person.joint_in_world.fill(Vector3d::Zero());
  PoseTrunk(shape, &random, &person);
  const double arm_angle = ArmAngle(shape, pose);
  for (const SideJoints& side : kSides) {
    PoseArm(shape, side, arm_angle, &random, &person);
  }
  PoseLegs(shape, &random, &person);
  AddTrunk(shape, &person);
  AddHead(shape, &person);
  for (const SideJoints& side : kSides) {
    AddArm(shape, side, &person);
    AddLeg(shape, side, &person);
  }
  return person;
}

}  // namespace sweepfit
