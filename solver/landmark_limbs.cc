// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_limbs.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace sweepfit {
namespace {

using Polyline = std::vector<Eigen::Vector3d>;

// Points at equal distances along the polyline, both ends kept nearly.
Polyline Resample(const Polyline& line, double step, double max_length) {
  Polyline result = {line.front()};
  double carry = 0;
  double length = 0;
  for (size_t i = 1; i < line.size(); ++i) {
    const Eigen::Vector3d edge = line[i] - line[i - 1];
    const double edge_length = edge.norm();
    if (!(edge_length > 0)) continue;
    double at = step - carry;
    while (at <= edge_length) {
      result.push_back(line[i - 1] + edge * (at / edge_length));
      length += step;
      if (length >= max_length) return result;
      at += step;
    }
    carry = edge_length - (at - step);
  }
  return result;
}

// Gaussian mean along the line, sigma in samples; the window shrinks towards
// the ends so that these stay.
Polyline Smooth(const Polyline& line, double sigma) {
  const int count = static_cast<int>(line.size());
  const int reach = static_cast<int>(std::ceil(2.5 * sigma));
  Polyline result(line.size());
  for (int i = 0; i < count; ++i) {
    const int window = std::min({reach, i, count - 1 - i});
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0;
    for (int k = -window; k <= window; ++k) {
      const double weight = std::exp(-0.5 * k * k / (sigma * sigma));
      sum += weight * line[i + k];
      weights += weight;
    }
    result[i] = sum / weights;
  }
  return result;
}

Eigen::Vector3d Tangent(const Polyline& line, int i, int reach) {
  const int count = static_cast<int>(line.size());
  const int before = std::max(0, i - reach);
  const int after = std::min(count - 1, i + reach);
  const Eigen::Vector3d chord = line[after] - line[before];
  return chord.norm() > 0 ? chord.normalized() : Eigen::Vector3d::UnitY();
}

}  // namespace

LimbLine TraceLimb(const Volume& volume,
                   const std::vector<Eigen::Vector3d>& path_in_world,
                   const TraceOptions& options) {
  LimbLine result;
  if (path_in_world.size() < 2) return result;
  const double sigma = options.smoothing / options.step;
  const int reach = std::max(1, static_cast<int>(std::round(sigma)));
  Polyline line =
      Smooth(Resample(path_in_world, options.step, options.max_length), sigma);
  for (int pass = 0; pass <= options.iterations; ++pass) {
    const bool last = pass == options.iterations;
    const int count = static_cast<int>(line.size());
    std::vector<LimbSection> sections(line.size());
    tbb::parallel_for(0, count, [&](int i) {
      sections[i].point_in_world = line[i];
      sections[i].tangent = Tangent(line, i, reach);
      sections[i].cut =
          CutPlane(volume, line[i], sections[i].tangent, options.half_size);
    });
    Polyline centered;
    double s = 0;
    int kept = -1;
    for (int i = 0; i < count; ++i) {
      LimbSection& section = sections[i];
      section.free = section.cut.found && !section.cut.touches_border &&
                     section.cut.area <= options.max_area;
      // A way along the skin sees its section leave the square at first.
      Eigen::Vector3d center = line[i];
      if (section.cut.found && section.cut.area <= options.max_area) {
        center = section.cut.centroid_in_world;
      }
      // Where a section is much wider than the limb, its centre may lie before
      // the one before: the line would run into a knot.
      constexpr double kLeastProgress = 0.25;
      if (!centered.empty() && (center - centered.back()).dot(section.tangent) <
                                   kLeastProgress * options.step) {
        continue;
      }
      if (kept >= 0) s += (line[i] - line[kept]).norm();
      kept = i;
      if (last) {
        section.s = s;
        if (section.free) section.point_in_world = center;
        result.push_back(section);
      }
      centered.push_back(center);
    }
    if (!last) {
      line = Smooth(Resample(centered, options.step, options.max_length),
                    0.5 * sigma);
    }
  }
  return result;
}

Eigen::Vector3d PointAt(const LimbLine& line, double s) {
  if (s <= line.front().s) return line.front().point_in_world;
  for (size_t i = 1; i < line.size(); ++i) {
    if (s > line[i].s) continue;
    const double span = line[i].s - line[i - 1].s;
    const double t = span > 0 ? (s - line[i - 1].s) / span : 0;
    return line[i - 1].point_in_world +
           t * (line[i].point_in_world - line[i - 1].point_in_world);
  }
  return line.back().point_in_world;
}

Eigen::Vector3d TangentAt(const LimbLine& line, double s) {
  for (const LimbSection& section : line) {
    if (section.s >= s) return section.tangent;
  }
  return line.back().tangent;
}

bool FitAxis(const LimbLine& line,
             double from,
             double to,
             Eigen::Vector3d* point,
             Eigen::Vector3d* direction) {
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const LimbSection& section : line) {
    if (section.s < from || section.s > to) continue;
    points.push_back(section.point_in_world);
    mean += section.point_in_world;
  }
  if (points.size() < 3) return false;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) {
    scatter += (p - mean) * (p - mean).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  *point = mean;
  *direction = eigen.eigenvectors().col(2);
  if (direction->dot(points.back() - points.front()) < 0) {
    *direction = -*direction;
  }
  return true;
}

Bend SharpestBend(const LimbLine& line, double from, double to, double arm) {
  Bend best;
  best.s = 0.5 * (from + to);
  for (const LimbSection& section : line) {
    if (section.s < from || section.s > to) continue;
    Eigen::Vector3d point, before, after;
    if (!FitAxis(line, section.s - arm, section.s, &point, &before) ||
        !FitAxis(line, section.s, section.s + arm, &point, &after)) {
      continue;
    }
    const double angle = std::acos(std::clamp(before.dot(after), -1.0, 1.0));
    if (angle > best.angle) best = {section.s, angle};
  }
  return best;
}

}  // namespace sweepfit
