// SPDX-License-Identifier: Apache-2.0
#include "volume/person_height.h"

#include <algorithm>
#include <limits>

#include "model/input_error.h"
#include "model/median.h"
#include "volume/floor_level.h"
#include "volume/silhouette_cones.h"
#include "volume/volume.h"

namespace sweepfit {
namespace {

// Extent of a silhouette along the picture of the world's y axis, as a length
// at the depth of `point_in_world`.
double ExtentAt(const View& view, const Eigen::Vector3d& point_in_world) {
  const double depth = view.camera.PointInCamera(point_in_world).z();
  if (!(depth > 0)) {
    throw FitError("camera " + view.camera.id +
                   " looks away from where the others see the person");
  }
  const Eigen::Vector3d up = view.camera.camera_from_world.col(1);
  const Eigen::Vector2d along = up.head<2>().normalized();
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (int v = 0; v < view.signed_distance.rows; ++v) {
    for (int u = 0; u < view.signed_distance.cols; ++u) {
      if (view.signed_distance(v, u) >= 0) continue;
      const double at = along.dot(Eigen::Vector2d(u, v));
      low = std::min(low, at);
      high = std::max(high, at);
    }
  }
  return (high - low) * depth / view.camera.FocalLength();
}

}  // namespace

PersonHeight MeasurePersonHeight(std::vector<View> views) {
  // The hull's options are in metres: a first guess from each silhouette's size
  // brings the person near the usual height.
  constexpr double kUsual = 1.7;
  const Eigen::Vector3d middle = MeetingPoint(MakeSilhouetteCones(views));
  std::vector<double> extents;
  extents.reserve(views.size());
  for (const View& view : views) extents.push_back(ExtentAt(view, middle));
  const double scale = kUsual / MedianInPlace(&extents);
  for (View& view : views) view.camera.world_in_camera *= scale;
  const Volume hull = BuildVisualHull(views, HullOptions(), nullptr, nullptr);
  Eigen::Vector3d low = hull.BoxMin();
  const Eigen::Vector3d high = hull.BoxMax();
  low.y() = FindFloor(views, hull);
  PersonHeight result;
  result.height = (high.y() - low.y()) / scale;
  result.width = std::max(high.x() - low.x(), high.z() - low.z()) / scale;
  result.floor = low.y() / scale;
  result.center_xz = {0.5 * (low.x() + high.x()) / scale,
                      0.5 * (low.z() + high.z()) / scale};
  return result;
}

}  // namespace sweepfit
