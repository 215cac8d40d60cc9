// SPDX-License-Identifier: Apache-2.0
#include "model/cross_section.h"

#include <glog/logging.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sweepfit {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

// Fine enough that the polygon of a circle falls short of its area by 1/40000
// and of its perimeter by 1/160000. A multiple of the number of samples, so
// that the polygon passes through them.
constexpr int kMinPolygonVertices = 512;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

Polygon Sample(const CrossSection& section) {
  const int num_radii = section.num_radii();
  CHECK_GT(num_radii, 0);
  const int per_radius = (kMinPolygonVertices + num_radii - 1) / num_radii;
  const int count = per_radius * num_radii;
  Polygon polygon(count);
  for (int i = 0; i < count; ++i) {
    const double theta = 2 * std::numbers::pi * i / count;
    polygon[i] = section.Radius(theta) *
                 Eigen::Vector2d(std::cos(theta), std::sin(theta));
  }
  return polygon;
}

double PolygonArea(const Polygon& polygon) {
  double twice_area = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    twice_area += Cross(polygon[i], polygon[(i + 1) % polygon.size()]);
  }
  return twice_area / 2;
}

double PolygonPerimeter(const Polygon& polygon) {
  double length = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    length += (polygon[(i + 1) % polygon.size()] - polygon[i]).norm();
  }
  return length;
}

// One chain of Andrew's monotone chain algorithm over sorted points.
template <typename Iterator>
Polygon HullChain(Iterator begin, Iterator end) {
  Polygon chain;
  for (Iterator p = begin; p != end; ++p) {
    while (chain.size() >= 2 && Cross(chain.back() - chain[chain.size() - 2],
                                      *p - chain.back()) <= 0) {
      chain.pop_back();
    }
    chain.push_back(*p);
  }
  chain.pop_back();  // begins the other chain
  return chain;
}

Polygon ConvexHull(Polygon points) {
  std::sort(points.begin(),
            points.end(),
            [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
              return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y());
            });
  Polygon hull = HullChain(points.begin(), points.end());
  const Polygon upper = HullChain(points.rbegin(), points.rend());
  hull.insert(hull.end(), upper.begin(), upper.end());
  return hull;
}

}  // namespace

CrossSection CrossSection::Superellipse(double a,
                                        double b,
                                        double n,
                                        int num_radii) {
  std::vector<double> radii(num_radii);
  for (int k = 0; k < num_radii; ++k) {
    const double theta = 2 * std::numbers::pi * k / num_radii;
    radii[k] = std::pow(std::pow(std::abs(std::cos(theta)) / a, n) +
                            std::pow(std::abs(std::sin(theta)) / b, n),
                        -1 / n);
  }
  return CrossSection(std::move(radii));
}

double CrossSection::Radius(double theta) const {
  const PeriodicWeights weights = PeriodicCubicWeights(theta, num_radii());
  double radius = 0;
  for (int i = 0; i < 4; ++i) {
    radius += weights.weight[i] * radii_[weights.index[i]];
  }
  return radius;
}

double CrossSection::Area() const { return PolygonArea(Sample(*this)); }

Eigen::Vector2d CrossSection::Centroid() const {
  const Polygon polygon = Sample(*this);
  Eigen::Vector2d moment = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d& a = polygon[i];
    const Eigen::Vector2d& b = polygon[(i + 1) % polygon.size()];
    moment += Cross(a, b) * (a + b);
  }
  return moment / (6 * PolygonArea(polygon));
}

double CrossSection::Perimeter() const {
  return PolygonPerimeter(Sample(*this));
}

double CrossSection::TapeGirth() const {
  return PolygonPerimeter(ConvexHull(Sample(*this)));
}

PeriodicWeights PeriodicCubicWeights(double theta, int num_radii) {
  CHECK_GT(num_radii, 0);
  const double position = theta * (num_radii / (2 * std::numbers::pi));
  const double cell = std::floor(position);
  const double t = position - cell;
  // In doubles, so that no angle overflows the integer.
  const int k =
      static_cast<int>(cell - num_radii * std::floor(cell / num_radii));

  PeriodicWeights weights;
  for (int i = 0; i < 4; ++i) {
    weights.index[i] = (k - 1 + i + num_radii) % num_radii;
  }
  const double t2 = t * t;
  const double t3 = t2 * t;
  weights.weight = {(-t3 + 2 * t2 - t) / 2,
                    (3 * t3 - 5 * t2 + 2) / 2,
                    (-3 * t3 + 4 * t2 + t) / 2,
                    (t3 - t2) / 2};
  return weights;
}

}  // namespace sweepfit
