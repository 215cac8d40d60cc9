// SPDX-License-Identifier: Apache-2.0
#include "model/template_solid.h"

#include <glog/logging.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "model/cross_section.h"

namespace sweepfit {
namespace {

constexpr int kGirthRays = 48;
constexpr int kGirthIterations = 5;
// Beyond this distance from the mid plane, in statures, the surface of one leg
// does not feel the other.
constexpr double kLegsReach = 0.03;
// A tape around the neck runs lower in front.
constexpr double kNeckTapeLean = 20 * std::numbers::pi / 180;

Eigen::Vector3d Mirrored(const Eigen::Vector3d& point) {
  return {-point.x(), point.y(), point.z()};
}

}  // namespace

double ExitDistance(
    const std::function<double(const Eigen::Vector3d&)>& distance,
    const Eigen::Vector3d& origin,
    const Eigen::Vector3d& direction,
    double step) {
  // Distances are approximate, so the march does not trust them fully.
  constexpr double kTrust = 0.5;
  constexpr int kMaxSteps = 2000;
  constexpr int kBisections = 30;
  double inside = 0;
  double outside = 0;
  double value = distance(origin);
  for (int i = 0; i < kMaxSteps && value < 0; ++i) {
    inside = outside;
    outside += std::max(step, -kTrust * value);
    value = distance(origin + outside * direction);
  }
  for (int i = 0; i < kBisections && outside > inside; ++i) {
    const double middle = (inside + outside) / 2;
    (distance(origin + middle * direction) < 0 ? inside : outside) = middle;
  }
  return outside;
}

TemplateSolid::TemplateSolid(
    const TemplateTables& tables,
    double stature,
    const std::array<Eigen::Vector3d, kNumJoints>& joints,
    const std::vector<double>& girth_factor)
    : tables_(tables), stature_(stature), joints_(joints) {
  CHECK_EQ(girth_factor.size(), tables_.girths.size());
  arm_along_ = (joints_[kLHandEnd] - joints_[kLShoulder]).normalized();
  arm_thumb_ = Eigen::Vector3d::UnitZ();
  arm_palm_ = arm_along_.cross(arm_thumb_);
  foot_forward_ = {
      std::sin(tables_.foot_toe_out), 0, std::cos(tables_.foot_toe_out)};
  foot_lateral_ = Eigen::Vector3d::UnitY().cross(foot_forward_);

  // Sections are scaled until tapes around the solid read the targets.
  girth_scale_.assign(tables_.girths.size(), 1.0);
  Build(girth_scale_);
  for (int iteration = 0; iteration < kGirthIterations; ++iteration) {
    for (size_t i = 0; i < tables_.girths.size(); ++i) {
      const GirthTarget& target = tables_.girths[i];
      girth_scale_[i] *=
          girth_factor[i] * target.girth * stature_ / MeasureGirth(target);
    }
    Build(girth_scale_);
  }
}

std::vector<StackSection> TemplateSolid::Scaled(const SectionTable& table,
                                                const std::string& part) const {
  // Between the levels of two girths their scales are blended.
  std::vector<std::pair<double, double>> level_scale;
  for (size_t i = 0; i < tables_.girths.size(); ++i) {
    if (tables_.girths[i].part == part)
      level_scale.push_back({tables_.girths[i].level, girth_scale_[i]});
  }
  // Shoulders keep their size whatever the chest.
  if (part == "trunk") level_scale.push_back({table.sections.back().s, 1.0});
  std::sort(level_scale.begin(), level_scale.end());
  std::vector<StackSection> sections = table.sections;
  for (StackSection& section : sections) {
    double scale = level_scale.empty() ? 1 : level_scale.front().second;
    for (size_t i = 0; i < level_scale.size(); ++i) {
      const auto [level, value] = level_scale[i];
      if (section.s < level) break;
      scale = value;
      if (i + 1 < level_scale.size()) {
        const auto [next_level, next_value] = level_scale[i + 1];
        const double t =
            std::min(1.0, (section.s - level) / (next_level - level));
        scale += t * (next_value - value);
      }
    }
    // Thighs grow outwards: inside they would meet.
    if (part == "leg") {
      const double thigh = std::clamp(1 - section.s, 0.0, 1.0);
      section.center_x += thigh * (scale - 1) * section.half_x;
    }
    section.half_x *= scale;
    section.half_y *= scale;
  }
  return sections;
}

void TemplateSolid::Build(const std::vector<double>& girth_scale) {
  CHECK_EQ(girth_scale.size(), tables_.girths.size());
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  auto metric = [&](std::vector<StackSection> sections) {
    for (StackSection& section : sections) {
      section.s *= stature_;
      section.half_x *= stature_;
      section.half_y *= stature_;
      section.center_x *= stature_;
      section.center_y *= stature_;
    }
    return sections;
  };
  auto upright = [&](const SectionTable& table, const std::string& part) {
    return SectionStack(Eigen::Vector3d::Zero(),
                        x,
                        z,
                        y,
                        metric(Scaled(table, part)),
                        table.round_start * stature_,
                        table.round_end * stature_);
  };
  trunk_ = upright(tables_.trunk, "trunk");
  neck_ = upright(tables_.neck, "neck");
  head_ = upright(tables_.head, "head");

  std::vector<StackSection> arm = metric(Scaled(tables_.arm, "arm"));
  for (StackSection& section : arm) {
    section.s =
        (ArmAxis(section.s / stature_) - joints_[kLShoulder]).dot(arm_along_);
  }
  arm_ = SectionStack(joints_[kLShoulder],
                      arm_thumb_,
                      arm_palm_,
                      arm_along_,
                      arm,
                      tables_.arm.round_start * stature_,
                      tables_.arm.round_end * stature_);

  std::vector<StackSection> leg = metric(Scaled(tables_.leg, "leg"));
  for (StackSection& section : leg) {
    const Eigen::Vector3d axis = LegAxis(section.s / stature_) - joints_[kLHip];
    section.s = -axis.y();
    section.center_x += axis.x();
    section.center_y += axis.z();
  }
  leg_ = SectionStack(joints_[kLHip],
                      x,
                      z,
                      -y,
                      leg,
                      tables_.leg.round_start * stature_,
                      tables_.leg.round_end * stature_);

  // Above, the legs are not felt on the surface.
  leg_top_ =
      joints_[kLHip].y() - leg_.start() + 2 * tables_.blend.leg * stature_;

  const Eigen::Vector3d& ankle = joints_[kLAnkle];
  foot_ = SectionStack({ankle.x(), 0, ankle.z()},
                       foot_lateral_,
                       y,
                       foot_forward_,
                       metric(Scaled(tables_.foot, "foot")),
                       tables_.foot.round_start * stature_,
                       tables_.foot.round_end * stature_);

  const Eigen::Vector3d& wrist = joints_[kLWrist];
  const double hand = (joints_[kLHandEnd] - wrist).norm();
  for (size_t i = 0; i < finger_.size(); ++i) {
    const FingerTable& table = tables_.finger[i];
    auto place = [&](const Eigen::Vector3d& p) -> Eigen::Vector3d {
      return wrist + hand * (p.x() * arm_along_ + p.y() * arm_thumb_ +
                             p.z() * arm_palm_);
    };
    const Eigen::Vector3d root = place(table.root);
    Eigen::Vector3d tip = place(table.tip);
    // The tip's sphere ends at the given point.
    tip -= hand * table.radius.y() * (tip - root).normalized();
    finger_[i] = {{root, tip},
                  {hand * table.radius.x(), hand * table.radius.y()}};
  }

  trunk_blobs_.clear();
  head_blobs_.clear();
  leg_blobs_.clear();
  for (const BlobTable& entry : tables_.blobs) {
    Blob blob = entry.blob;
    blob.center *= stature_;
    blob.radii *= stature_;
    blob.blend_width *= stature_;
    auto& blobs = entry.part == "trunk"  ? trunk_blobs_
                  : entry.part == "head" ? head_blobs_
                                         : leg_blobs_;
    blobs.push_back(blob);
    const bool paired = entry.part != "leg" && blob.center.x() != 0;
    if (!paired) continue;
    blob.center.x() = -blob.center.x();
    blobs.push_back(blob);
  }
}

double TemplateSolid::Trunk(const Eigen::Vector3d& point) const {
  const TemplateBlend& blend = tables_.blend;
  // Parts too high or too low to be felt at the point are left out.
  const double reach = std::max(blend.neck, blend.head) * stature_;
  const double height = point.y();
  double trunk = std::numeric_limits<double>::infinity();
  if (height < trunk_.end() + reach) {
    trunk = trunk_.Distance(point);
    for (const Blob& blob : trunk_blobs_) trunk = blob.Apply(trunk, point);
  }
  if (height < neck_.start() - reach) return trunk;
  trunk = SmoothMin(trunk, neck_.Distance(point), blend.neck * stature_);
  if (height < head_.start() - reach) return trunk;
  double head = head_.Distance(point);
  for (const Blob& blob : head_blobs_) head = blob.Apply(head, point);
  return SmoothMin(trunk, head, blend.head * stature_);
}

double TemplateSolid::Arm(const Eigen::Vector3d& point) const {
  return arm_.Distance(point);
}

double TemplateSolid::Finger(int finger, const Eigen::Vector3d& point) const {
  return finger_[finger].Distance(point);
}

double TemplateSolid::Hand(const Eigen::Vector3d& point) const {
  double hand = finger_[0].Distance(point);
  for (size_t i = 1; i < finger_.size(); ++i)
    hand = std::min(hand, finger_[i].Distance(point));
  return hand;
}

double TemplateSolid::Leg(const Eigen::Vector3d& point) const {
  double leg = leg_.Distance(point);
  for (const Blob& blob : leg_blobs_) leg = blob.Apply(leg, point);
  return leg;
}

double TemplateSolid::Foot(const Eigen::Vector3d& point) const {
  return foot_.Distance(point);
}

double TemplateSolid::LegAndFoot(const Eigen::Vector3d& point) const {
  return SmoothMin(Leg(point), Foot(point), tables_.blend.foot * stature_);
}

double TemplateSolid::Body(const Eigen::Vector3d& point) const {
  const TemplateBlend& blend = tables_.blend;
  const Eigen::Vector3d left(std::abs(point.x()), point.y(), point.z());
  const Eigen::Vector3d right = Mirrored(left);
  // The arms are never near each other, the legs are near the mid plane.
  const double arm = SmoothMin(Arm(left), Hand(left), blend.finger * stature_);
  const double trunk = SmoothMin(Trunk(left), arm, blend.arm * stature_);
  if (left.y() > leg_top_) return trunk;
  double leg = LegAndFoot(left);
  if (left.x() < kLegsReach * stature_)
    leg = SmoothMin(leg, LegAndFoot(right), blend.legs * stature_);
  return SmoothMin(trunk, leg, blend.leg * stature_);
}

Eigen::Vector3d TemplateSolid::ArmAxis(double bones) const {
  static constexpr int kChain[] = {kLShoulder, kLElbow, kLWrist, kLHandEnd};
  const int k = std::clamp(static_cast<int>(std::floor(bones)), 0, 2);
  const Eigen::Vector3d& a = joints_[kChain[k]];
  return a + (bones - k) * (joints_[kChain[k + 1]] - a);
}

Eigen::Vector3d TemplateSolid::LegAxis(double bones) const {
  static constexpr int kChain[] = {kLHip, kLKnee, kLAnkle};
  const int k = std::clamp(static_cast<int>(std::floor(bones)), 0, 1);
  const Eigen::Vector3d& a = joints_[kChain[k]];
  return a + (bones - k) * (joints_[kChain[k + 1]] - a);
}

Eigen::Vector3d TemplateSolid::ArmCenter(double bones) const {
  return arm_.Center((ArmAxis(bones) - joints_[kLShoulder]).dot(arm_along_));
}

Eigen::Vector3d TemplateSolid::LegCenter(double bones) const {
  return leg_.Center(joints_[kLHip].y() - LegAxis(bones).y());
}

Eigen::Vector3d TemplateSolid::TrunkCenter(double height) const {
  return trunk_.Center(height);
}

double TemplateSolid::MeasureGirth(const GirthTarget& target) const {
  Eigen::Vector3d center, x, y;
  std::function<double(const Eigen::Vector3d&)> solid;
  const double leg_width = tables_.blend.leg * stature_;
  if (target.part == "trunk") {
    center = TrunkCenter(target.level * stature_);
    x = Eigen::Vector3d::UnitZ();
    y = Eigen::Vector3d::UnitX();
    solid = [&](const Eigen::Vector3d& p) {
      const double trunk = Trunk(p);
      return std::min(SmoothMin(trunk, LegAndFoot(p), leg_width),
                      SmoothMin(trunk, LegAndFoot(Mirrored(p)), leg_width));
    };
  } else if (target.part == "neck") {
    center = neck_.Center(target.level * stature_);
    x = {0, -std::sin(kNeckTapeLean), std::cos(kNeckTapeLean)};
    y = Eigen::Vector3d::UnitX();
    solid = [&](const Eigen::Vector3d& p) { return Trunk(p); };
  } else if (target.part == "arm") {
    center = ArmCenter(target.level);
    x = arm_thumb_;
    y = arm_palm_;
    solid = [&](const Eigen::Vector3d& p) { return Arm(p); };
  } else {
    CHECK_EQ(target.part, "leg");
    center = LegCenter(target.level);
    x = Eigen::Vector3d::UnitZ();
    y = Eigen::Vector3d::UnitX();
    solid = [&](const Eigen::Vector3d& p) {
      return SmoothMin(Trunk(p), LegAndFoot(p), leg_width);
    };
  }
  std::vector<double> radii;
  for (int k = 0; k < kGirthRays; ++k) {
    const double theta = 2 * std::numbers::pi * k / kGirthRays;
    radii.push_back(ExitDistance(solid,
                                 center,
                                 std::cos(theta) * x + std::sin(theta) * y,
                                 0.001 * stature_));
  }
  return CrossSection(radii).TapeGirth();
}

}  // namespace sweepfit
