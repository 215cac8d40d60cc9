// SPDX-License-Identifier: Apache-2.0
#include "model/retarget.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <map>
#include <numbers>

#include "model/foot_lock.h"
#include "model/input_error.h"
#include "model/joint_limits.h"
#include "model/joint_names.h"
#include "model/smooth_step.h"

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

Matrix3d SmallestRotation(const Vector3d& from, const Vector3d& to) {
  return Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
}

// ------------------------------------------------------------- the source

// The source's hierarchy with our joints found in it.
class Hierarchy {
 public:
  Hierarchy(const BvhMotion& motion,
            const RetargetOptions& options,
            const std::string& source)
      : motion_(motion), source_(source) {
    std::vector<std::string> names;
    for (const BvhJoint& joint : motion.joints) names.push_back(joint.name);
    match_ = MatchJointNames(names, options.names, source);
    CheckOrder();
    chest_ = CommonAncestor(at(kLShoulder), at(kRShoulder));
    if (at(kSpine) >= 0 && !IsBelowOrSame(chest_, at(kSpine))) {
      Fail(kSpine, "is not between root and shoulders");
    }
  }

  const std::string& map_name() const { return match_.map; }
  // The source joint that is ours, or -1.
  int at(int joint) const { return match_.index[joint]; }
  // The last joint that carries both arms.
  int chest() const { return chest_; }
  int parent(int index) const { return motion_.joints[index].parent; }

  bool IsBelowOrSame(int index, int ancestor) const {
    while (index > ancestor) index = parent(index);
    return index == ancestor;
  }

 private:
  [[noreturn]] void Fail(int joint, const std::string& what) const {
    throw InputError(source_ + ": '" + motion_.joints[at(joint)].name +
                     "', mapped to " + std::string(kJointNames[joint]) + ", " +
                     what);
  }

  void CheckOrder() const {
    for (int joint = 0; joint < kNumJoints; ++joint) {
      if (joint == kRoot || at(joint) < 0) continue;
      int above = kJointParents[joint];
      // Arms may branch off below the neck.
      if (joint == kLShoulder || joint == kRShoulder || at(above) < 0) {
        above = kRoot;
      }
      if (at(joint) == at(above) || !IsBelowOrSame(at(joint), at(above))) {
        Fail(joint,
             "does not hang on '" + motion_.joints[at(above)].name +
                 "', mapped to " + std::string(kJointNames[above]));
      }
    }
  }

  int CommonAncestor(int a, int b) const {
    while (a != b) (a > b ? a : b) = parent(a > b ? a : b);
    return a;
  }

  const BvhMotion& motion_;
  const std::string& source_;
  JointMatch match_;
  int chest_ = -1;
};

// What carries a bone of ours in the source: it runs from joint `from` to a
// point that is fixed to joint `to`, and turns with joint `turns`.
struct SourceBone {
  int from = -1;
  int to = -1;
  Vector3d point_in_to = Vector3d::Zero();  // in the world at rest
  int turns = -1;
  Vector3d rest_chord = Vector3d::Zero();  // zero: no direction
  Matrix3d ours_from_source_at_rest = Matrix3d::Identity();  // A_j
};

// One frame of the source in our axes.
struct SourceFrame {
  std::vector<Matrix3d> turn;  // against the rest pose, in the world
  std::vector<Vector3d> position;
};

class Source {
 public:
  Source(const BvhMotion& motion,
         const Skeleton& skeleton,
         const RetargetOptions& options,
         const std::string& source,
         std::vector<std::string>* notes)
      : motion_(motion),
        skeleton_(skeleton),
        hierarchy_(motion, options, source) {
    FindVertical(notes);
    rest_ = BvhRestFrames(motion).joint_in_world;
    for (Vector3d& position : rest_) position = ours_from_file_ * position;
    leg_length_ = ChainLength({kLHip, kLKnee, kLAnkle}) / 2 +
                  ChainLength({kRHip, kRKnee, kRAnkle}) / 2;
    if (!(leg_length_ > 0)) {
      throw InputError(source + ": the legs have no length");
    }
    AlignAtRest(notes);
    for (int joint = 0; joint < kNumJoints; ++joint) MakeBone(joint);
  }

  const Hierarchy& hierarchy() const { return hierarchy_; }
  double leg_length() const { return leg_length_; }

  SourceFrame FrameAt(int frame) const {
    const BvhFrames frames = BvhFramesAt(motion_, frame);
    SourceFrame result;
    for (std::size_t k = 0; k < motion_.joints.size(); ++k) {
      result.turn.push_back(ours_from_file_ * frames.world_from_joint[k] *
                            ours_from_file_.transpose());
      result.position.push_back(ours_from_file_ * frames.joint_in_world[k]);
    }
    return result;
  }

  // Orientation in the world of our joints; of ends that of their parents.
  std::array<Matrix3d, kNumJoints> Orientations(
      const SourceFrame& frame) const {
    std::array<Matrix3d, kNumJoints> orientation;
    for (int joint = 0; joint < kNumJoints; ++joint) {
      const SourceBone& bone = bones_[joint];
      if (bone.turns < 0) {
        orientation[joint] = orientation[kJointParents[joint]];
        continue;
      }
      orientation[joint] =
          frame.turn[bone.turns] * bone.ours_from_source_at_rest.transpose();
      if (bone.rest_chord.isZero()) continue;
      const Vector3d carried = frame.turn[bone.turns] * bone.rest_chord;
      const Vector3d chord = frame.position[bone.to] +
                             frame.turn[bone.to] * bone.point_in_to -
                             frame.position[bone.from];
      if (chord.norm() < kShort * leg_length_) continue;
      orientation[joint] =
          SmallestRotation(carried, chord) * orientation[joint];
    }
    return orientation;
  }

  // How the collar has turned the shoulder about: the direction of our collar
  // bone in the world.
  Vector3d CollarDirection(const SourceFrame& frame, int shoulder) const {
    const int collar = std::max(hierarchy_.parent(hierarchy_.at(shoulder)),
                                hierarchy_.chest());
    return frame.turn[collar] * alignment_.transpose() *
           skeleton_.rest_direction[shoulder];
  }

  Vector3d HipCenter(const SourceFrame& frame) const {
    return (frame.position[hierarchy_.at(kLHip)] +
            frame.position[hierarchy_.at(kRHip)]) /
           2;
  }

 private:
  static constexpr double kShort = 1e-4;  // leg lengths: no direction below

  // The axis, 0 to 2, along which a direction mostly points, with its sign in
  // 1 or -1; axis -1 when it is oblique.
  struct SignedAxis {
    int axis = -1;
    double sign = 1;
  };
  static SignedAxis MainAxis(const Vector3d& direction) {
    constexpr double kMostly = 0.75;
    SignedAxis main;
    if (direction.normalized().cwiseAbs().maxCoeff(&main.axis) < kMostly) {
      return {};
    }
    main.sign = direction[main.axis] < 0 ? -1 : 1;
    return main;
  }

  // A rotation by multiples of 90 degrees that makes the vertical of the file
  // our +Y. The vertical is Y when the skeleton stands along Y at rest (someone
  // may lie down) or in the motion (a skeleton may rest in any direction), else
  // the axis along which the person mostly stands.
  void FindVertical(std::vector<std::string>* notes) {
    const auto up_of = [this](const std::vector<Vector3d>& position) {
      return Vector3d(
          position[hierarchy_.at(kNeck)] -
          (position[hierarchy_.at(kLHip)] + position[hierarchy_.at(kRHip)]) /
              2);
    };
    constexpr int kSamples = 50;
    const int step = std::max(1, motion_.num_frames() / kSamples);
    Vector3d up = Vector3d::Zero();
    for (int frame = 0; frame < motion_.num_frames(); frame += step) {
      up += up_of(BvhFramesAt(motion_, frame).joint_in_world).normalized();
    }
    const SignedAxis at_rest =
        MainAxis(up_of(BvhRestFrames(motion_).joint_in_world));
    const SignedAxis moving = MainAxis(up);
    const auto is_y = [](const SignedAxis& a) {
      return a.axis == 1 && a.sign > 0;
    };
    if (is_y(at_rest) || is_y(moving) || moving.axis < 0) return;
    if (moving.axis == 1) {
      ours_from_file_ = Eigen::AngleAxisd(std::numbers::pi, Vector3d::UnitX());
    } else {
      ours_from_file_ = SmallestRotation(
          moving.sign * Vector3d::Unit(moving.axis), Vector3d::UnitY());
    }
    notes->push_back(std::string("the motion's vertical axis is ") +
                     (moving.sign < 0 ? "-" : "+") + "XYZ"[moving.axis] +
                     "; it was turned to +Y");
  }

  double ChainLength(const std::vector<int>& joints) const {
    double length = 0;
    for (std::size_t i = 1; i < joints.size(); ++i) {
      length += (RestOf(joints[i]) - RestOf(joints[i - 1])).norm();
    }
    return length;
  }

  const Vector3d& RestOf(int joint) const {
    return rest_[hierarchy_.at(joint)];
  }

  // Left to right and up, orthonormal.
  static Matrix3d TrunkFrame(const Vector3d& l_hip,
                             const Vector3d& r_hip,
                             const Vector3d& neck) {
    Matrix3d frame;
    frame.col(0) = (l_hip - r_hip).normalized();
    // Those who stand at rest stand upright, however the neck leans.
    Vector3d up = neck - (l_hip + r_hip) / 2;
    const SignedAxis main = MainAxis(up);
    if (main.axis >= 0) up = main.sign * Vector3d::Unit(main.axis);
    frame.col(1) = (up - up.dot(frame.col(0)) * frame.col(0)).normalized();
    frame.col(2) = frame.col(0).cross(frame.col(1));
    return frame;
  }

  // Turns the source's rest pose until it stands and faces like ours.
  void AlignAtRest(std::vector<std::string>* notes) {
    const auto ours = RestFrames(skeleton_).joint_in_world;
    alignment_ =
        TrunkFrame(ours[kLHip], ours[kRHip], ours[kNeck]) *
        TrunkFrame(RestOf(kLHip), RestOf(kRHip), RestOf(kNeck)).transpose();
    if (!alignment_.allFinite()) alignment_.setIdentity();
    Vector3d feet = Vector3d::Zero();
    for (const int ankle : {kLAnkle, kRAnkle}) {
      const int toe = EndOf(ankle);
      if (toe >= 0) feet += alignment_ * (rest_[toe] - RestOf(ankle));
    }
    if (feet.z() < -0.5 * feet.norm() && feet.norm() > kShort * leg_length_) {
      notes->push_back(
          "at rest the feet point backwards: are left and right exchanged in "
          "the map of joint names?");
    }
  }

  // Where the bone that starts at an end of the body ends: the mapped joint, or
  // the first below that lies elsewhere; -1: nowhere.
  int EndOf(int joint) const {
    const int start = hierarchy_.at(joint);
    const auto elsewhere = [&](int index) {
      return (rest_[index] - rest_[start]).norm() > kShort * leg_length_;
    };
    const int mapped = hierarchy_.at(joint + 1);
    if (mapped >= 0 && elsewhere(mapped)) return mapped;
    for (int index = start + 1; index < static_cast<int>(rest_.size());
         ++index) {
      if (hierarchy_.IsBelowOrSame(index, start) && elsewhere(index)) {
        return index;
      }
    }
    return -1;
  }

  // As in our skeleton; others branch below the neck.
  bool ArmsHangOnNeck() const {
    return hierarchy_.IsBelowOrSame(hierarchy_.chest(), hierarchy_.at(kNeck));
  }

  void MakeBone(int joint) {
    SourceBone& bone = bones_[joint];
    const Hierarchy& h = hierarchy_;
    int bone_end = joint + 1;  // the joint that ends our bone
    switch (joint) {
      case kHeadEnd:
      case kLHandEnd:
      case kRHandEnd:
      case kLFootEnd:
      case kRFootEnd:
        return;  // turns < 0: as the parent
      case kRoot:
        bone.turns = h.at(kRoot);
        bone.ours_from_source_at_rest = alignment_;
        return;
      case kSpine:
        bone.from = h.at(h.at(kSpine) >= 0 ? kSpine : kRoot);
        if (ArmsHangOnNeck()) {
          bone.to = h.at(kNeck);
          bone.turns = h.parent(bone.to);
          break;
        }
        // To the middle of the shoulders as the chest carries it.
        bone.to = bone.turns = h.chest();
        bone.point_in_to =
            (RestOf(kLShoulder) + RestOf(kRShoulder)) / 2 - rest_[h.chest()];
        break;
      case kNeck:
        bone.from = h.at(kNeck);
        bone.to = h.at(kHead);
        bone.turns = ArmsHangOnNeck() ? h.parent(bone.to) : h.chest();
        break;
      case kHead:
      case kLWrist:
      case kRWrist:
      case kLAnkle:
      case kRAnkle:
        bone.from = bone.turns = h.at(joint);
        bone.to = EndOf(joint);
        break;
      default:
        bone.from = h.at(joint);
        bone.to = h.at(bone_end);
        bone.turns = h.parent(bone.to);
    }
    if (bone.to >= 0) {
      bone.rest_chord = rest_[bone.to] + bone.point_in_to - rest_[bone.from];
      if (bone.rest_chord.norm() < kShort * leg_length_) {
        bone.rest_chord.setZero();
      }
    }
    bone.ours_from_source_at_rest =
        RestRotation(joint, skeleton_.rest_direction[bone_end]);
    // The head's and the foot's direction is that of the joint.
    if (joint == kHead || joint == kLAnkle || joint == kRAnkle) {
      bone.rest_chord.setZero();
    }
  }

  // A_j.
  Matrix3d RestRotation(int joint, const Vector3d& our_direction) const {
    const Vector3d chord = alignment_ * bones_[joint].rest_chord;
    const bool trunk = joint == kSpine || joint == kNeck || joint == kHead;
    if (chord.isZero()) {
      return trunk || joint == kLAnkle || joint == kRAnkle
                 ? alignment_
                 : bones_[kJointParents[joint]].ours_from_source_at_rest;
    }
    const Matrix3d smallest =
        SmallestRotation(chord, our_direction) * alignment_;
    if (trunk) {
      constexpr double kSamePosture = 30 * kDegree;
      const double angle = std::atan2(chord.cross(our_direction).norm(),
                                      chord.dot(our_direction));
      return angle < kSamePosture ? alignment_ : smallest;
    }
    if (joint == kLAnkle || joint == kRAnkle) {
      const Vector3d level(1, 0, 1);
      const Vector3d theirs = chord.normalized().cwiseProduct(level);
      const Vector3d ours = our_direction.cwiseProduct(level);
      constexpr double kPointing = 0.3;
      if (theirs.norm() < kPointing || ours.norm() < kPointing) {
        return smallest;
      }
      return SmallestRotation(theirs, ours) * alignment_;
    }
    return smallest;
  }

  const BvhMotion& motion_;
  const Skeleton& skeleton_;
  Hierarchy hierarchy_;
  Matrix3d ours_from_file_ = Matrix3d::Identity();
  std::vector<Vector3d> rest_;  // in our axes, file units
  double leg_length_ = 0;
  Matrix3d alignment_ = Matrix3d::Identity();
  std::array<SourceBone, kNumJoints> bones_;
};

// ---------------------------------------------------------- hinges, wrists

// Turns the upper bone about itself until the lower one bends about its hinge.
// Where the limb is nearly straight, that angle means nothing: there it follows
// from the frames around, and from the source.
void BendAboutHinges(const Skeleton& skeleton,
                     const JointLimits& limits,
                     int upper,
                     double frame_time,
                     std::vector<Pose>* poses) {
  const int lower = upper + 1;
  if (!limits.limit(lower)) return;
  const Vector3d& along = skeleton.rest_direction[lower];
  const Vector3d hinge = (limits.limit(lower)->bend_axis -
                          limits.limit(lower)->bend_axis.dot(along) * along)
                             .normalized();
  const Vector3d flexed = hinge.cross(along);  // where a flexed bone points
  const int num = static_cast<int>(poses->size());
  std::vector<std::complex<double>> wanted(num);  // weight e^(i angle)
  std::vector<double> angle(num), sure(num);
  for (int t = 0; t < num; ++t) {
    const Vector3d bone =
        (*poses)[t].rotation[lower] * skeleton.rest_direction[lower + 1];
    const double x = bone.dot(flexed), y = bone.dot(hinge);
    angle[t] = std::atan2(y, x);
    const double bend = std::atan2(std::hypot(x, y), bone.dot(along));
    // A limb bent a little backwards overextends rather than turns about; a
    // knee always.
    const double least = x > 0                              ? 8
                         : upper == kLHip || upper == kRHip ? 360
                                                            : 30;
    if (x <= 0 && bend < least * kDegree) continue;
    wanted[t] = std::polar(x * x + y * y, angle[t]);
    sure[t] = SmoothStep((bend / kDegree - least) / 17);
  }
  constexpr double kSigma = 0.05;  // seconds
  constexpr double kSourceWeight = 0.01;
  const int reach = std::max(1, static_cast<int>(3 * kSigma / frame_time));
  for (int t = 0; t < num; ++t) {
    std::complex<double> sum = 0;
    for (int k = std::max(0, t - reach); k <= std::min(num - 1, t + reach);
         ++k) {
      const double z = (k - t) * frame_time / kSigma;
      sum += std::exp(-0.5 * z * z) * (wanted[k] + kSourceWeight);
    }
    const double smooth = std::arg(sum);
    const double twist =
        smooth +
        sure[t] * std::remainder(angle[t] - smooth, 2 * std::numbers::pi);
    const Quaterniond turn(Eigen::AngleAxisd(twist, along));
    Pose& pose = (*poses)[t];
    pose.rotation[upper] = pose.rotation[upper] * turn;
    pose.rotation[lower] = turn.conjugate() * pose.rotation[lower];
  }
}

// The turn of a pose's joint about a direction.
Quaterniond TwistAbout(const Vector3d& along, const Quaterniond& rotation) {
  Quaterniond twist(rotation.w(), 0, 0, 0);
  twist.vec() = rotation.vec().dot(along) * along;
  if (twist.norm() < 1e-6) return Quaterniond::Identity();
  twist.normalize();
  if (twist.w() < 0) twist.coeffs() *= -1;
  return twist;
}

// Toes that point outwards do so by the shank as much as by the ankle: half of
// the foot's turn about the shank goes to the knee.
void TurnShank(const Skeleton& skeleton, int ankle, Pose* pose) {
  Quaterniond& foot = pose->rotation[ankle];
  const Quaterniond half = Quaterniond::Identity().slerp(
      0.5, TwistAbout(skeleton.rest_direction[ankle], foot));
  pose->rotation[ankle - 1] = pose->rotation[ankle - 1] * half;
  foot = half.conjugate() * foot;
}

// A wrist does not twist: the forearm does.
void TwistForearm(const Skeleton& skeleton, int wrist, Pose* pose) {
  Quaterniond& hand = pose->rotation[wrist];
  const Quaterniond twist = TwistAbout(skeleton.rest_direction[wrist], hand);
  pose->rotation[wrist - 1] = pose->rotation[wrist - 1] * twist;
  hand = twist.conjugate() * hand;
}

// ----------------------------------------------------------------- limits

// Clamps postures and remembers which joints had to be.
class LimitKeeper {
 public:
  explicit LimitKeeper(const JointLimits& limits) : limits_(limits) {}

  void Keep(bool clamp, std::vector<Pose>* poses) {
    constexpr double kTolerance = 0.1 * kDegree;
    for (std::size_t t = 0; t < poses->size(); ++t) {
      for (const LimitViolation& violation :
           limits_.Violations((*poses)[t], kTolerance)) {
        Excess& excess = excess_[{violation.joint, violation.angle}];
        excess.most = std::max(excess.most, violation.excess);
        if (excess.frames.empty() || excess.frames.back() != t) {
          excess.frames.push_back(t);
        }
      }
      if (clamp) (*poses)[t] = limits_.Clamp((*poses)[t]);
    }
  }

  std::vector<std::string> Notes(bool clamped) const {
    std::vector<std::string> notes;
    for (const auto& [key, excess] : excess_) {
      std::vector<std::size_t> frames = excess.frames;
      std::sort(frames.begin(), frames.end());
      frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
      char number[32];
      std::snprintf(number, sizeof(number), "%.1f", excess.most / kDegree);
      notes.push_back(
          std::string(kJointNames[key.first]) + ": " + key.second +
          (clamped ? " held at its limit, up to "
                   : " leaves its limit by up to ") +
          number +
          (clamped ? " degrees short of the motion, in " : " degrees in ") +
          std::to_string(frames.size()) + " frames");
    }
    return notes;
  }

 private:
  struct Excess {
    double most = 0;
    std::vector<std::size_t> frames;
  };
  const JointLimits& limits_;
  std::map<std::pair<int, std::string>, Excess> excess_;
};

// ------------------------------------------------------------------ whole

Pose PoseOf(const Skeleton& skeleton,
            const Source& source,
            const SourceFrame& frame) {
  Pose pose;
  const auto orientation = source.Orientations(frame);
  pose.rotation[kRoot] = Quaterniond(orientation[kRoot]);
  for (int joint = 1; joint < kNumJoints; ++joint) {
    pose.rotation[joint] =
        Quaterniond(orientation[kJointParents[joint]].transpose() *
                    orientation[joint])
            .normalized();
  }
  for (int side = 0; side < 2; ++side) {
    const int shoulder = side == 0 ? kLShoulder : kRShoulder;
    pose.collar[side] = Quaterniond::FromTwoVectors(
        skeleton.rest_direction[shoulder],
        orientation[kNeck].transpose() *
            source.CollarDirection(frame, shoulder));
  }
  return pose;
}

double LegLength(const Skeleton& skeleton) {
  return (skeleton.length[kLKnee] + skeleton.length[kLAnkle] +
          skeleton.length[kRKnee] + skeleton.length[kRAnkle]) /
         2;
}

double Percentile(std::vector<double> values, double share) {
  const auto nth =
      values.begin() + static_cast<std::ptrdiff_t>(share * (values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

// Points of the feet over the frames.
struct FootTracks {
  std::array<std::vector<Vector3d>, 2> heel, ball;
};

FootTracks TracksOf(const Skeleton& skeleton,
                    const std::array<FootShape, 2>& feet,
                    const std::vector<Pose>& poses) {
  FootTracks tracks;
  for (const Pose& pose : poses) {
    const auto points = FootPointsOf(ForwardKinematics(skeleton, pose), feet);
    for (int side = 0; side < 2; ++side) {
      tracks.heel[side].push_back(points[side].heel);
      tracks.ball[side].push_back(points[side].ball);
    }
  }
  return tracks;
}

// When our feet stand, put on the source's ankles, as the source turns them.
std::array<FootContact, 2> FindContacts(
    const Skeleton& skeleton,
    const std::array<FootShape, 2>& feet,
    const std::array<std::vector<Vector3d>, 2>& ankle_of_source,
    double frame_time,
    const std::vector<Pose>& poses) {
  FootTracks tracks;
  for (std::size_t t = 0; t < poses.size(); ++t) {
    const auto orientation =
        ForwardKinematics(skeleton, poses[t]).world_from_joint;
    for (int side = 0; side < 2; ++side) {
      const Matrix3d& foot = orientation[side == 0 ? kLAnkle : kRAnkle];
      const Vector3d& ankle = ankle_of_source[side][t];
      tracks.heel[side].push_back(ankle + foot * feet[side].heel);
      tracks.ball[side].push_back(ankle + foot * feet[side].ball);
    }
  }
  const double leg = LegLength(skeleton);
  std::array<FootContact, 2> contact;
  // Coming down and lifting, a foot is faster than while it stands.
  constexpr double kComing = 0.6;  // leg lengths per second
  for (int side = 0; side < 2; ++side) {
    FootContact& of_side = contact[side];
    of_side.heel = FindStanding(tracks.heel[side], frame_time, leg);
    of_side.ball = FindStanding(tracks.ball[side], frame_time, leg);
    of_side.stance = FindStanding(tracks.heel[side], frame_time, leg, kComing);
    const std::vector<bool> ball =
        FindStanding(tracks.ball[side], frame_time, leg, kComing);
    for (std::size_t t = 0; t < poses.size(); ++t) {
      of_side.stance[t] =
          of_side.stance[t] || ball[t] || of_side.heel[t] || of_side.ball[t];
    }
  }
  return contact;
}

// Skeletons do not say where the sole of a foot is, but a foot that stands on
// heel and ball is level: turns each foot, the same in all frames, until it is
// so on average. False when nothing was turned.
bool LevelFeet(const Skeleton& skeleton,
               const std::array<FootContact, 2>& contact,
               std::vector<Pose>* poses) {
  bool turned = false;
  for (int side = 0; side < 2; ++side) {
    const int ankle = side == 0 ? kLAnkle : kRAnkle;
    Vector3d up_in_foot = Vector3d::Zero();
    for (std::size_t t = 0; t < poses->size(); ++t) {
      if (!contact[side].heel[t] || !contact[side].ball[t]) continue;
      up_in_foot += ForwardKinematics(skeleton, (*poses)[t])
                        .world_from_joint[ankle]
                        .row(1)
                        .transpose();
    }
    constexpr double kSole = 40 * kDegree;  // more is no matter of definition
    if (up_in_foot.y() <= std::cos(kSole) * up_in_foot.norm() ||
        up_in_foot.isZero()) {
      continue;
    }
    const Quaterniond level =
        Quaterniond::FromTwoVectors(Vector3d::UnitY(), up_in_foot);
    for (Pose& pose : *poses) {
      pose.rotation[ankle] = pose.rotation[ankle] * level;
    }
    turned = true;
  }
  return turned;
}

// Sets the body on the floor: feet that stand are at y = 0 on average. Floors
// of motion capture may slope a little (1.7 degrees in the CMU database); where
// the standing feet tell so, the slope is taken away. Returns it, radians.
double StandOnFloor(const FootTracks& tracks,
                    const std::array<FootContact, 2>& contact,
                    std::vector<Pose>* poses) {
  std::vector<Vector3d> standing;
  std::vector<double> lowest;
  for (int side = 0; side < 2; ++side) {
    for (std::size_t t = 0; t < poses->size(); ++t) {
      const Vector3d& heel = tracks.heel[side][t];
      const Vector3d& ball = tracks.ball[side][t];
      if (contact[side].heel[t]) standing.push_back(heel);
      if (contact[side].ball[t]) standing.push_back(ball);
      lowest.push_back(std::min(heel.y(), ball.y()));
    }
  }
  if (standing.empty()) {
    const double floor = Percentile(lowest, 0.05);
    for (Pose& pose : *poses) pose.root_in_world.y() -= floor;
    return 0;
  }
  Vector3d center = Vector3d::Zero();
  for (const Vector3d& point : standing) center += point;
  center /= static_cast<double>(standing.size());
  // y = slope . (x, z), least squares; slopes are near 0 unless feet tell.
  constexpr double kSigmaHeight = 0.02, kSigmaSlope = 0.03;
  constexpr double kEvidence = 10;  // independent footfalls in any motion
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (const Vector3d& point : standing) {
    const Vector3d offset = point - center;
    const Eigen::Vector2d across(offset.x(), offset.z());
    normal += across * across.transpose();
    right += across * offset.y();
  }
  const double share = kEvidence / static_cast<double>(standing.size());
  normal *= share;
  right *= share;
  normal.diagonal().array() += std::pow(kSigmaHeight / kSigmaSlope, 2);
  Eigen::Vector2d slope = normal.ldlt().solve(right);
  constexpr double kSteepest = 4 * kDegree;  // beyond it is a ramp, or stairs
  if (slope.norm() > std::tan(kSteepest)) slope.setZero();
  for (Pose& pose : *poses) {
    const Vector3d offset = pose.root_in_world - center;
    pose.root_in_world.y() -=
        center.y() + slope.dot(Eigen::Vector2d(offset.x(), offset.z()));
  }
  return std::atan(slope.norm());
}

Pose Between(const Pose& a, const Pose& b, double t) {
  Pose pose;
  pose.root_in_world = (1 - t) * a.root_in_world + t * b.root_in_world;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    pose.rotation[joint] = a.rotation[joint].slerp(t, b.rotation[joint]);
  }
  for (int side = 0; side < 2; ++side) {
    pose.collar[side] = a.collar[side].slerp(t, b.collar[side]);
  }
  return pose;
}

void Resample(const std::vector<Pose>& poses,
              double source_frame_time,
              double frames_per_second,
              RetargetResult* result) {
  result->frame_time = 1 / frames_per_second;
  const double duration = source_frame_time * (poses.size() - 1.0);
  const int last =
      static_cast<int>(std::floor(duration * frames_per_second + 1e-3));
  for (int i = 0; i <= last; ++i) {
    const double at = std::min(i / (frames_per_second * source_frame_time),
                               poses.size() - 1.0);
    const std::size_t before = static_cast<std::size_t>(at);
    const std::size_t after = std::min(before + 1, poses.size() - 1);
    const double between = at - static_cast<double>(before);
    // Frames that are in the source are taken as they are.
    result->poses.push_back(
        between < 1e-6 ? poses[before]
                       : Between(poses[before], poses[after], between));
    result->time.push_back(i / frames_per_second);
  }
}

}  // namespace

std::optional<std::string> RetargetOptions::Check() const {
  if (!(scale >= 0) || !std::isfinite(scale)) {
    return "scale must be positive, or 0 for the ratio of leg lengths";
  }
  if (!(start >= 0) || !std::isfinite(start)) return "start is negative";
  if (!(end > start)) return "end must lie after start";
  if (!(frames_per_second >= 0) || frames_per_second > 1000) {
    return "frames per second must be within 0 and 1000";
  }
  return std::nullopt;
}

RetargetResult Retarget(const BvhMotion& motion,
                        const Body& body,
                        const RetargetOptions& options,
                        const std::string& source_name) {
  if (const auto error = options.Check()) throw InputError(*error);
  const Skeleton& skeleton = body.skeleton;
  RetargetResult result;
  const Source source(motion, skeleton, options, source_name, &result.notes);
  result.names = source.hierarchy().map_name();
  const double by_legs = LegLength(skeleton) / source.leg_length();
  result.metres_per_unit = options.scale > 0 ? options.scale : by_legs;
  const Vector3d scale(result.metres_per_unit, by_legs, result.metres_per_unit);

  constexpr double kRounding = 1e-6;
  std::vector<int> frames;
  for (int frame = 0; frame < motion.num_frames(); ++frame) {
    const double time = frame * motion.frame_time;
    if (time >= options.start - kRounding && time <= options.end + kRounding) {
      frames.push_back(frame);
    }
  }
  if (frames.empty()) {
    throw InputError(source_name + ": no frame lies between " +
                     std::to_string(options.start) +
                     " s and the end asked for");
  }

  const std::array<FootShape, 2> feet = MeasureFeet(body);
  const JointFrames rest = RestFrames(skeleton);
  const Vector3d hip_center =
      (rest.joint_in_world[kLHip] + rest.joint_in_world[kRHip]) / 2;
  std::vector<Pose> poses;
  std::array<std::vector<Vector3d>, 2> ankle_of_source;
  for (const int frame : frames) {
    const SourceFrame seen = source.FrameAt(frame);
    Pose pose = PoseOf(skeleton, source, seen);
    pose.root_in_world = scale.cwiseProduct(source.HipCenter(seen)) -
                         pose.rotation[kRoot] * hip_center;
    for (int side = 0; side < 2; ++side) {
      const int ankle = source.hierarchy().at(side == 0 ? kLAnkle : kRAnkle);
      ankle_of_source[side].push_back(scale.cwiseProduct(seen.position[ankle]));
    }
    poses.push_back(pose);
  }
  std::array<FootContact, 2> contact =
      FindContacts(skeleton, feet, ankle_of_source, motion.frame_time, poses);
  if (options.lock_feet && LevelFeet(skeleton, contact, &poses)) {
    contact =
        FindContacts(skeleton, feet, ankle_of_source, motion.frame_time, poses);
  }

  const JointLimits limits(skeleton);
  for (const int upper : {kLShoulder, kRShoulder, kLHip, kRHip}) {
    BendAboutHinges(skeleton, limits, upper, motion.frame_time, &poses);
  }
  for (Pose& pose : poses) {
    TwistForearm(skeleton, kLWrist, &pose);
    TwistForearm(skeleton, kRWrist, &pose);
    TurnShank(skeleton, kLAnkle, &pose);
    TurnShank(skeleton, kRAnkle, &pose);
  }
  LimitKeeper keeper(limits);
  keeper.Keep(options.limit_joints, &poses);

  std::size_t standing = 0;
  for (std::size_t t = 0; t < poses.size(); ++t) {
    standing += contact[0].heel[t] || contact[0].ball[t] ||
                contact[1].heel[t] || contact[1].ball[t];
  }
  result.standing_share = static_cast<double>(standing) / poses.size();
  const double slope =
      StandOnFloor(TracksOf(skeleton, feet, poses), contact, &poses);
  if (slope > 0.5 * kDegree) {
    char number[32];
    std::snprintf(number, sizeof(number), "%.1f", slope / kDegree);
    result.notes.push_back("the motion's floor slopes by " +
                           std::string(number) + " degrees; it was levelled");
  }
  if (options.lock_feet) {
    LockFeet(skeleton, feet, contact, motion.frame_time, &poses);
    keeper.Keep(options.limit_joints, &poses);
  }
  const FootTracks tracks = TracksOf(skeleton, feet, poses);
  for (int side = 0; side < 2; ++side) {
    result.longest_slide =
        std::max({result.longest_slide,
                  LongestSlide(tracks.heel[side], contact[side].heel),
                  LongestSlide(tracks.ball[side], contact[side].ball)});
  }
  for (const std::string& note : keeper.Notes(options.limit_joints)) {
    result.notes.push_back(note);
  }

  const double source_rate = 1 / motion.frame_time;
  constexpr double kUsualRate = 60;
  Resample(poses,
           motion.frame_time,
           options.frames_per_second > 0 ? options.frames_per_second
                                         : std::min(source_rate, kUsualRate),
           &result);
  return result;
}

}  // namespace sweepfit
