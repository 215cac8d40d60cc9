// SPDX-License-Identifier: Apache-2.0
#include "model/template_solid.h"

#include <glog/logging.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "model/cross_section.h"
#include "model/smooth_step.h"

namespace sweepfit {
namespace {

constexpr int kGirthRays = 48;
constexpr int kGirthIterations = 5;
// Beyond this distance from the mid plane, in statures, the surface of one leg
// does not feel the other.
constexpr double kLegsReach = 0.03;
// The foot's solid reaches less than this above the ankle, in statures.
constexpr double kFootReach = 0.04;
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
  constexpr int kMaxRefinements = 40;
  double inside = 0;
  double outside = 0;
  double value = distance(origin);
  double value_inside = value;
  for (int i = 0; i < kMaxSteps && value < 0; ++i) {
    inside = outside;
    value_inside = value;
    outside += std::max(step, -kTrust * value);
    value = distance(origin + outside * direction);
  }
  // False position (Illinois).
  double value_outside = value;
  const double tolerance = 1e-7 * step;
  int last_side = 0;
  for (int i = 0; i < kMaxRefinements && outside - inside > tolerance; ++i) {
    const double at = (inside * value_outside - outside * value_inside) /
                      (value_outside - value_inside);
    value = distance(origin + at * direction);
    if (std::abs(value) < tolerance) return at;
    const int side = value < 0 ? -1 : 1;
    if (side < 0) {
      inside = at;
      value_inside = value;
      if (last_side == side) value_outside /= 2;
    } else {
      outside = at;
      value_outside = value;
      if (last_side == side) value_inside /= 2;
    }
    last_side = side;
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

double TemplateSolid::ScaleAt(const std::string& part, double level) const {
  // Between the levels of two girths their scales are blended.
  std::vector<std::pair<double, double>> level_scale;
  for (size_t i = 0; i < tables_.girths.size(); ++i) {
    if (tables_.girths[i].part == part)
      level_scale.push_back({tables_.girths[i].level, girth_scale_[i]});
  }
  if (level_scale.empty()) return 1;
  // Shoulders keep their size whatever the chest.
  if (part == "trunk")
    level_scale.push_back({tables_.trunk.sections.back().s, 1.0});
  std::sort(level_scale.begin(), level_scale.end());
  double scale = level_scale.front().second;
  for (size_t i = 0; i < level_scale.size(); ++i) {
    const auto [key, value] = level_scale[i];
    if (level < key) break;
    scale = value;
    if (i + 1 < level_scale.size()) {
      const auto [next_key, next_value] = level_scale[i + 1];
      scale +=
          SmoothStep((level - key) / (next_key - key)) * (next_value - value);
    }
  }
  return scale;
}

std::vector<StackSection> TemplateSolid::Scaled(const SectionTable& table,
                                                const std::string& part) const {
  std::vector<StackSection> sections = table.sections;
  for (StackSection& section : sections) {
    const double scale = ScaleAt(part, section.s);
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
                        table.round_end * stature_,
                        table.smooth * stature_);
  };
  const auto build_arm = [&] {
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
                        tables_.arm.round_end * stature_,
                        tables_.arm.smooth * stature_);
  };
  const auto build_leg = [&] {
    std::vector<StackSection> leg = metric(Scaled(tables_.leg, "leg"));
    for (StackSection& section : leg) {
      const Eigen::Vector3d axis =
          LegAxis(section.s / stature_) - joints_[kLHip];
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
                        tables_.leg.round_end * stature_,
                        tables_.leg.smooth * stature_);
  };
  const Eigen::Vector3d& ankle = joints_[kLAnkle];
  const auto build_foot = [&] {
    foot_ = SectionStack({ankle.x(), 0, ankle.z()},
                         foot_lateral_,
                         y,
                         foot_forward_,
                         metric(Scaled(tables_.foot, "foot")),
                         tables_.foot.round_start * stature_,
                         tables_.foot.round_end * stature_,
                         tables_.foot.smooth * stature_);
  };
  tbb::parallel_invoke([&] { trunk_ = upright(tables_.trunk, "trunk"); },
                       [&] { neck_ = upright(tables_.neck, "neck"); },
                       [&] { head_ = upright(tables_.head, "head"); },
                       build_arm,
                       build_leg,
                       build_foot);

  // Above, the legs are not felt on the surface.
  leg_top_ =
      joints_[kLHip].y() - leg_.start() + 2 * tables_.blend.leg * stature_;

  // Above, the foot is not felt on the surface of the leg.
  foot_top_ = ankle.y() + (kFootReach + tables_.blend.foot) * stature_;
  BuildDigits();
  BuildFeatures();
}

void TemplateSolid::BuildDigits() {
  const Eigen::Vector3d& wrist = joints_[kLWrist];
  const double hand = (joints_[kLHandEnd] - wrist).norm();
  auto build = [](const DigitTable& table, double unit, auto&& place) {
    Tube tube;
    for (size_t i = 0; i < table.point.size(); ++i) {
      tube.point.push_back(place(table.point[i]));
      tube.radius.push_back(unit * table.radius[i]);
    }
    // The last sphere ends at the given point.
    Eigen::Vector3d& tip = tube.point.back();
    const Eigen::Vector3d& before = tube.point[tube.point.size() - 2];
    tip -= tube.radius.back() * (tip - before).normalized();
    return tube;
  };
  for (size_t i = 0; i < finger_.size(); ++i) {
    finger_[i] =
        build(tables_.finger[i],
              hand,
              [&](const Eigen::Vector3d& p) -> Eigen::Vector3d {
                return wrist + hand * (p.x() * arm_along_ + p.y() * arm_thumb_ +
                                       p.z() * arm_palm_);
              });
    toe_[i] = build(tables_.toe[i], stature_, [&](const Eigen::Vector3d& p) {
      return Place("foot", p).point;
    });
  }
  around_fingers_ = TubeBound(finger_);
  around_toes_ = TubeBound(toe_);
}

TemplateSolid::Placement TemplateSolid::Place(const std::string& part,
                                              const Eigen::Vector3d& at) const {
  // Centre of the table's section at a level, in its two axes.
  auto table_center = [&](const SectionTable& table, double level) {
    const auto& rows = table.sections;
    size_t i = 1;
    while (i + 1 < rows.size() && rows[i].s < level) ++i;
    const double t = std::clamp(
        (level - rows[i - 1].s) / (rows[i].s - rows[i - 1].s), 0.0, 1.0);
    return Eigen::Vector2d(
        rows[i - 1].center_x + t * (rows[i].center_x - rows[i - 1].center_x),
        rows[i - 1].center_y + t * (rows[i].center_y - rows[i - 1].center_y));
  };
  Placement placement;
  if (part == "arm" || part == "leg") {
    const bool is_arm = part == "arm";
    const SectionTable& table = is_arm ? tables_.arm : tables_.leg;
    placement.scale = ScaleAt(part, at.x());
    if (is_arm) {
      placement.axes << arm_along_, arm_thumb_, arm_palm_;
    } else {
      placement.axes << -Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitX(),
          Eigen::Vector3d::UnitZ();
    }
    const Eigen::Vector2d offset =
        placement.scale * (at.tail<2>() - table_center(table, at.x()));
    placement.point = (is_arm ? ArmCenter(at.x()) : LegCenter(at.x())) +
                      stature_ * placement.axes.rightCols<2>() * offset;
  } else if (part == "foot") {
    placement.axes << foot_forward_, foot_lateral_, Eigen::Vector3d::UnitY();
    const Eigen::Vector3d& ankle = joints_[kLAnkle];
    placement.point = Eigen::Vector3d(ankle.x(), 0, ankle.z()) +
                      stature_ * placement.axes * at;
  } else {
    placement.axes.setIdentity();
    placement.point = stature_ * at;
    if (part != "head") {
      const SectionTable& table =
          part == "trunk" ? tables_.trunk : tables_.neck;
      placement.scale = ScaleAt(part, at.y());
      const Eigen::Vector2d center = table_center(table, at.y());
      placement.point.x() *= placement.scale;
      placement.point.z() =
          stature_ * (center.y() + placement.scale * (at.z() - center.y()));
    }
  }
  return placement;
}

void TemplateSolid::BuildFeatures() {
  for (auto* features : {&trunk_features_,
                         &head_features_,
                         &arm_features_,
                         &leg_features_,
                         &foot_features_}) {
    features->clear();
  }
  auto features_of = [&](const std::string& part) -> std::vector<Feature>& {
    return part == "head"   ? head_features_
           : part == "arm"  ? arm_features_
           : part == "leg"  ? leg_features_
           : part == "foot" ? foot_features_
                            : trunk_features_;
  };
  // Limbs are built on the left only.
  auto is_paired = [](const std::string& part, double x) {
    return (part == "trunk" || part == "neck" || part == "head") && x != 0;
  };
  const Eigen::Vector3d mirror(-1, 1, 1);
  for (const BlobTable& entry : tables_.blobs) {
    const Placement placement = Place(entry.part, entry.blob.center);
    Blob blob = entry.blob;
    blob.center = placement.point;
    const bool is_limb = entry.part == "arm" || entry.part == "leg";
    Eigen::Vector3d scale(placement.scale, placement.scale, placement.scale);
    scale[is_limb ? 0 : 1] = 1;  // along the part
    blob.radii = stature_ * blob.radii.cwiseProduct(scale);
    blob.blend_width *= stature_;
    blob.world_from_blob = placement.axes * blob.world_from_blob;
    std::vector<Feature>& features = features_of(entry.part);
    features.push_back(Feature(blob));
    if (!is_paired(entry.part, blob.center.x())) continue;
    blob.center = blob.center.cwiseProduct(mirror);
    blob.world_from_blob = mirror.asDiagonal() * blob.world_from_blob;
    features.push_back(Feature(blob));
  }
  for (const TubeTable& entry : tables_.tubes) {
    Tube tube = entry.tube;
    double farthest = 0;
    for (size_t i = 0; i < tube.point.size(); ++i) {
      const Placement placement = Place(entry.part, tube.point[i]);
      tube.point[i] = placement.point;
      tube.radius[i] *= stature_ * placement.scale;
      farthest = std::max(farthest, std::abs(placement.point.x()));
    }
    const double width = entry.blend_width * stature_;
    std::vector<Feature>& features = features_of(entry.part);
    features.push_back(Feature(tube, width, entry.carve));
    if (!is_paired(entry.part, farthest)) continue;
    for (Eigen::Vector3d& point : tube.point)
      point = point.cwiseProduct(mirror);
    features.push_back(Feature(tube, width, entry.carve));
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
  }
  if (height > neck_.start() - reach)
    trunk = SmoothMin(trunk, neck_.Distance(point), blend.neck * stature_);
  for (const Feature& feature : trunk_features_)
    trunk = feature.Apply(trunk, point);
  if (height < head_.start() - reach) return trunk;
  double head = head_.Distance(point);
  for (const Feature& feature : head_features_)
    head = feature.Apply(head, point);
  return SmoothMin(trunk, head, blend.head * stature_);
}

double TemplateSolid::Arm(const Eigen::Vector3d& point) const {
  double arm = arm_.Distance(point);
  for (const Feature& feature : arm_features_) arm = feature.Apply(arm, point);
  return arm;
}

double TemplateSolid::Finger(int finger, const Eigen::Vector3d& point) const {
  return finger_[finger].Distance(point);
}

double TemplateSolid::ArmAndHand(const Eigen::Vector3d& point) const {
  return WithDigits(
      Arm(point), finger_, around_fingers_, tables_.blend.finger, point);
}

double TemplateSolid::WithDigits(double solid,
                                 const std::array<Tube, 5>& digits,
                                 const TubeBound& bound,
                                 double blend,
                                 const Eigen::Vector3d& point) const {
  const double width = blend * stature_;
  if (bound.Distance(point) > solid + width) return solid;
  double nearest = digits[0].Distance(point);
  for (size_t i = 1; i < digits.size(); ++i)
    nearest = std::min(nearest, digits[i].Distance(point));
  return SmoothMin(solid, nearest, width);
}

double TemplateSolid::Leg(const Eigen::Vector3d& point) const {
  double leg = leg_.Distance(point);
  for (const Feature& feature : leg_features_) leg = feature.Apply(leg, point);
  return leg;
}

double TemplateSolid::Foot(const Eigen::Vector3d& point) const {
  double foot = foot_.Distance(point);
  for (const Feature& feature : foot_features_)
    foot = feature.Apply(foot, point);
  return foot;
}

double TemplateSolid::Toe(int toe, const Eigen::Vector3d& point) const {
  return toe_[toe].Distance(point);
}

double TemplateSolid::LegAndFoot(const Eigen::Vector3d& point) const {
  const TemplateBlend& blend = tables_.blend;
  if (point.y() > foot_top_) return Leg(point);
  double foot = WithDigits(Foot(point), toe_, around_toes_, blend.toe, point);
  // The floor flattens the sole.
  foot = -SmoothMin(-foot, point.y(), blend.sole * stature_);
  return SmoothMin(Leg(point), foot, blend.foot * stature_);
}

double TemplateSolid::Body(const Eigen::Vector3d& point) const {
  const TemplateBlend& blend = tables_.blend;
  const Eigen::Vector3d left(std::abs(point.x()), point.y(), point.z());
  const Eigen::Vector3d right = Mirrored(left);
  // The arms are never near each other, the legs are near the mid plane.
  const double trunk =
      SmoothMin(Trunk(left), ArmAndHand(left), blend.arm * stature_);
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
