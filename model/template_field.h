// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace sweepfit {

// Smooth minimum of two signed distances: exact where they differ by more than
// `width`, at most width / 4 below the smaller one. Width 0: the minimum.
double SmoothMin(double a, double b, double width);

// A superellipse section of a stack: |x / a|^n + |y / b|^n = 1 around a centre,
// in the two axes of the stack's planes, at station s along its direction.
struct StackSection {
  double s = 0;
  double half_x = 0;
  double half_y = 0;
  double exponent = 2;
  double center_x = 0;
  double center_y = 0;
};

// A solid made of parallel star-shaped sections, interpolated by monotone
// cubics between the given stations and smoothed along the stack. Signed
// distances are approximate: exact zero set, gradient of about unit length near
// the surface, negative inside.
class SectionStack {
 public:
  SectionStack() = default;
  // `sections` ascend in s. The ends close as half ellipsoids of the lengths
  // round_start, round_end > 0 within the first and last section. `smooth`:
  // standard deviation of the smoothing, in the unit of s.
  SectionStack(const Eigen::Vector3d& origin,
               const Eigen::Vector3d& x_axis,
               const Eigen::Vector3d& y_axis,
               const Eigen::Vector3d& direction,
               const std::vector<StackSection>& sections,
               double round_start,
               double round_end,
               double smooth);

  double Distance(const Eigen::Vector3d& point) const;
  // Centre of the section at station s (clamped to the ends).
  Eigen::Vector3d Center(double s) const;
  double start() const { return start_; }
  double end() const { return start_ + step_ * (num_rows_ - 1); }

 private:
  double RadiusAt(double row, double column) const;
  void Smooth(double sigma);

  Eigen::Vector3d origin_, x_axis_, y_axis_, direction_;
  double start_ = 0, step_ = 1;
  double round_start_ = 1, round_end_ = 1;
  int num_rows_ = 0;
  std::vector<double> radius_;           // rows x kColumns
  std::vector<Eigen::Vector2d> center_;  // per row
};

// An ellipsoid with half axes `radii`, turned by world_from_blob.
struct Blob {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d radii = Eigen::Vector3d::Ones();
  Eigen::Matrix3d world_from_blob = Eigen::Matrix3d::Identity();
  double blend_width = 0;
  bool carve = false;  // subtract instead of add

  double Distance(const Eigen::Vector3d& point) const;
};

// A chain of round cones: points with radii.
struct Tube {
  std::vector<Eigen::Vector3d> point;
  std::vector<double> radius;

  double Distance(const Eigen::Vector3d& query) const;
  double Length() const;
  // Point of the axis at arc length s (beyond the ends: in a straight line).
  Eigen::Vector3d At(double s) const;
  // Unit direction of the axis at s, turning smoothly at the points of the
  // chain over `reach` before and after.
  Eigen::Vector3d Direction(double s, double reach) const;
};

// A sphere around all of some tubes: none of them is nearer to a point.
class TubeBound {
 public:
  TubeBound() = default;
  explicit TubeBound(std::span<const Tube> tubes);

  double Distance(const Eigen::Vector3d& query) const {
    return (query - center_).norm() - reach_;
  }

 private:
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  double reach_ = 0;
};

// A blob or a tube as an addition to a solid, or carved from it.
class Feature {
 public:
  explicit Feature(const Blob& blob);
  Feature(const Tube& tube, double blend_width, bool carve);

  // The distance of a solid after this was added to it or carved from it.
  double Apply(double solid, const Eigen::Vector3d& point) const;

 private:
  Blob blob_;
  Tube tube_;  // without points: the blob counts
  double blend_width_;
  bool carve_;
  TubeBound tube_bound_;
};

}  // namespace sweepfit
