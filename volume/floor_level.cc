// SPDX-License-Identifier: Apache-2.0
#include "volume/floor_level.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kContact = 0.05;  // metres
constexpr double kShadowShare = 0.1;
// An edge pixel faces down when its outward normal is within 70 degrees of it.
constexpr double kFacing = 0.34;
constexpr double kNone = std::numeric_limits<double>::infinity();

// The first point of a ray within the volume.
std::optional<Vector3d> FirstPoint(const Volume& volume,
                                   const Vector3d& origin,
                                   const Vector3d& direction) {
  const Vector3d low = volume.BoxMin(), high = volume.BoxMax();
  double from = 0, to = kNone;
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(direction[axis]) < 1e-12) {
      if (origin[axis] < low[axis] || origin[axis] > high[axis]) return {};
      continue;
    }
    const double a = (low[axis] - origin[axis]) / direction[axis];
    const double b = (high[axis] - origin[axis]) / direction[axis];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  for (double at = from; at <= to;) {
    const Vector3d point = origin + at * direction;
    const double value = volume.Sample(point);
    if (value < 0) return point;
    at += std::max(0.25 * volume.voxel_size(), 0.7 * value);
  }
  return {};
}

// What one view needs; infinite when it says nothing.
double LowestNeeded(const View& view, const Volume& volume) {
  const Camera& camera = view.camera;
  const Vector2d down = -camera.camera_from_world.col(1).head<2>();
  if (down.norm() < kFacing) return kNone;  // looks straight down
  const Vector3d origin = camera.CenterInWorld();
  const cv::Mat1f& distance = view.signed_distance;
  std::vector<double> needed;
  double at_frame = kNone;
  double nearest_depth = kNone;
  for (int v = 0; v < distance.rows; ++v) {
    for (int u = 0; u < distance.cols; ++u) {
      const float d = distance(v, u);
      if (!(d < -0.5f)) continue;
      const bool frame =
          v == 0 || u == 0 || v + 1 == distance.rows || u + 1 == distance.cols;
      if (!frame) {
        if (d < -1.5f) continue;
        const Vector2d outward(distance(v, u + 1) - distance(v, u - 1),
                               distance(v + 1, u) - distance(v - 1, u));
        if (outward.dot(down) < kFacing * outward.norm() * down.norm()) {
          continue;
        }
      }
      const Vector3d ray = camera.RayInWorld({u, v});
      if (ray.y() >= 0) continue;
      const auto point = FirstPoint(volume, origin, ray);
      if (!point) continue;
      if (frame) at_frame = std::min(at_frame, point->y());
      needed.push_back(point->y());
      nearest_depth = std::min(nearest_depth, camera.PointInCamera(*point).z());
    }
  }
  if (needed.empty()) return kNone;
  std::sort(needed.begin(), needed.end());
  // The lowest that a fiftieth needs: single pixels err.
  const double lowest = needed[needed.size() / 50];
  const auto near = static_cast<double>(
      std::lower_bound(needed.begin(), needed.end(), lowest + kContact) -
      needed.begin());
  const double pixel = nearest_depth / camera.FocalLength();
  return std::min(at_frame,
                  needed[static_cast<size_t>(kShadowShare * near)] + pixel);
}

}  // namespace

double FindFloor(const std::vector<View>& views, const Volume& volume) {
  std::vector<double> needed(views.size(), kNone);
  tbb::parallel_for(size_t{0}, views.size(), [&](size_t i) {
    needed[i] = LowestNeeded(views[i], volume);
  });
  // One view alone may need too much: what another one lost, as the foot of a
  // thin leg of a chair, it looks for in the wedge behind.
  std::sort(needed.begin(), needed.end());
  const double floor =
      needed.size() > 2 && needed[1] != kNone ? needed[1] : needed.front();
  return floor == kNone ? volume.BoxMin().y() : floor;
}

}  // namespace sweepfit
