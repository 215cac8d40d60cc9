// SPDX-License-Identifier: Apache-2.0
#include "model/template_field.h"

#include <glog/logging.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace sweepfit {
namespace {

constexpr int kColumns = 96;
constexpr int kRows = 240;

// Slopes of a monotone cubic through (x, y), after Fritsch and Butland.
std::vector<double> MonotoneSlopes(const std::vector<double>& x,
                                   const std::vector<double>& y) {
  const int n = static_cast<int>(x.size());
  std::vector<double> slope(n, 0.0);
  auto secant = [&](int i) { return (y[i + 1] - y[i]) / (x[i + 1] - x[i]); };
  for (int i = 1; i + 1 < n; ++i) {
    const double before = secant(i - 1);
    const double after = secant(i);
    if (before * after <= 0) continue;
    const double h0 = x[i] - x[i - 1];
    const double h1 = x[i + 1] - x[i];
    const double w0 = 2 * h1 + h0;
    const double w1 = h1 + 2 * h0;
    slope[i] = (w0 + w1) / (w0 / before + w1 / after);
  }
  if (n > 1) {
    slope[0] = secant(0);
    slope[n - 1] = secant(n - 2);
  }
  return slope;
}

class MonotoneCurve {
 public:
  MonotoneCurve(std::vector<double> x, std::vector<double> y)
      : x_(std::move(x)), y_(std::move(y)), slope_(MonotoneSlopes(x_, y_)) {}

  double At(double x) const {
    if (x <= x_.front()) return y_.front();
    if (x >= x_.back()) return y_.back();
    const int i = static_cast<int>(std::upper_bound(x_.begin(), x_.end(), x) -
                                   x_.begin() - 1);
    const double h = x_[i + 1] - x_[i];
    const double t = (x - x_[i]) / h;
    const double t2 = t * t;
    const double t3 = t2 * t;
    return (2 * t3 - 3 * t2 + 1) * y_[i] + (t3 - 2 * t2 + t) * h * slope_[i] +
           (3 * t2 - 2 * t3) * y_[i + 1] + (t3 - t2) * h * slope_[i + 1];
  }

 private:
  std::vector<double> x_, y_, slope_;
};

MonotoneCurve Curve(const std::vector<StackSection>& sections,
                    double StackSection::*field) {
  std::vector<double> x, y;
  for (const StackSection& section : sections) {
    x.push_back(section.s);
    y.push_back(section.*field);
  }
  return MonotoneCurve(std::move(x), std::move(y));
}

double RoundConeDistance(const Eigen::Vector3d& query,
                         const Eigen::Vector3d& a,
                         const Eigen::Vector3d& b,
                         double radius_a,
                         double radius_b) {
  const Eigen::Vector3d axis = b - a;
  const double t =
      std::clamp((query - a).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return (query - a - t * axis).norm() - (radius_a + t * (radius_b - radius_a));
}

}  // namespace

double SmoothMin(double a, double b, double width) {
  const double gap = std::abs(a - b);
  if (gap >= width) return std::min(a, b);
  const double h = 1 - gap / width;
  return std::min(a, b) - h * h * width / 4;
}

SectionStack::SectionStack(const Eigen::Vector3d& origin,
                           const Eigen::Vector3d& x_axis,
                           const Eigen::Vector3d& y_axis,
                           const Eigen::Vector3d& direction,
                           const std::vector<StackSection>& sections,
                           double round_start,
                           double round_end,
                           double smooth)
    : origin_(origin),
      x_axis_(x_axis),
      y_axis_(y_axis),
      direction_(direction),
      round_start_(round_start),
      round_end_(round_end),
      num_rows_(kRows) {
  CHECK_GT(round_start, 0);
  CHECK_GT(round_end, 0);
  CHECK_GE(sections.size(), 2u);
  start_ = sections.front().s;
  const double end = sections.back().s;
  step_ = (end - start_) / (kRows - 1);
  CHECK_GT(step_, 0);
  const MonotoneCurve half_x = Curve(sections, &StackSection::half_x);
  const MonotoneCurve half_y = Curve(sections, &StackSection::half_y);
  const MonotoneCurve exponent = Curve(sections, &StackSection::exponent);
  const MonotoneCurve center_x = Curve(sections, &StackSection::center_x);
  const MonotoneCurve center_y = Curve(sections, &StackSection::center_y);
  radius_.resize(kRows * kColumns);
  center_.resize(kRows);
  std::array<double, kColumns> cosine, sine;
  for (int k = 0; k < kColumns; ++k) {
    const double theta = 2 * std::numbers::pi * k / kColumns;
    cosine[k] = std::abs(std::cos(theta));
    sine[k] = std::abs(std::sin(theta));
  }
  for (int row = 0; row < kRows; ++row) {
    const double s = start_ + step_ * row;
    const double a = half_x.At(s);
    const double b = half_y.At(s);
    const double n = exponent.At(s);
    center_[row] = {center_x.At(s), center_y.At(s)};
    for (int k = 0; k < kColumns; ++k) {
      radius_[row * kColumns + k] = std::pow(
          std::pow(cosine[k] / a, n) + std::pow(sine[k] / b, n), -1 / n);
    }
  }
  Smooth(smooth);
}

void SectionStack::Smooth(double sigma) {
  if (sigma <= 0) return;
  const int reach = static_cast<int>(std::ceil(3 * sigma / step_));
  std::vector<double> weight;
  double sum = 0;
  for (int i = -reach; i <= reach; ++i) {
    const double t = i * step_ / sigma;
    weight.push_back(std::exp(-0.5 * t * t));
    sum += weight.back();
  }
  const std::vector<double> radius = radius_;
  const std::vector<Eigen::Vector2d> center = center_;
  // At the ends the values go on in a straight line (a point reflection), so
  // that they keep their place there.
  for (int row = 0; row < num_rows_; ++row) {
    double* blurred = &radius_[row * kColumns];
    center_[row] *= weight[reach] / sum;
    for (int k = 0; k < kColumns; ++k) blurred[k] *= weight[reach] / sum;
    for (int i = 1; i <= reach; ++i) {
      const int room = std::min({i, row, num_rows_ - 1 - row});
      const double share = weight[reach + i] / sum;
      center_[row] += share * (center[row - room] + center[row + room]);
      const double* before = &radius[(row - room) * kColumns];
      const double* after = &radius[(row + room) * kColumns];
      for (int k = 0; k < kColumns; ++k) {
        blurred[k] += share * (before[k] + after[k]);
      }
    }
  }
}

double SectionStack::RadiusAt(double row, double column) const {
  const int i = std::clamp(static_cast<int>(row), 0, num_rows_ - 2);
  const double f = row - i;
  const int k0 = static_cast<int>(column) % kColumns;
  const int k1 = (k0 + 1) % kColumns;
  const double g = column - std::floor(column);
  const double* r0 = &radius_[i * kColumns];
  const double* r1 = r0 + kColumns;
  return (1 - f) * ((1 - g) * r0[k0] + g * r0[k1]) +
         f * ((1 - g) * r1[k0] + g * r1[k1]);
}

Eigen::Vector3d SectionStack::Center(double s) const {
  const double row =
      std::clamp((s - start_) / step_, 0.0, static_cast<double>(num_rows_ - 1));
  const int i = std::min(static_cast<int>(row), num_rows_ - 2);
  const Eigen::Vector2d c =
      (1 - (row - i)) * center_[i] + (row - i) * center_[i + 1];
  return origin_ + s * direction_ + c.x() * x_axis_ + c.y() * y_axis_;
}

double SectionStack::Distance(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d q = point - origin_;
  const double s = q.dot(direction_);
  const double last = num_rows_ - 1;
  const double row = std::clamp((s - start_) / step_, 0.0, last);
  const int i = std::min(static_cast<int>(row), num_rows_ - 2);
  const Eigen::Vector2d c =
      (1 - (row - i)) * center_[i] + (row - i) * center_[i + 1];
  const double x = q.dot(x_axis_) - c.x();
  const double y = q.dot(y_axis_) - c.y();
  const double rho = std::sqrt(x * x + y * y);
  double column =
      std::atan2(y, x) * (kColumns / (2 * std::numbers::pi)) + kColumns;
  if (column >= kColumns) column -= kColumns;
  const double radius = RadiusAt(row, column);

  // In a rounded end the section belongs to an ellipsoid with half axes
  // radius, radius and the length of the end.
  const double into_start = start_ + round_start_ - s;
  const double into_end = s - (end() - round_end_);
  if (into_start > 0 || into_end > 0) {
    const bool at_end = into_end > into_start;
    const double length = at_end ? round_end_ : round_start_;
    const double t = (at_end ? into_end : into_start) / length;
    const double across = rho / radius;
    const double k0 = std::sqrt(across * across + t * t);
    const double k1 = std::sqrt(across * across / (radius * radius) +
                                t * t / (length * length));
    if (k1 < 1e-12) return -std::min(radius, length);
    return k0 * (k0 - 1) / k1;
  }
  // Gradient length from the slopes along the axis and around the section.
  const double low = std::max(row - 1, 0.0);
  const double high = std::min(row + 1, last);
  const double along =
      (RadiusAt(high, column) - RadiusAt(low, column)) / ((high - low) * step_);
  const double around =
      (RadiusAt(row, column + 1) -
       RadiusAt(row, column > 1 ? column - 1 : column + kColumns - 1)) /
      (2 * 2 * std::numbers::pi / kColumns);
  const double slope = around / std::max(radius, rho);
  return (rho - radius) / std::sqrt(1 + along * along + slope * slope);
}

double Blob::Distance(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d q = world_from_blob.transpose() * (point - center);
  const double k0 = q.cwiseQuotient(radii).norm();
  const double k1 = q.cwiseQuotient(radii.cwiseProduct(radii)).norm();
  if (k1 < 1e-12) return -radii.minCoeff();
  return k0 * (k0 - 1) / k1;
}

double Tube::Distance(const Eigen::Vector3d& query) const {
  double best = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i + 1 < point.size(); ++i) {
    best =
        std::min(best,
                 RoundConeDistance(
                     query, point[i], point[i + 1], radius[i], radius[i + 1]));
  }
  return best;
}

double Tube::Length() const {
  double length = 0;
  for (size_t i = 0; i + 1 < point.size(); ++i)
    length += (point[i + 1] - point[i]).norm();
  return length;
}

Eigen::Vector3d Tube::At(double s) const {
  size_t i = 0;
  double length = (point[1] - point[0]).norm();
  while (i + 2 < point.size() && s > length) {
    s -= length;
    ++i;
    length = (point[i + 1] - point[i]).norm();
  }
  return point[i] + (s / length) * (point[i + 1] - point[i]);
}

Eigen::Vector3d Tube::Direction(double s, double reach) const {
  return (At(s + reach) - At(s - reach)).normalized();
}

TubeBound::TubeBound(std::span<const Tube> tubes) {
  double count = 0;
  for (const Tube& tube : tubes)
    count += static_cast<double>(tube.point.size());
  for (const Tube& tube : tubes) {
    for (const Eigen::Vector3d& p : tube.point) center_ += p / count;
  }
  for (const Tube& tube : tubes) {
    for (size_t i = 0; i < tube.point.size(); ++i) {
      reach_ =
          std::max(reach_, (tube.point[i] - center_).norm() + tube.radius[i]);
    }
  }
}

Feature::Feature(const Blob& blob)
    : blob_(blob), blend_width_(blob.blend_width), carve_(blob.carve) {}

Feature::Feature(const Tube& tube, double blend_width, bool carve)
    : tube_(tube),
      blend_width_(blend_width),
      carve_(carve),
      tube_bound_({&tube, 1}) {}

double Feature::Apply(double solid, const Eigen::Vector3d& point) const {
  // Far away nothing changes. The margin is for distances of ellipsoids,
  // which are too short off their axes.
  const double near = (carve_ ? -solid : solid) + blend_width_;
  double feature = 0;
  if (tube_.point.empty()) {
    const double gap = (point - blob_.center).norm() - blob_.radii.maxCoeff();
    if (gap > 0 && 0.5 * gap > near) return solid;
    feature = blob_.Distance(point);
  } else {
    if (tube_bound_.Distance(point) > near) return solid;
    feature = tube_.Distance(point);
  }
  return carve_ ? -SmoothMin(-solid, feature, blend_width_)
                : SmoothMin(solid, feature, blend_width_);
}

}  // namespace sweepfit
