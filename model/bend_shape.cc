// SPDX-License-Identifier: Apache-2.0
#include "model/bend_shape.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "model/smooth_step.h"

namespace sweepfit {
namespace {

using Eigen::Matrix2Xd;
using Eigen::Vector2d;

constexpr int kSamplesPerBone = 28;
constexpr int kOutlinePoints = 24;
// Flesh that is pushed out of a bend goes to the outer side first.
constexpr double kSideways = 0.4;
constexpr double kMinSwell = -0.25;
constexpr double kMaxSwell = 0.6;
// The two sides of a fold stay this far apart at most, metres.
constexpr double kGap = 0.003;
constexpr double kGapShare = 0.04;
// Width of the smooth minimum, metres and as a share of the limit.
constexpr double kSoftness = 0.006;
constexpr double kSoftnessShare = 0.3;
// Towards the far end of a bone its section keeps its shape.
constexpr double kFadeBegin = 0.8;
// Bends below this, radians, have no hinge.
constexpr double kStraight = 1e-9;

// Where on a corner a section lies.
struct Place {
  double speed;      // |v|: |dc/du| / length of the bone
  double curvature;  // 1 / metre
  double reach;      // L / cot(phi / 2), metres
};

Place PlaceOf(const SweepAxis::Corner& corner, double from_joint) {
  const bool is_before = from_joint < 0;
  const double range = is_before ? corner.range_before : corner.range_after;
  const double distance = std::abs(from_joint) / range;  // in legs
  if (distance >= 1) return {1, 0, distance * corner.leg};
  const double w = 0.5 + 0.5 * from_joint / range;
  const double cosine = (1 - w) + w * corner.cos_bend;
  const double sine = w * corner.sin_bend;
  const double speed = std::hypot(cosine, sine);
  const double curvature =
      corner.sin_bend /
      (2 * corner.leg * std::max(1e-9, speed * speed * speed));
  return {speed, curvature, corner.leg * speed};
}

double Fade(double from_joint) {
  return SmoothStep((1 - std::abs(from_joint)) / (1 - kFadeBegin));
}

double SoftMin(double x, double limit, double width) {
  const double t = std::clamp(0.5 + 0.5 * (limit - x) / width, 0.0, 1.0);
  return t * x + (1 - t) * limit - width * t * (1 - t);
}

// The map of a section, in coordinates n (inwards) and b (along the hinge).
struct SectionMap {
  double swell;   // s - 1
  double limit;   // of n from the axis, metres
  double offset;  // n of the section centre from the axis
  double fade;

  Vector2d operator()(const Vector2d& point) const {
    const double n = point.x();
    const double swollen = n < 0 ? n * (1 + swell) : n;
    const double width =
        std::min(kSoftness, kSoftnessShare * std::max(limit, 1e-4));
    const double cut = SoftMin(swollen + offset, limit, width) - offset;
    const Vector2d mapped(cut, point.y() * (1 + kSideways * swell));
    return point + fade * (mapped - point);
  }
};

// Integral of 1 - curvature n over the polygon, n from the axis.
double Integral(const Matrix2Xd& outline, double curvature, double offset) {
  const int count = static_cast<int>(outline.cols());
  double area = 0;    // twice
  double moment = 0;  // six times
  for (int i = 0; i < count; ++i) {
    const int j = i + 1 < count ? i + 1 : 0;
    const double cross =
        outline(0, i) * outline(1, j) - outline(0, j) * outline(1, i);
    area += cross;
    moment += cross * (outline(0, i) + outline(0, j));
  }
  return 0.5 * area * (1 - curvature * offset) - curvature * moment / 6;
}

// The directions n and b of a section, in its (e1, e2).
Eigen::Matrix2d InwardAndHinge(const Eigen::Matrix3d& world_from_section,
                               const SweepAxis::Corner& corner) {
  const Vector2d hinge =
      (world_from_section.transpose() * corner.hinge_in_world).head<2>();
  // inward = hinge x tangent. As rows: applied to (e1, e2) gives (n, b). The
  // order keeps the orientation of the plane.
  Eigen::Matrix2d rows;
  rows << hinge.y(), -hinge.x(), hinge.x(), hinge.y();
  return rows;
}

double Limit(double cot_half, double reach) {
  const double limit = cot_half * reach;
  return limit - std::min(kGap, kGapShare * limit);
}

// cot(phi / 2), 0 for a corner without a hinge.
double CotHalf(const SweepAxis::Corner& corner) {
  const double bend = std::atan2(corner.sin_bend, corner.cos_bend);
  return bend < kStraight ? 0 : 1 / std::tan(0.5 * bend);
}

// The map of the section at `from_joint`, without any swell.
SectionMap MapAt(const SweepAxis::Corner& corner,
                 double cot_half,
                 double from_joint,
                 double offset_inward) {
  return {0,
          Limit(cot_half, PlaceOf(corner, from_joint).reach),
          offset_inward,
          Fade(from_joint)};
}

}  // namespace

BendZones::BendZones(const Sweep& sweep, const SweepAxis& rest_axis)
    : rest_axis_(rest_axis), swells_(sweep.chain.front() != kRoot) {
  for (int k = 0; k < rest_axis.num_corners(); ++k) {
    const int joint = sweep.chain[k + 1];
    is_limited_.push_back(joint != kNeck && joint != kHead);
  }
  corner_.resize(rest_axis.num_corners());
  for (int k = 0; k < rest_axis.num_corners(); ++k) {
    const SweepAxis::Corner& corner = rest_axis.corner(k);
    for (int i = 0; i < 2 * kSamplesPerBone; ++i) {
      Section section;
      const double from_joint = (i + 0.5) / kSamplesPerBone - 1;
      section.u = k + 1 + from_joint;
      section.offset = CenterOffset(sweep, section.u);
      section.outline.resize(2, kOutlinePoints);
      for (int m = 0; m < kOutlinePoints; ++m) {
        const double theta = 2 * std::numbers::pi * m / kOutlinePoints;
        section.outline.col(m) = Radius(sweep, section.u, theta) *
                                 Vector2d(std::cos(theta), std::sin(theta));
      }
      const Eigen::Matrix3d frame =
          rest_axis.OnAxis(section.u).world_from_section;
      section.rest_change.resize(2, kOutlinePoints);
      for (int m = 0; m < kOutlinePoints; ++m) {
        section.rest_change.col(m) = RestChange(
            section.u, frame, section.offset, section.outline.col(m));
      }
      const Place place = PlaceOf(corner, from_joint);
      const Eigen::Matrix2d to_hinge = InwardAndHinge(frame, corner);
      section.volume_by_u =
          place.speed * Integral(to_hinge * section.outline,
                                 place.curvature,
                                 to_hinge.row(0).dot(section.offset));
      corner_[k].push_back(std::move(section));
    }
  }
}

Vector2d BendZones::RestChange(double u,
                               const Eigen::Matrix3d& world_from_section,
                               const Vector2d& offset,
                               const Vector2d& point) const {
  Vector2d change = Vector2d::Zero();
  for (int k = 0; k < rest_axis_.num_corners(); ++k) {
    const double from_joint = u - (k + 1);
    const SweepAxis::Corner& corner = rest_axis_.corner(k);
    const double cot_half = CotHalf(corner);
    if (cot_half == 0 || !is_limited_[k] || std::abs(from_joint) >= 1) {
      continue;
    }
    const Eigen::Matrix2d to_hinge = InwardAndHinge(world_from_section, corner);
    const Vector2d in_hinge = to_hinge * point;
    const SectionMap map =
        MapAt(corner, cot_half, from_joint, to_hinge.row(0).dot(offset));
    change += to_hinge.transpose() * (map(in_hinge) - in_hinge);
  }
  return change;
}

BendShape::BendShape(const BendZones& zones, const SweepAxis& posed_axis)
    : zones_(zones), axis_(posed_axis), profile_(posed_axis.num_corners()) {
  for (int k = 0; k < posed_axis.num_corners(); ++k) SolveCorner(k);
}

void BendShape::SolveCorner(int index) {
  const SweepAxis::Corner& corner = axis_.corner(index);
  Profile& profile = profile_[index];
  if (!zones_.is_limited_[index]) return;
  profile.cot_half = CotHalf(corner);
  if (profile.cot_half == 0 || !zones_.swells_) return;

  const std::vector<BendZones::Section>& sections = zones_.corner_[index];
  const int count = static_cast<int>(sections.size());
  struct Slice {
    Matrix2Xd outline;  // (n, b) from the centre
    Matrix2Xd rest_change;
    Place place;
    SectionMap map;
    double VolumeByU(double swell) {
      map.swell = swell;
      Matrix2Xd mapped(2, outline.cols());
      for (int m = 0; m < outline.cols(); ++m) {
        mapped.col(m) = map(outline.col(m)) - rest_change.col(m);
      }
      return place.speed * Integral(mapped, place.curvature, map.offset);
    }
  };
  std::vector<Slice> slices(count);
  std::vector<double>& swell = profile.swell;
  swell.assign(count, 0);
  for (int i = 0; i < count; ++i) {
    const BendZones::Section& section = sections[i];
    Slice& slice = slices[i];
    const double from_joint = section.u - (index + 1);
    const Eigen::Matrix2d to_hinge =
        InwardAndHinge(axis_.OnAxis(section.u).world_from_section, corner);
    slice.outline = to_hinge * section.outline;
    slice.rest_change = to_hinge * section.rest_change;
    slice.place = PlaceOf(corner, from_joint);
    slice.map = MapAt(corner,
                      profile.cot_half,
                      from_joint,
                      to_hinge.row(0).dot(section.offset));
    // The secant method; the volume is nearly quadratic in s.
    double last = 0;
    double volume_last = slice.VolumeByU(last);
    const double wanted = section.volume_by_u;
    if (std::abs(volume_last - wanted) <= 1e-9 * wanted) continue;
    double now = volume_last < wanted ? 0.1 : -0.1;
    for (int round = 0; round < 4; ++round) {
      const double volume = slice.VolumeByU(now);
      const double slope = (volume - volume_last) / (now - last);
      if (!(slope > 0.05 * wanted)) {  // nothing left to swell
        now = volume < wanted ? kMaxSwell : kMinSwell;
        break;
      }
      last = now;
      volume_last = volume;
      now = std::clamp(now - (volume - wanted) / slope, kMinSwell, kMaxSwell);
      if (std::abs(now - last) < 1e-7) break;
    }
    swell[i] = now;
  }
  // Binomial smoothing; what it takes from the corner's volume the amplitude
  // gives back.
  for (int pass = 0; pass < 4; ++pass) {
    std::vector<double> smooth = swell;
    for (int i = 0; i < count; ++i) {
      const double before = i > 0 ? swell[i - 1] : 0;
      const double after = i + 1 < count ? swell[i + 1] : 0;
      smooth[i] = 0.25 * (before + 2 * swell[i] + after);
    }
    swell = smooth;
  }
  const auto excess = [&](double amplitude) {
    double sum = 0;
    for (int i = 0; i < count; ++i) {
      if (swell[i] == 0) continue;
      const double s = std::clamp(amplitude * swell[i], kMinSwell, kMaxSwell);
      sum += slices[i].VolumeByU(s) - sections[i].volume_by_u;
    }
    return sum;
  };
  double last = 1, now = 1.02;
  double excess_last = excess(last);
  double size = 0;
  for (const BendZones::Section& section : sections) {
    size += section.volume_by_u;
  }
  if (std::abs(excess_last) < 1e-10 * size) return;
  for (int round = 0; round < 4; ++round) {
    const double value = excess(now);
    const double slope = (value - excess_last) / (now - last);
    if (slope == 0) break;
    last = now;
    excess_last = value;
    now = std::clamp(now - value / slope, 0.5, 1.6);
    if (std::abs(now - last) < 1e-6) break;
  }
  for (double& s : swell) s = std::clamp(now * s, kMinSwell, kMaxSwell);
}

double BendShape::Swell(int corner, double u) const {
  const std::vector<double>& swell = profile_[corner].swell;
  const int count = static_cast<int>(swell.size());
  if (count == 0) return 0;
  const double position =
      (u - corner) * kSamplesPerBone - 0.5;  // in samples from the first
  const int below = static_cast<int>(std::floor(position));
  const auto at = [&](int i) { return i < 0 || i >= count ? 0.0 : swell[i]; };
  const double f = position - below;
  return (1 - f) * at(below) + f * at(below + 1);
}

Vector2d BendShape::Change(double u,
                           const Eigen::Matrix3d& world_from_section,
                           const Vector2d& offset,
                           const Vector2d& point) const {
  Vector2d change = Vector2d::Zero();
  for (int k = 0; k < axis_.num_corners(); ++k) {
    const double from_joint = u - (k + 1);
    const double cot_half = profile_[k].cot_half;
    if (cot_half == 0 || std::abs(from_joint) >= 1) continue;
    const SweepAxis::Corner& corner = axis_.corner(k);
    const Eigen::Matrix2d to_hinge = InwardAndHinge(world_from_section, corner);
    const Vector2d in_hinge = to_hinge * point;
    SectionMap map =
        MapAt(corner, cot_half, from_joint, to_hinge.row(0).dot(offset));
    map.swell = Swell(k, u);
    change += to_hinge.transpose() * (map(in_hinge) - in_hinge);
  }
  return change;
}

}  // namespace sweepfit
