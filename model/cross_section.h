// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <utility>
#include <vector>

namespace sweepfit {

// A star-shaped closed curve around a centre in the plane of a section frame:
// p(theta) = r(theta) (cos theta, sin theta). The scalar radius function r is
// sampled at theta_k = 2 pi k / K and interpolated by a periodic Catmull-Rom
// spline of the samples. Metres.
class CrossSection {
 public:
  CrossSection() = default;
  explicit CrossSection(std::vector<double> radii) : radii_(std::move(radii)) {}

  // r(theta) = ((|cos|/a)^n + (|sin|/b)^n)^(-1/n), K samples.
  static CrossSection Superellipse(double a, double b, double n, int num_radii);

  int num_radii() const { return static_cast<int>(radii_.size()); }
  const std::vector<double>& radii() const { return radii_; }

  double Radius(double theta) const;
  double Area() const;
  Eigen::Vector2d Centroid() const;
  double Perimeter() const;
  // Length of a tape around the section: perimeter of its convex hull.
  double TapeGirth() const;

 private:
  std::vector<double> radii_;
};

// Weights of the samples k-1, k, k+1, k+2 (indices modulo K) in the periodic
// cubic interpolation at theta, for those who need the derivative of a radius
// by its samples. Used for the radius function and its log ratio alike.
struct PeriodicWeights {
  std::array<int, 4> index;
  std::array<double, 4> weight;
};
PeriodicWeights PeriodicCubicWeights(double theta, int num_radii);

}  // namespace sweepfit
