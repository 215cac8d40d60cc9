// SPDX-License-Identifier: Apache-2.0
#include "volume/coverage.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace sweepfit {
namespace {

// Pixels looked at per silhouette, about.
constexpr double kSamples = 400;
// Pixels nearer to the silhouette's edge than this may miss for rounding.
constexpr float kMargin = -1.5f;

// Part of the ray within the box; false when it misses.
bool ClipToBox(const Eigen::Vector3d& origin,
               const Eigen::Vector3d& direction,
               const Eigen::Vector3d& low,
               const Eigen::Vector3d& high,
               double* from,
               double* to) {
  *from = 0;
  *to = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(direction[axis]) < 1e-12) {
      if (origin[axis] < low[axis] || origin[axis] > high[axis]) return false;
      continue;
    }
    const double a = (low[axis] - origin[axis]) / direction[axis];
    const double b = (high[axis] - origin[axis]) / direction[axis];
    *from = std::max(*from, std::min(a, b));
    *to = std::min(*to, std::max(a, b));
  }
  return *from <= *to;
}

bool MeetsVolume(const Volume& volume,
                 const Eigen::Vector3d& origin,
                 const Eigen::Vector3d& direction) {
  double from = 0, to = 0;
  if (!ClipToBox(
          origin, direction, volume.BoxMin(), volume.BoxMax(), &from, &to)) {
    return false;
  }
  double at = from;
  while (at <= to) {
    const double value = volume.Sample(origin + at * direction);
    if (value < 0) return true;
    at += std::max(0.5 * volume.voxel_size(), 0.7 * value);
  }
  return false;
}

double CoverageOf(const View& view, const Volume& volume) {
  const cv::Mat1f& distance = view.signed_distance;
  std::int64_t area = 0;
  for (int v = 0; v < distance.rows; ++v) {
    for (int u = 0; u < distance.cols; ++u) area += distance(v, u) < kMargin;
  }
  const int step = std::max(1, static_cast<int>(std::sqrt(area / kSamples)));
  const Eigen::Vector3d origin = view.camera.CenterInWorld();
  int seen = 0;
  int met = 0;
  for (int v = step / 2; v < distance.rows; v += step) {
    for (int u = step / 2; u < distance.cols; u += step) {
      if (distance(v, u) >= kMargin) continue;
      ++seen;
      met += MeetsVolume(volume, origin, view.camera.RayInWorld({u, v}));
    }
  }
  return seen > 0 ? static_cast<double>(met) / seen : 1;
}

}  // namespace

std::vector<double> SilhouetteCoverage(const std::vector<View>& views,
                                       const Volume& volume) {
  std::vector<double> coverage(views.size());
  tbb::parallel_for(size_t{0}, views.size(), [&](size_t i) {
    coverage[i] = CoverageOf(views[i], volume);
  });
  return coverage;
}

}  // namespace sweepfit
