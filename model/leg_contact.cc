// SPDX-License-Identifier: Apache-2.0
#include "model/leg_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// Where the legs part, as a share of the thigh: hip joints are .515 of stature
// high, the crotch .48 (ANSUR II), and a thigh is .233 long.
constexpr double kCrotch = 0.15;

// A piece of a leg: radius `start_radius` at the start of the bone, which grows
// by `growth` per metre.
struct Piece {
  Vector3d start;
  Vector3d direction;
  double length;
  double start_radius;
  double growth;

  Vector3d At(double along) const { return start + along * direction; }
  double RadiusAt(double along) const { return start_radius + along * growth; }
};

Piece PieceBetween(const Vector3d& start,
                   const Vector3d& end,
                   double start_radius,
                   double end_radius) {
  const Vector3d way = end - start;
  const double length = std::max(way.norm(), 1e-9);
  return {start,
          way / length,
          length,
          start_radius,
          (end_radius - start_radius) / length};
}

// Least of |point - x| - radius(x) over the points x of the bone.
double GapToPoint(const Piece& piece, const Vector3d& point) {
  const Vector3d offset = point - piece.start;
  const double foot = offset.dot(piece.direction);
  const double height = (offset - foot * piece.direction).norm();
  // Where the radius grows along the bone, the nearest point lies ahead of the
  // foot of the perpendicular.
  const double slope = std::clamp(piece.growth, -0.99, 0.99);
  const double along = std::clamp(
      foot + height * slope / std::sqrt(1 - slope * slope), 0.0, piece.length);
  return (point - piece.At(along)).norm() - piece.RadiusAt(along);
}

// Distance less radii is convex along both bones, so that a golden section
// search along one of them finds the least.
double GapBetween(const Piece& a, const Piece& b) {
  const auto gap = [&](double along) {
    return GapToPoint(b, a.At(along)) - a.RadiusAt(along);
  };
  constexpr double kGolden = 1 / std::numbers::phi;
  constexpr int kSections = 45;  // to 4e-10 of the bone
  double low = 0, high = a.length;
  double left = high - kGolden * (high - low);
  double right = low + kGolden * (high - low);
  double at_left = gap(left), at_right = gap(right);
  for (int i = 0; i < kSections; ++i) {
    if (at_left <= at_right) {
      high = right;
      right = left;
      at_right = at_left;
      left = high - kGolden * (high - low);
      at_left = gap(left);
    } else {
      low = left;
      left = right;
      at_left = at_right;
      right = low + kGolden * (high - low);
      at_right = gap(right);
    }
  }
  return std::min({at_left, at_right, gap(0), gap(a.length)});
}

}  // namespace

LegContact::LegContact(const Skeleton& skeleton,
                       double knee_breadth,
                       double foot_breadth) {
  for (int side = 0; side < 2; ++side) {
    const int hip = side == 0 ? kLHip : kRHip, knee = hip + 1, ankle = hip + 2;
    const double length = skeleton.length[knee] + skeleton.length[ankle];
    const double hip_breadth = skeleton.length[kLHip] + skeleton.length[kRHip];
    legs_[side] = {skeleton.length[hip] * skeleton.rest_direction[hip],
                   skeleton.length[knee] * skeleton.rest_direction[knee],
                   skeleton.length[ankle] * skeleton.rest_direction[ankle],
                   hip_breadth / 2,
                   knee_breadth * length / 2,
                   foot_breadth * length / 2};
  }
}

double LegContact::Gap(const Pose& pose) const {
  std::array<std::array<Piece, 2>, 2> pieces;
  for (int side = 0; side < 2; ++side) {
    const Leg& leg = legs_[side];
    const int hip = side == 0 ? kLHip : kRHip;
    const Eigen::Quaterniond& thigh = pose.rotation[hip];
    const Vector3d knee = leg.hip_in_root + thigh * leg.thigh;
    const Vector3d ankle = knee + thigh * (pose.rotation[hip + 1] * leg.shank);
    pieces[side] = {
        PieceBetween(
            leg.hip_in_root + kCrotch * (knee - leg.hip_in_root),
            knee,
            leg.hip_radius + kCrotch * (leg.knee_radius - leg.hip_radius),
            leg.knee_radius),
        PieceBetween(knee, ankle, leg.knee_radius, leg.ankle_radius)};
  }
  double gap = std::numeric_limits<double>::infinity();
  for (const Piece& left : pieces[0]) {
    for (const Piece& right : pieces[1]) {
      gap = std::min(gap, GapBetween(left, right));
    }
  }
  return gap;
}

}  // namespace sweepfit
