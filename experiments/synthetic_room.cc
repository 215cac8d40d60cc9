// SPDX-License-Identifier: Apache-2.0
#include "experiments/synthetic_room.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "experiments/random.h"
#include "experiments/synthetic_clothes.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

constexpr double kCeiling = 3.2;
constexpr double kWainscot = 0.95;

// Distance to the nearest of the lines k * spacing, and the index of the cell.
struct Cell {
  double to_line;
  int index;
};
Cell CellOf(double x, double spacing) {
  const double index = std::floor(x / spacing);
  const double inside = x - index * spacing;
  return {std::min(inside, spacing - inside), static_cast<int>(index)};
}

}  // namespace

Room::Room(const Vector3d& center_in_world, double half_size, unsigned seed)
    : center_(center_in_world), half_size_(half_size) {
  Random random(0x726f6f6dull * 1000003 + seed);
  noise_seed_ = seed * 747796405u + 5;
  tile_size_ = random.Uniform(0.33, 0.6);
  panel_width_ = random.Uniform(0.8, 1.3);
  // Cool, weakly coloured greys: skin, the one colour that nobody chooses,
  // then stands out.
  const auto grey = [&](double low, double high) -> Vector3d {
    const double v = random.Uniform(low, high);
    const double green = random.Uniform(0.96, 1.08);
    const double blue = random.Uniform(0.98, 1.22);
    return v * Vector3d(1, green, blue);
  };
  floor_ = grey(0.16, 0.30);
  wainscot_ = grey(0.07, 0.16);
  wall_ = grey(0.30, 0.5);
}

Vector3d Room::FloorColor(const Vector3d& p) const {
  const Cell x = CellOf(p.x(), tile_size_), z = CellOf(p.z(), tile_size_);
  const double tile =
      ValueNoise({x.index + 0.0, z.index + 0.0, 0.0}, noise_seed_ + 1);
  const double grain = 0.06 * ValueNoise(p * 14, noise_seed_ + 2) +
                       0.05 * ValueNoise(p * 60, noise_seed_ + 3);
  const double grout = std::min(x.to_line, z.to_line) < 0.004 ? 0.55 : 1.0;
  return grout * (1 + 0.10 * tile + grain) * floor_;
}

Vector3d Room::WallColor(double along, double height, int wall) const {
  const Vector3d at(along, height, 10.0 * wall);
  const double grain = 1 + 0.04 * ValueNoise(at * 6, noise_seed_ + 4) +
                       0.03 * ValueNoise(at * 50, noise_seed_ + 5);
  if (std::abs(height - kWainscot) < 0.02) return 0.5 * grain * wainscot_;
  const Cell panel = CellOf(along, panel_width_);
  const double gap = panel.to_line < 0.006 ? 0.5 : 1.0;
  const double tint =
      1 +
      0.06 * ValueNoise({panel.index + 0.0, wall + 0.0, 3.0}, noise_seed_ + 6);
  return gap * grain * tint * (height < kWainscot ? wainscot_ : wall_);
}

Room::Hit Room::Trace(const Vector3d& origin, const Vector3d& direction) const {
  const Vector3d from = origin - center_;
  double nearest = std::numeric_limits<double>::infinity();
  int axis = 1;
  for (int i = 0; i < 3; ++i) {
    if (std::abs(direction[i]) < 1e-12) continue;
    const double low = i == 1 ? 0.0 : -half_size_;
    const double high = i == 1 ? kCeiling : half_size_;
    const double t = ((direction[i] > 0 ? high : low) - from[i]) / direction[i];
    if (t < nearest) {
      nearest = t;
      axis = i;
    }
  }
  return {from + nearest * direction, axis};
}

Vector3d Room::Color(const Vector3d& origin, const Vector3d& direction) const {
  const auto [p, axis] = Trace(origin, direction);
  // Light falls off towards the walls and corners.
  const double falloff = 1 / (1 + 0.035 * (p.x() * p.x() + p.z() * p.z()));
  if (axis == 1 && direction.y() > 0) return 0.8 * falloff * Vector3d::Ones();
  if (axis == 1) return 1.15 * falloff * FloorColor(p);
  const int wall = (axis == 0 ? 0 : 2) + (direction[axis] > 0 ? 1 : 0);
  return 1.25 * falloff * WallColor(axis == 0 ? p.z() : p.x(), p.y(), wall);
}

double Room::Shadow(const Vector3d& origin,
                    const Vector3d& direction,
                    const std::vector<ContactShadow>& shadows) const {
  const auto [p, axis] = Trace(origin, direction);
  if (axis != 1 || direction.y() > 0) return 1;
  double light = 1;
  for (const ContactShadow& shadow : shadows) {
    const Vector3d d = p + center_ - shadow.center_in_world;
    const double r2 =
        (d.x() * d.x() + d.z() * d.z()) / (shadow.radius * shadow.radius);
    light *= 1 - shadow.strength * std::exp(-r2);
  }
  return light;
}

}  // namespace sweepfit
