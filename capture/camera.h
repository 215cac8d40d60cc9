// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>

namespace sweepfit {

// A calibrated camera. x right, y down, z forward; pixel centres at integers.
//   x_camera = R x_world + t,   pixel = K distort(x_camera / z)
// "pixel" is a pixel of the picture as taken; "pinhole pixel" is what K alone
// would give without distortion. Silhouette distances live in pinhole pixels.
struct Camera {
  std::string id;
  int width = 0;
  int height = 0;
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  std::array<double, 5> distortion{};  // OpenCV order k1 k2 p1 p2 k3
  Eigen::Matrix3d camera_from_world = Eigen::Matrix3d::Identity();
  Eigen::Vector3d world_in_camera = Eigen::Vector3d::Zero();  // t

  Eigen::Vector3d PointInCamera(const Eigen::Vector3d& point_in_world) const {
    return camera_from_world * point_in_world + world_in_camera;
  }
  Eigen::Vector3d CenterInWorld() const {
    return -camera_from_world.transpose() * world_in_camera;
  }
  // Unit viewing ray through a pinhole pixel, in the world.
  Eigen::Vector3d RayInWorld(const Eigen::Vector2d& pinhole_pixel) const;
  // Mean of fx and fy, pixels.
  double FocalLength() const { return 0.5 * (K(0, 0) + K(1, 1)); }

  bool HasDistortion() const;

  // The point must lie in front of the camera (z > 0).
  Eigen::Vector2d ProjectPinhole(const Eigen::Vector3d& point_in_world) const;
  Eigen::Vector2d ToPinholePixel(const Eigen::Vector3d& point_in_camera) const;
  Eigen::Vector2d Project(const Eigen::Vector3d& point_in_world) const;
  Eigen::Vector2d Distort(const Eigen::Vector2d& pinhole_pixel) const;
  // Inverse of Distort by fixed-point/Newton iteration to 1e-9 px.
  Eigen::Vector2d Undistort(const Eigen::Vector2d& pixel) const;
  // Whether Undistort is that inverse in the picture but for its margin:
  // coefficients of another lens, model or picture size fold it over.
  bool CanUndistort() const;
};

// Replaces a matrix that may deviate from a rotation by 1e-3, as rounded text
// does, by the nearest one; one that is exact but for the rounding of doubles
// stays as it is. Says what is wrong with any other: "is no rotation: ...".
std::optional<std::string> MakeRotation(Eigen::Matrix3d* matrix);

}  // namespace sweepfit
