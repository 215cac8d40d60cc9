// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_body.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "model/median.h"
#include "model/skeleton.h"

namespace sweepfit {
namespace {

// Offsets and proportions below are fractions of the body's height H.

constexpr double kMinHeadThickness = 0.03;
// Half the breadth of a narrow head (5th percentile of women, ANSUR II).
constexpr double kSurelyHeadThickness = 0.038;
constexpr double kMaxFootHeight = 0.3;
// A wrist lies between these, from the finger tips.
constexpr double kFirstWrist = 0.085;
constexpr double kLastWrist = 0.135;
// From where the arm's sections join the trunk to the shoulder joint, along
// the arm.
constexpr double kMergeToShoulder = 0.045;
constexpr double kWristToShoulder = 0.29;
// From the armpit's corner to the shoulder joint, along the arm, and its
// spread, by the angle between the arm and the vertical (radians): what the
// template shows (tests/solver/landmark_template_test.cc). Arms that hang close
// the gap to the trunk well below the armpit.
struct ArmpitOffset {
  double angle, along, sigma;
};
constexpr std::array<ArmpitOffset, 3> kArmpitOffsets = {
    {{0.35, 0.085, 0.025}, {0.8, 0.048, 0.010}, {1.55, 0.035, 0.010}}};
// From the crotch's corner in the pictures up to the hip joints: 0.052 on the
// template, and trousers hang one to three centimetres below the skin.
constexpr double kCrotchToHip = 0.065;
constexpr double kCrotchToHipSigma = 0.018;
// From where the volume joins the legs, which webs seen from above blur.
constexpr double kMergeToHip = 0.055;
constexpr double kMergeToHipSigma = 0.025;
// The joint's usual height (tables, and something for shoes).
constexpr double kUsualHip = 0.520;
constexpr double kUsualHipSigma = 0.016;

ArmpitOffset ArmpitOffsetAt(double angle) {
  ArmpitOffset at = kArmpitOffsets.front();
  at.angle = angle;
  for (size_t i = 1; i < kArmpitOffsets.size(); ++i) {
    const ArmpitOffset& a = kArmpitOffsets[i - 1];
    const ArmpitOffset& b = kArmpitOffsets[i];
    const double t =
        std::clamp((angle - a.angle) / (b.angle - a.angle), 0., 1.);
    if (t <= 0) break;
    at.along = a.along + t * (b.along - a.along);
    at.sigma = a.sigma + t * (b.sigma - a.sigma);
  }
  return at;
}

Eigen::Vector3d Horizontal(const Eigen::Vector3d& v) {
  return {v.x(), 0, v.z()};
}

Landmark3 MakeLandmark(int joint,
                       const Eigen::Vector3d& point_in_world,
                       const Eigen::Matrix3d& covariance) {
  Landmark3 landmark;
  landmark.name = std::string(kJointNames[joint]);
  landmark.joint = joint;
  landmark.point_in_world = point_in_world;
  landmark.covariance = covariance;
  landmark.source = "volume";
  return landmark;
}

// The farthest point of the volume in a direction, seen from a square around
// the base.
Eigen::Vector3d FarthestPoint(const Volume& volume,
                              const Eigen::Vector3d& base,
                              const Eigen::Vector3d& direction,
                              double half_width,
                              double max_distance) {
  constexpr int kSteps = 3;
  const Eigen::Vector3d a = direction.unitOrthogonal();
  const Eigen::Vector3d b = direction.cross(a);
  Eigen::Vector3d farthest = base;
  double distance = 0;
  for (int i = -kSteps; i <= kSteps; ++i) {
    for (int k = -kSteps; k <= kSteps; ++k) {
      const Eigen::Vector3d start =
          base + half_width / kSteps * (i * a + k * b);
      if (volume.Sample(start) >= 0) continue;
      const double exit = RayExit(volume, start, direction, max_distance);
      if (exit <= distance) continue;
      distance = exit;
      farthest = start + exit * direction;
    }
  }
  return farthest;
}

// The angle between a limb's parts before and after a place, radians: a joint
// bends all of it, noise only what is near.
double LimbBend(const LimbLine& line, double from, double at, double to) {
  Eigen::Vector3d point, before, after;
  if (!FitAxis(line, from, at, &point, &before) ||
      !FitAxis(line, at, to, &point, &after)) {
    return 0;
  }
  return std::acos(std::clamp(before.dot(after), -1.0, 1.0));
}

constexpr double kMostOval = 1.3;  // longer half axis of a limb to the shorter

// Limbs are nearly round. Where few cameras see one, its hull is longer one way
// than the other, and the limb may lie anywhere along it: the covariance of
// this, mean of the free sections from one place to another, square metres.
Eigen::Matrix3d HullSlack(const LimbLine& line, double from, double to) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  int count = 0;
  for (const LimbSection& section : line) {
    if (section.s < from || section.s > to || !section.free) continue;
    const CutPlaneSection& cut = section.cut;
    const double slack =
        std::max(0.0, cut.half_axis_long - kMostOval * cut.half_axis_short);
    // Uniform between -slack and slack.
    sum +=
        slack * slack / 3 * cut.long_direction * cut.long_direction.transpose();
    ++count;
  }
  if (count > 0) sum /= count;
  return sum;
}

// The same about one place.
Eigen::Matrix3d HullSlackAt(const LimbLine& line, double s) {
  constexpr double kReach = 0.02;  // metres
  return HullSlack(line, s - kReach, s + kReach);
}

class BodyTracer {
 public:
  BodyTracer(const Volume& volume,
             const BodyEnds& ends,
             double height,
             double floor,
             const FindCorners& find_corners)
      : volume_(volume),
        ends_(ends),
        height_(height),
        floor_(floor),
        find_corners_(find_corners) {}

  BodyTrace Run();

 private:
  LimbTrace TraceArm(const Extremum& hand) const;
  LimbTrace TraceLeg(const Extremum& foot) const;
  void FindWrist(LimbTrace* arm) const;
  void FindArmpit(LimbTrace* arm) const;
  void FindAnkle(LimbTrace* leg) const;
  // Chord through a point along a direction, metres.
  double Chord(const Eigen::Vector3d& point,
               const Eigen::Vector3d& direction) const;
  void FindFacing(std::vector<LimbTrace> arms, std::vector<LimbTrace> legs);
  void FindCrotch();
  void PlaceLandmarks();
  const Landmark3* Corner(std::string_view name) const;
  Eigen::Vector3d HipCenter(int side) const;
  void AddLegs();
  void AddTrunk();
  void AddArms();
  void AddHead();
  void Unsafe(const std::string& limb, const std::string& why);
  // A joint at s on a limb's line.
  void AddOnLimb(
      int joint, const LimbLine& line, double s, double along, double across);
  // Where pictures may show the edges beside that joint.
  void AddPlace(int joint,
                const LimbLine& line,
                double s,
                const Eigen::Vector3d& tangent,
                const Eigen::Matrix3d& slack);
  // A tip, seen from the point of the line at place->base in the direction from
  // the point at s_root to it.
  void AddTip(const LimbLine& line,
              double s_base,
              double s_root,
              TipPlace place,
              double sigma);
  Eigen::Vector3d LegPointAtHeight(const LimbTrace& leg, double y) const;

  const Volume& volume_;
  const BodyEnds& ends_;
  const double height_;
  const double floor_;
  const FindCorners& find_corners_;
  BodyTrace result_;
  // Known after AddTrunk: the pelvis, and where the neck is.
  Eigen::Vector3d root_in_world_ = Eigen::Vector3d::Zero();
  bool crotch_is_safe_ = false;
};

void BodyTracer::Unsafe(const std::string& limb, const std::string& why) {
  if (std::find(result_.unsafe_limbs.begin(),
                result_.unsafe_limbs.end(),
                limb) == result_.unsafe_limbs.end()) {
    result_.unsafe_limbs.push_back(limb);
  }
  result_.warnings.push_back(limb + ": " + why);
}

void BodyTracer::AddOnLimb(
    int joint, const LimbLine& line, double s, double along, double across) {
  const Eigen::Vector3d tangent = TangentAt(line, s);
  const Eigen::Matrix3d slack = HullSlackAt(line, s);
  result_.landmarks.push_back(MakeLandmark(
      joint, PointAt(line, s), AlongAcross(tangent, along, across) + slack));
  AddPlace(joint, line, s, tangent, slack);
}

void BodyTracer::AddPlace(int joint,
                          const LimbLine& line,
                          double s,
                          const Eigen::Vector3d& tangent,
                          const Eigen::Matrix3d& slack) {
  for (const LimbSection& section : line) {
    if (section.s < s) continue;
    if (section.free) {
      const double half_width = std::min(
          section.cut.half_axis_long, kMostOval * section.cut.half_axis_short);
      result_.limb_places.push_back(
          {joint, PointAt(line, s), tangent, 1.1 * half_width + 0.005, slack});
    }
    break;
  }
}

void BodyTracer::AddTip(const LimbLine& line,
                        double s_base,
                        double s_root,
                        TipPlace place,
                        double sigma) {
  place.base_in_world = PointAt(line, s_base);
  const Eigen::Vector3d way = place.base_in_world - PointAt(line, s_root);
  Eigen::Vector3d tip = line.front().point_in_world;
  Eigen::Vector3d direction = (tip - place.base_in_world).normalized();
  if (way.norm() > 0.3 * (s_root - s_base)) {
    direction = way.normalized();
    tip = FarthestPoint(volume_,
                        place.base_in_world,
                        direction,
                        place.half_width,
                        0.15 * height_);
  }
  result_.landmarks.push_back(
      MakeLandmark(place.joint, tip, AlongAcross(direction, sigma, sigma)));
  result_.tip_places.push_back(place);
}

LimbTrace BodyTracer::TraceArm(const Extremum& hand) const {
  LimbTrace arm;
  TraceOptions options;
  options.half_size = 0.08 * height_;
  options.max_area = 0.006 * height_ * height_;
  options.max_length = 0.5 * height_;
  arm.line = TraceLimb(volume_, hand.path_in_world, options);
  FindWrist(&arm);
  FindArmpit(&arm);
  return arm;
}

void BodyTracer::FindWrist(LimbTrace* arm) const {
  // The narrowest section, by its longer axis, where a wrist can be.
  double narrowest = 1e9;
  for (const LimbSection& section : arm->line) {
    if (section.s < kFirstWrist * height_ || section.s > kLastWrist * height_) {
      continue;
    }
    if (!section.free || section.cut.half_axis_long >= narrowest) continue;
    narrowest = section.cut.half_axis_long;
    arm->s_wrist_or_ankle = section.s;
  }
  // Hand and forearm are wider than the wrist; where they are not, a cuff, a
  // fist or a poorly seen arm hides it and the hand's usual length must do.
  double hand = 0, forearm = 0;
  for (const LimbSection& section : arm->line) {
    if (section.s < arm->s_wrist_or_ankle) {
      hand = std::max(hand, section.cut.half_axis_long);
    } else if (section.s < arm->s_wrist_or_ankle + 0.06 * height_) {
      forearm = std::max(forearm, section.cut.half_axis_long);
    }
  }
  constexpr double kMargin = 0.008;  // a minimum at the end is none
  arm->is_clear = std::min(hand / narrowest, forearm / narrowest) > 1.15 &&
                  arm->s_wrist_or_ankle > (kFirstWrist + kMargin) * height_ &&
                  arm->s_wrist_or_ankle < (kLastWrist - kMargin) * height_;
  if (arm->is_clear) {
    arm->s_wrist_or_ankle -= 0.005 * height_;  // narrowest above the joint
  } else {
    arm->s_wrist_or_ankle = 0.108 * height_;
  }
}

void BodyTracer::FindArmpit(LimbTrace* arm) const {
  const double first = 0.22 * height_;
  for (const LimbSection& section : arm->line) {
    arm->s_merge = section.s;
    if (section.s < first) continue;
    std::vector<double> areas;
    for (const LimbSection& before : arm->line) {
      if (before.s > section.s - 0.05 * height_ &&
          before.s < section.s - 0.015 * height_) {
        areas.push_back(before.cut.area);
      }
    }
    const bool jump = section.cut.area > 1.5 * Median(areas);
    Eigen::Vector3d point, axis;
    const bool bent = FitAxis(arm->line,
                              section.s - 0.1 * height_,
                              section.s - 0.02 * height_,
                              &point,
                              &axis) &&
                      section.tangent.dot(axis) < std::cos(0.5);
    if (!section.free || jump || bent) break;
  }
  arm->merges_early = arm->s_merge < 0.3 * height_;
}

LimbTrace BodyTracer::TraceLeg(const Extremum& foot) const {
  LimbTrace leg;
  TraceOptions options;
  options.half_size = 0.1 * height_;
  options.max_area = 0.013 * height_ * height_;
  options.max_length = 0.75 * height_;
  leg.line = TraceLimb(volume_, foot.path_in_world, options);
  FindAnkle(&leg);
  leg.s_merge = leg.line.back().s;
  for (const LimbSection& section : leg.line) {
    if (section.s > 0.2 * height_ && !section.free) {
      leg.s_merge = section.s;
      break;
    }
  }
  return leg;
}

void BodyTracer::FindAnkle(LimbTrace* leg) const {
  leg->s_wrist_or_ankle = 0.12 * height_;
  Eigen::Vector3d point, shank;
  if (!FitAxis(leg->line, 0.21 * height_, 0.33 * height_, &point, &shank)) {
    return;
  }
  // Narrowest section of the shank, .033 H above the joint. Sections of the
  // foot look another way.
  double narrowest = 1e9;
  for (const LimbSection& section : leg->line) {
    if (section.s < 0.1 * height_ || section.s > 0.2 * height_) continue;
    if (!section.free || section.cut.area >= narrowest ||
        section.tangent.dot(shank) < 0.94) {
      continue;
    }
    narrowest = section.cut.area;
    leg->s_wrist_or_ankle = section.s - 0.033 * height_;
    leg->is_clear = true;
  }
}

double BodyTracer::Chord(const Eigen::Vector3d& point,
                         const Eigen::Vector3d& direction) const {
  if (volume_.Sample(point) >= 0) return 0;
  const double reach = 0.2 * height_;
  const double ahead = RayExit(volume_, point, direction, reach);
  const double back = RayExit(volume_, point, -direction, reach);
  return (ahead < 0 ? reach : ahead) + (back < 0 ? reach : back);
}

Eigen::Vector3d BodyTracer::LegPointAtHeight(const LimbTrace& leg,
                                             double y) const {
  const LimbLine& line = leg.line;
  for (size_t i = 1; i < line.size(); ++i) {
    const Eigen::Vector3d& a = line[i - 1].point_in_world;
    const Eigen::Vector3d& b = line[i].point_in_world;
    if (line[i].s < leg.s_wrist_or_ankle || b.y() < y) continue;
    if (a.y() >= y) return a;
    return a + (y - a.y()) / (b.y() - a.y()) * (b - a);
  }
  return line.back().point_in_world;
}

void BodyTracer::FindFacing(std::vector<LimbTrace> arms,
                            std::vector<LimbTrace> legs) {
  const auto arm_root = [&](const LimbTrace& arm) {
    return PointAt(arm.line, arm.s_merge);
  };
  const auto leg_root = [&](const LimbTrace& leg) {
    return LegPointAtHeight(leg, floor_ + 0.4 * height_);
  };
  // The line through the shoulders and that through the legs, either way.
  Eigen::Vector3d lateral = Eigen::Vector3d::Zero();
  if (arms.size() == 2) {
    lateral = Horizontal(arm_root(arms[1]) - arm_root(arms[0]));
  }
  if (legs.size() == 2) {
    Eigen::Vector3d across = Horizontal(leg_root(legs[1]) - leg_root(legs[0]));
    if (across.dot(lateral) < 0) across = -across;
    // Legs in a step say less about the trunk than shoulders do.
    lateral += arms.size() == 2 ? Eigen::Vector3d(0.5 * across) : across;
  }
  if (lateral.norm() < 0.02 * height_) {
    const Eigen::Vector3d chest =
        ends_.head
            ? ends_.head->path_in_world.back()
            : Eigen::Vector3d(0.5 * (volume_.BoxMin() + volume_.BoxMax()));
    const CutPlaneSection cut =
        CutPlane(volume_, chest, Eigen::Vector3d::UnitY(), 0.2 * height_);
    lateral = cut.found ? Horizontal(cut.long_direction)
                        : Eigen::Vector3d(Eigen::Vector3d::UnitX());
  }
  lateral.normalize();
  Eigen::Vector3d forward = lateral.cross(Eigen::Vector3d::UnitY());

  // Toes point forward.
  Eigen::Vector3d toes = Eigen::Vector3d::Zero();
  for (const LimbTrace& leg : legs) {
    const double s = leg.s_wrist_or_ankle + 0.06 * height_;
    toes += Horizontal(leg.line.front().point_in_world - PointAt(leg.line, s));
  }
  double evidence = forward.dot(toes) / (0.1 * height_);
  if (evidence < 0) {
    forward = -forward;
    evidence = -evidence;
  }
  result_.facing_in_world = forward;
  result_.left_in_world = Eigen::Vector3d::UnitY().cross(forward);
  // Two feet that point straight ahead give an evidence of about 2.
  result_.facing_confidence = std::clamp(evidence / 1.5, 0.0, 1.0);

  const auto sort = [&](std::vector<LimbTrace>* limbs,
                        const auto& root,
                        std::array<std::optional<LimbTrace>, 2>* by_side) {
    const auto leftness = [&](const LimbTrace& limb) {
      return result_.left_in_world.dot(root(limb));
    };
    if (limbs->size() == 2) {
      const bool first_is_left = leftness((*limbs)[0]) > leftness((*limbs)[1]);
      (*by_side)[kLeft] = std::move((*limbs)[first_is_left ? 0 : 1]);
      (*by_side)[kRight] = std::move((*limbs)[first_is_left ? 1 : 0]);
    } else if (limbs->size() == 1) {
      const Eigen::Vector3d middle =
          ends_.head
              ? ends_.head->path_in_world.back()
              : Eigen::Vector3d(0.5 * (volume_.BoxMin() + volume_.BoxMax()));
      const bool left =
          leftness((*limbs)[0]) > result_.left_in_world.dot(middle);
      (*by_side)[left ? kLeft : kRight] = std::move((*limbs)[0]);
    }
  };
  sort(&arms, arm_root, &result_.arm);
  sort(&legs, leg_root, &result_.leg);
}

void BodyTracer::FindCrotch() {
  if (!result_.leg[kLeft] || !result_.leg[kRight]) return;
  // Cameras that look down see a web between the thighs well below the crotch:
  // it counts as trunk once it is nearly as deep as the thighs.
  const double step = 0.005;
  double merge = 0;
  for (double h = 0.55 * height_; h > 0.1 * height_; h -= step) {
    const Eigen::Vector3d left =
        LegPointAtHeight(*result_.leg[kLeft], floor_ + h);
    const Eigen::Vector3d right =
        LegPointAtHeight(*result_.leg[kRight], floor_ + h);
    if (Horizontal(left - right).norm() < 0.03 * height_) continue;
    const double middle = Chord(0.5 * (left + right), result_.facing_in_world);
    const double thigh = 0.5 * (Chord(left, result_.facing_in_world) +
                                Chord(right, result_.facing_in_world));
    if (middle < 0.6 * thigh) break;
    merge = h;
  }
  result_.crotch_height = merge;
}

Eigen::Vector3d BodyTracer::HipCenter(int side) const {
  const double sign = side == kLeft ? 1 : -1;
  double offset = 0.05 * height_;
  Eigen::Vector3d point, axis;
  const LimbTrace& leg = *result_.leg[side];
  // The thigh's axis says where the hip is, sideways.
  const double from = leg.s_wrist_or_ankle + 0.28 * height_;
  if (crotch_is_safe_ && FitAxis(leg.line, from, leg.s_merge, &point, &axis) &&
      axis.y() > 0.8 && leg.s_merge - from > 0.05 * height_) {
    const Eigen::Vector3d reached =
        point + (root_in_world_.y() - point.y()) / axis.y() * axis;
    const double seen =
        sign * (reached - root_in_world_).dot(result_.left_in_world);
    offset =
        0.5 * offset + 0.5 * std::clamp(seen, 0.035 * height_, 0.07 * height_);
  }
  return root_in_world_ + sign * offset * result_.left_in_world;
}

void BodyTracer::AddLegs() {
  static constexpr const char* kNames[] = {"l_leg", "r_leg"};
  static constexpr int kAnkle[] = {kLAnkle, kRAnkle};
  static constexpr int kKnee[] = {kLKnee, kRKnee};
  static constexpr int kToe[] = {kLFootEnd, kRFootEnd};
  static constexpr int kHip[] = {kLHip, kRHip};
  for (const int side : {kLeft, kRight}) {
    if (!result_.leg[side]) {
      Unsafe(kNames[side], "no foot stands out");
      continue;
    }
    LimbTrace& leg = *result_.leg[side];
    const Eigen::Vector3d hip = HipCenter(side);
    // The ankle: on the shank's axis.
    Eigen::Vector3d axis_point, axis;
    const double s_shank = leg.s_wrist_or_ankle + 0.033 * height_;
    if (!FitAxis(
            leg.line, s_shank, s_shank + 0.12 * height_, &axis_point, &axis)) {
      Unsafe(kNames[side], "the shank cannot be followed");
      continue;
    }
    const Eigen::Vector3d narrowest = PointAt(leg.line, s_shank);
    double along = (narrowest - axis_point).dot(axis) - 0.033 * height_;
    double sigma = leg.is_clear ? 0.018 : 0.03;
    if (axis.y() > 0.9) {
      // Over the sole, .0415 H and something for a shoe.
      const double down =
          RayExit(volume_, narrowest, -Eigen::Vector3d::UnitY(), 0.3 * height_);
      const double sole = narrowest.y() - down;
      if (down > 0 && sole < floor_ + 0.03 * height_) {
        along = (sole + 0.05 * height_ - axis_point.y()) / axis.y();
        sigma = 0.012;
      }
    }
    const Eigen::Vector3d ankle = axis_point + along * axis;
    const Eigen::Matrix3d slack = HullSlackAt(leg.line, s_shank);
    result_.landmarks.push_back(MakeLandmark(
        kAnkle[side], ankle, AlongAcross(axis, sigma, 0.010) + slack));
    // The pictures show the shank where it is narrow; at the joint they show
    // the foot.
    AddPlace(kAnkle[side], leg.line, s_shank, axis, slack);
    AddTip(leg.line,
           0.04 * height_,
           0.085 * height_,
           {.joint = kToe[side],
            .half_width = 0.022 * height_,
            .radius = 0.008 * height_,
            .anatomy_along = 0.013,
            .anatomy_across = 0.013},
           0.02);

    // The knee: a bend, else the usual share of the way.
    const double s_ankle = s_shank - (narrowest - ankle).dot(axis);
    const double leg_length = (hip - ankle).norm();
    double s_knee = s_ankle + 0.51 * leg_length;
    const Bend bend = SharpestBend(
        leg.line,
        s_ankle + 0.4 * leg_length,
        std::min(s_ankle + 0.62 * leg_length, leg.s_merge - 0.1 * height_),
        0.1 * height_);
    if (bend.angle > 0.35 && LimbBend(leg.line,
                                      s_ankle + 0.05 * height_,
                                      bend.s,
                                      leg.s_merge - 0.03 * height_) > 0.3) {
      s_knee = bend.s;
    }
    if (s_knee < leg.s_merge) {
      AddOnLimb(kKnee[side], leg.line, s_knee, 0.020, 0.010);
    } else {
      Unsafe(kNames[side], "the knee is hidden");
    }
    const double hip_sigma = crotch_is_safe_ ? 0.018 : 0.03;
    result_.landmarks.push_back(
        MakeLandmark(kHip[side],
                     hip,
                     AlongAcross(Eigen::Vector3d::UnitY(), hip_sigma, 0.02)));
  }
}

void BodyTracer::AddTrunk() {
  // The crotch speaks for the person, the usual share for people.
  double hip = kUsualHip;
  double hip_sigma = kUsualHipSigma;
  const auto fuse = [&](double seen, double sigma) {
    const double w = 1 / (sigma * sigma);
    const double w_usual = 1 / (hip_sigma * hip_sigma);
    hip = (w * seen + w_usual * hip) / (w + w_usual);
    hip_sigma = 1 / std::sqrt(w + w_usual);
  };
  const double merge = result_.crotch_height / height_;
  crotch_is_safe_ = merge > 0.42 && merge < 0.53;
  if (crotch_is_safe_) {
    const Landmark3* crotch = Corner("crotch");
    const double seen =
        crotch == nullptr ? 0 : (crotch->point_in_world.y() - floor_) / height_;
    if (seen > 0.39 && seen < 0.53) {
      fuse(seen + kCrotchToHip,
           std::hypot(kCrotchToHipSigma,
                      std::sqrt(crotch->covariance(1, 1)) / height_));
    } else {
      fuse(merge + kMergeToHip, kMergeToHipSigma);
    }
  } else {
    const std::string why = result_.crotch_height > 0
                                ? "legs merge (skirt or closed legs)"
                                : "the crotch was not found";
    Unsafe("l_leg", why);
    Unsafe("r_leg", why);
  }
  const double hip_height = hip * height_;
  Eigen::Vector3d middle = 0.5 * (volume_.BoxMin() + volume_.BoxMax());
  if (result_.leg[kLeft] && result_.leg[kRight]) {
    middle =
        0.5 * (LegPointAtHeight(*result_.leg[kLeft], floor_ + 0.45 * height_) +
               LegPointAtHeight(*result_.leg[kRight], floor_ + 0.45 * height_));
  } else if (ends_.head) {
    middle = ends_.head->path_in_world.back();
  }
  middle.y() = floor_ + hip_height;
  const CutPlaneSection cut =
      CutPlane(volume_, middle, Eigen::Vector3d::UnitY(), 0.2 * height_);
  if (cut.found) middle = cut.centroid_in_world;
  root_in_world_ = middle;
  result_.landmarks.push_back(MakeLandmark(
      kRoot,
      root_in_world_,
      AlongAcross(
          Eigen::Vector3d::UnitY(), crotch_is_safe_ ? 0.018 : 0.03, 0.016)));
}

void BodyTracer::AddArms() {
  constexpr double kMostNeckToShoulder = 0.2;  // usually .12
  static constexpr const char* kNames[] = {"l_arm", "r_arm"};
  static constexpr int kShoulder[] = {kLShoulder, kRShoulder};
  static constexpr int kElbow[] = {kLElbow, kRElbow};
  static constexpr int kWrist[] = {kLWrist, kRWrist};
  static constexpr int kTip[] = {kLHandEnd, kRHandEnd};
  static constexpr const char* kArmpit[] = {"l_armpit", "r_armpit"};
  for (const int side : {kLeft, kRight}) {
    if (!result_.arm[side]) {
      Unsafe(kNames[side], "no hand stands out");
      continue;
    }
    const LimbTrace& arm = *result_.arm[side];
    const double s_wrist = arm.s_wrist_or_ankle;
    // Which finger stands out most depends on the hand.
    AddTip(arm.line,
           0.055 * height_,
           s_wrist,
           {.joint = kTip[side],
            .half_width = 0.02 * height_,
            .radius = 0.005 * height_,
            .widest = 0.085 * height_,
            .anatomy_along = 0.007,
            .anatomy_across = 0.007},
           0.022);
    AddOnLimb(kWrist[side],
              arm.line,
              s_wrist,
              arm.is_clear ? 0.008 : 0.011,
              arm.is_clear ? 0.0055 : 0.0095);
    Eigen::Vector3d axis_point, axis;
    if (!FitAxis(arm.line,
                 arm.s_merge - 0.1 * height_,
                 arm.s_merge - 0.015 * height_,
                 &axis_point,
                 &axis)) {
      Unsafe(kNames[side], "the upper arm cannot be followed");
      continue;
    }
    // Distances along the arm are counted from its last section.
    const Eigen::Vector3d last = PointAt(arm.line, arm.s_merge);
    double s_shoulder = arm.s_merge + kMergeToShoulder * height_;
    double along_shoulder = 0.028;
    double across_shoulder = 0.015;
    if (arm.merges_early) {
      // As far as arms usually reach, in the direction last seen.
      s_shoulder = std::max(s_shoulder, s_wrist + kWristToShoulder * height_);
      along_shoulder = 0.075;
      // Only a forearm: the upper arm may go another way.
      across_shoulder = arm.s_merge < s_wrist + 0.19 * height_ ? 0.1 : 0.04;
    }
    const Landmark3* armpit = Corner(kArmpit[side]);
    bool armpit_is_safe = false;
    if (armpit != nullptr && across_shoulder < 0.1) {
      const ArmpitOffset offset =
          ArmpitOffsetAt(std::acos(std::clamp(axis.y(), -1.0, 1.0)));
      const double seen = arm.s_merge +
                          (armpit->point_in_world - last).dot(axis) +
                          offset.along * height_;
      const double reach = (seen - s_wrist) / height_;
      // From the wrist arms reach a usual distance; otherwise the corner was
      // another one.
      if (reach > 0.22 && reach < 0.4) {
        armpit_is_safe = true;
        s_shoulder = seen;
        along_shoulder = std::sqrt(std::pow(offset.sigma * height_, 2) +
                                   axis.dot(armpit->covariance * axis));
        across_shoulder = 0.015;
      }
    }
    if (arm.merges_early && !armpit_is_safe) {
      Unsafe(kNames[side], "the arm merges with the trunk below the armpit");
    }
    const double along =
        (last - axis_point).dot(axis) + s_shoulder - arm.s_merge;
    const Eigen::Vector3d shoulder = axis_point + along * axis;
    // A direction that only the forearm showed may lead anywhere.
    if (arm.merges_early && !armpit_is_safe && result_.neck &&
        (shoulder - result_.neck->center_in_world).norm() >
            kMostNeckToShoulder * height_) {
      continue;
    }
    result_.landmarks.push_back(
        MakeLandmark(kShoulder[side],
                     shoulder,
                     AlongAcross(axis, along_shoulder, across_shoulder) +
                         HullSlack(arm.line,
                                   arm.s_merge - 0.1 * height_,
                                   arm.s_merge - 0.015 * height_)));
    if (armpit_is_safe) {
      result_.landmarks.back().source = "both";
      result_.landmarks.back().num_views = armpit->num_views;
    }
    double s_elbow = s_shoulder - 0.515 * (s_shoulder - s_wrist);
    double along_elbow = 0.03;
    const Bend bend = SharpestBend(
        arm.line,
        s_elbow - 0.06 * height_,
        std::min(s_elbow + 0.06 * height_, arm.s_merge - 0.08 * height_),
        0.08 * height_);
    if (bend.angle > 0.35 &&
        LimbBend(arm.line, s_wrist, bend.s, arm.s_merge - 0.03 * height_) >
            0.3) {
      s_elbow = bend.s;
      along_elbow = 0.018;
    }
    if (s_elbow < arm.s_merge + 0.02 * height_) {
      AddOnLimb(kElbow[side], arm.line, s_elbow, along_elbow, 0.012);
    }
  }
}

void BodyTracer::AddHead() {
  if (!ends_.head) {
    result_.warnings.push_back("head: no end of the body is thick enough");
    return;
  }
  // Sections from the head down towards the trunk. A head is round: a line
  // through the centroids of its sections would lose its way there, so it
  // begins straight and is centred once.
  TraceOptions options;
  options.half_size = 0.09 * height_;
  options.max_area = 0.02 * height_ * height_;
  options.max_length = 0.3 * height_;
  options.smoothing = 0.05;
  options.iterations = 1;
  const LimbLine line =
      TraceLimb(volume_, {ends_.head->point_in_world, root_in_world_}, options);
  // The neck is narrow, and as far below the top as a head is high.
  constexpr double kFirstNeck = 0.09;
  constexpr double kLastNeck = 0.2;
  constexpr double kUsualNeck = 0.13;
  const Eigen::Vector3d top = ends_.head->point_in_world;
  const Eigen::Vector3d body_down = (root_in_world_ - top).normalized();
  double narrowest = 1e9;
  double below = 0;
  Eigen::Vector3d narrow = top;
  Eigen::Vector3d usual = top;
  for (const LimbSection& section : line) {
    const double at = (section.point_in_world - top).dot(body_down) / height_;
    if (at < kUsualNeck) usual = section.point_in_world;
    if (at < kFirstNeck || at > kLastNeck || !section.free ||
        section.cut.area >= narrowest) {
      continue;
    }
    narrowest = section.cut.area;
    narrow = section.point_in_world;
    below = at;
  }
  // Long hair and collars leave no narrow place between head and shoulders.
  constexpr double kMargin = 0.008;
  const bool is_clear =
      below > kFirstNeck + kMargin && below < kLastNeck - kMargin;
  if (!is_clear) narrow = usual;
  const Eigen::Vector3d down = (root_in_world_ - narrow).normalized();
  constexpr double kNeckLean = 0.27;  // forwards, going up (template)
  const Eigen::Vector3d neck_axis =
      (down - kNeckLean * result_.facing_in_world).normalized();
  result_.neck =
      BodyTrace::NeckPlace{narrow, down, neck_axis, 0.07 * height_, is_clear};
  // C7 lies behind the middle of the neck, a vertebra behind that of the waist.
  const Eigen::Vector3d neck = narrow + 0.015 * height_ * down -
                               0.01 * height_ * result_.facing_in_world;
  result_.landmarks.push_back(MakeLandmark(
      kNeck,
      neck,
      AlongAcross(down, is_clear ? 0.016 : 0.035, is_clear ? 0.009 : 0.02)));
  // The crown: up from the middle of the head.
  Eigen::Vector3d head_middle = PointAt(line, 0.06 * height_);
  // From the neck's middle to the head's, heads lean forward (template).
  constexpr double kHeadLean = 0.16;
  const Eigen::Vector3d head_up = ((head_middle - narrow).normalized() -
                                   kHeadLean * result_.facing_in_world)
                                      .normalized();
  const double exit = RayExit(volume_, head_middle, head_up, 0.2 * height_);
  const Eigen::Vector3d crown =
      exit > 0 ? Eigen::Vector3d(head_middle + exit * head_up)
               : ends_.head->point_in_world;
  result_.landmarks.push_back(
      MakeLandmark(kHeadEnd, crown, AlongAcross(head_up, 0.015, 0.025)));
  result_.tip_places.push_back({.joint = kHeadEnd,
                                .base_in_world = head_middle,
                                .half_width = 0.04 * height_,
                                .radius = 0.05 * height_,
                                .anatomy_along = 0.01,
                                .anatomy_across = 0.014});
  const Eigen::Vector3d head = crown - 0.085 * height_ * head_up;
  result_.landmarks.push_back(
      MakeLandmark(kHead, head, AlongAcross(head_up, 0.014, 0.011)));

  const Eigen::Vector3d up = (neck - root_in_world_).normalized();
  Eigen::Vector3d spine = root_in_world_ + 0.095 * height_ * up;
  const CutPlaneSection cut = CutPlane(volume_, spine, up, 0.2 * height_);
  if (cut.found) spine = cut.centroid_in_world;
  spine -= 0.02 * height_ * result_.facing_in_world;
  result_.landmarks.push_back(
      MakeLandmark(kSpine, spine, AlongAcross(up, 0.025, 0.016)));
}

const Landmark3* BodyTracer::Corner(std::string_view name) const {
  for (const Landmark3& corner : result_.corners) {
    if (corner.name == name) return &corner;
  }
  return nullptr;
}

void BodyTracer::PlaceLandmarks() {
  result_.landmarks.clear();
  result_.limb_places.clear();
  result_.tip_places.clear();
  result_.unsafe_limbs.clear();
  result_.warnings.clear();
  AddTrunk();
  AddHead();
  AddArms();
  AddLegs();
}

BodyTrace BodyTracer::Run() {
  result_.head = ends_.head;
  std::vector<LimbTrace> arms, legs;
  for (const Extremum& hand : ends_.hands) arms.push_back(TraceArm(hand));
  for (const Extremum& foot : ends_.feet) legs.push_back(TraceLeg(foot));
  FindFacing(std::move(arms), std::move(legs));
  FindCrotch();
  PlaceLandmarks();
  if (find_corners_) {
    result_.corners = find_corners_(result_.landmarks);
    if (!result_.corners.empty()) PlaceLandmarks();
  }
  return std::move(result_);
}

}  // namespace

BodyEnds NameExtrema(const std::vector<Extremum>& extrema,
                     double body_height,
                     double floor) {
  BodyEnds ends;
  std::vector<Extremum> rest = extrema;
  std::stable_sort(rest.begin(), rest.end(), [](const auto& a, const auto& b) {
    return a.point_in_world.y() < b.point_in_world.y();
  });
  while (!rest.empty() && ends.feet.size() < 2 &&
         rest.front().point_in_world.y() <
             floor + kMaxFootHeight * body_height) {
    ends.feet.push_back(rest.front());
    rest.erase(rest.begin());
  }
  // More ends as low as feet are false: few cameras that look down leave solid
  // what is between and behind the legs.
  std::erase_if(rest, [&](const Extremum& end) {
    return ends.feet.size() == 2 &&
           end.point_in_world.y() < floor + kMaxFootHeight * body_height;
  });
  // The highest of the ends that are as thick as a head: a hand that merges
  // with the hip may be thicker than that.
  const auto as_head = [&](const Extremum& end) {
    return std::pair(
        std::min<double>(end.thickness, kSurelyHeadThickness * body_height),
        end.point_in_world.y());
  };
  const auto thickest = std::max_element(
      rest.begin(), rest.end(), [&](const auto& a, const auto& b) {
        return as_head(a) < as_head(b);
      });
  if (thickest != rest.end() &&
      thickest->thickness > kMinHeadThickness * body_height) {
    ends.head = *thickest;
    rest.erase(thickest);
  }
  std::stable_sort(rest.begin(), rest.end(), [](const auto& a, const auto& b) {
    return a.prominence > b.prominence;
  });
  for (const Extremum& extremum : rest) {
    if (ends.hands.size() < 2) ends.hands.push_back(extremum);
  }
  return ends;
}

BodyTrace TraceBody(const Volume& volume,
                    const BodyEnds& ends,
                    double body_height,
                    double floor,
                    const FindCorners& find_corners) {
  return BodyTracer(volume, ends, body_height, floor, find_corners).Run();
}

}  // namespace sweepfit
