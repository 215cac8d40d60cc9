// SPDX-License-Identifier: Apache-2.0
#include "volume/cut_plane.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace sweepfit {
namespace {

// How far from the seed the section may begin, metres.
constexpr double kSeedRadius = 0.03;

// Level set values on a square of the plane, looked up when they are asked for:
// most of the square is far from the section.
class PlaneGrid {
 public:
  PlaneGrid(const Volume& volume,
            const Eigen::Vector3d& center_in_world,
            const Eigen::Vector3d& unit_normal,
            double half_size)
      : volume_(volume),
        center_in_world_(center_in_world),
        axis_a_(unit_normal.unitOrthogonal()),
        axis_b_(unit_normal.cross(axis_a_)),
        spacing_(volume.voxel_size()),
        half_(std::max(1, static_cast<int>(std::ceil(half_size / spacing_)))),
        value_(static_cast<size_t>(side()) * side(), kUnknown) {}

  double spacing() const { return spacing_; }
  int half() const { return half_; }  // samples to either side of the centre
  int side() const { return 2 * half_ + 1; }
  size_t size() const { return value_.size(); }

  double At(int index) {
    double& value = value_[index];
    if (std::isnan(value)) {
      const Eigen::Vector3d row =
          center_in_world_ + spacing_ * (index / side() - half_) * axis_a_;
      value =
          volume_.Sample(row + spacing_ * (index % side() - half_) * axis_b_);
    }
    return value;
  }

  Eigen::Vector3d InWorld(const Eigen::Vector2d& point) const {
    return center_in_world_ + point.x() * axis_a_ + point.y() * axis_b_;
  }
  Eigen::Vector3d DirectionInWorld(const Eigen::Vector2d& direction) const {
    return direction.x() * axis_a_ + direction.y() * axis_b_;
  }

 private:
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  const Volume& volume_;
  Eigen::Vector3d center_in_world_;
  Eigen::Vector3d axis_a_, axis_b_;  // unit, in the plane
  double spacing_;
  int half_;
  std::vector<double> value_;
};

// The inside sample nearest to the centre within kSeedRadius, or -1.
int FindSeed(PlaneGrid* grid) {
  const int reach =
      std::min(grid->half(),
               static_cast<int>(std::floor(kSeedRadius / grid->spacing())));
  int best = -1;
  int best_distance = reach * reach + 1;
  for (int a = -reach; a <= reach; ++a) {
    for (int b = -reach; b <= reach; ++b) {
      const int distance = a * a + b * b;
      const int at = (a + grid->half()) * grid->side() + b + grid->half();
      if (distance < best_distance && grid->At(at) < 0) {
        best = at;
        best_distance = distance;
      }
    }
  }
  return best;
}

// Marks the inside samples connected to the seed with 2 and the first outside
// samples around them, which the section may cover in part, with 1.
std::vector<char> Flood(int seed, PlaneGrid* grid, bool* touches_border) {
  const int side = grid->side();
  std::vector<char> mark(grid->size(), 0);
  std::vector<int> stack = {seed};
  mark[seed] = 2;
  *touches_border = false;
  while (!stack.empty()) {
    const int at = stack.back();
    stack.pop_back();
    const int a = at / side;
    const int b = at % side;
    if (a == 0 || b == 0 || a == side - 1 || b == side - 1) {
      *touches_border = true;
      continue;
    }
    for (const int next : {at - side, at + side, at - 1, at + 1}) {
      if (mark[next] == 2) continue;
      if (grid->At(next) < 0) {
        mark[next] = 2;
        stack.push_back(next);
      } else {
        mark[next] = 1;
      }
    }
  }
  return mark;
}

}  // namespace

CutPlaneSection CutPlane(const Volume& volume,
                         const Eigen::Vector3d& seed_in_world,
                         const Eigen::Vector3d& unit_normal,
                         double half_size) {
  CutPlaneSection section;
  PlaneGrid grid(volume, seed_in_world, unit_normal, half_size);
  const int seed = FindSeed(&grid);
  if (seed < 0) return section;
  const std::vector<char> mark = Flood(seed, &grid, &section.touches_border);

  const int side = grid.side();
  double mass = 0;
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  for (size_t i = 0; i < mark.size(); ++i) {
    if (mark[i] == 0) continue;
    const double covered = std::clamp(
        0.5 - grid.At(static_cast<int>(i)) / grid.spacing(), 0.0, 1.0);
    const Eigen::Vector2d p =
        grid.spacing() *
        Eigen::Vector2d(static_cast<int>(i) / side - grid.half(),
                        static_cast<int>(i) % side - grid.half());
    mass += covered;
    first += covered * p;
    second += covered * p * p.transpose();
  }
  if (!(mass > 0)) return section;
  section.found = true;
  section.area = mass * grid.spacing() * grid.spacing();
  const Eigen::Vector2d centroid = first / mass;
  section.centroid_in_world = grid.InWorld(centroid);
  const Eigen::Matrix2d covariance =
      second / mass - centroid * centroid.transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen;
  eigen.computeDirect(covariance);
  section.half_axis_short =
      2 * std::sqrt(std::max(0.0, eigen.eigenvalues()[0]));
  section.half_axis_long = 2 * std::sqrt(std::max(0.0, eigen.eigenvalues()[1]));
  const Eigen::Vector2d direction = eigen.eigenvectors().col(1);
  section.long_direction = grid.DirectionInWorld(direction);
  return section;
}

double RayExit(const Volume& volume,
               const Eigen::Vector3d& origin_in_world,
               const Eigen::Vector3d& unit_direction,
               double max_distance) {
  // The max of cones may change faster than a distance: shorter steps.
  constexpr double kStepShare = 0.7;
  const double min_step = 0.25 * volume.voxel_size();
  double before = 0;
  double value_before = volume.Sample(origin_in_world);
  if (value_before >= 0) return 0;
  while (before < max_distance) {
    const double at = std::min(
        max_distance, before + std::max(min_step, -kStepShare * value_before));
    const double value = volume.Sample(origin_in_world + at * unit_direction);
    if (value >= 0) {
      return before + (at - before) * value_before / (value_before - value);
    }
    before = at;
    value_before = value;
  }
  return -1;
}

}  // namespace sweepfit
