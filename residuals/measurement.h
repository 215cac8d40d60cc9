// SPDX-License-Identifier: Apache-2.0
//
// What can be measured about a point x of the body's surface: a scalar
// residual m(x) and its gradient dm/dx. A measurement knows nothing of how x
// depends on the parameters; pose_point_cost.h and radius_point_cost.h join the
// two. All are whitened: divided by their standard deviation.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "capture/camera.h"
#include "capture/silhouette.h"
#include "volume/volume.h"

namespace sweepfit {

struct Measured {
  double residual = 0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  // by point_in_world
};

// Pinhole projection and its derivative; empty when the point is not at least
// 10 cm in front of the camera.
struct Projection {
  Eigen::Vector2d pixel;
  double depth;  // z in the camera, metres
  Eigen::Matrix<double, 2, 3> pixel_by_world;
  Eigen::Vector3d depth_by_world;
};
inline std::optional<Projection> ProjectWithDerivative(
    const Camera& camera, const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector3d p = camera.PointInCamera(point_in_world);
  if (!(p.z() > 0.1)) return std::nullopt;
  const double fx = camera.K(0, 0), skew = camera.K(0, 1), fy = camera.K(1, 1);
  const double x = p.x() / p.z(), y = p.y() / p.z();
  Eigen::Matrix<double, 2, 3> by_camera;
  by_camera << fx, skew, -(fx * x + skew * y), 0, fy, -fy * y;
  by_camera /= p.z();
  return Projection{
      {fx * x + skew * y + camera.K(0, 2), fy * y + camera.K(1, 2)},
      p.z(),
      by_camera * camera.camera_from_world,
      camera.camera_from_world.row(2).transpose()};
}

}  // namespace sweepfit
