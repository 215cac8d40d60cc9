// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "capture/camera.h"

namespace sweepfit {

struct CameraRing {
  int count = 16;
  int width = 800, height = 800;
  // Where the person stands (x and z count), the height and the largest
  // horizontal reach of what the cameras must see, metres.
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
  double stature = 1.7;
  double reach = 0.9;

  // Of the ring, metres.
  double Radius() const;
};
// Cameras cam00, cam01, ... around the person, alternately high (1.9 m) and low
// (0.7 m), each a little out of place and rolled, with its own focal length,
// principal point and lens distortion.
std::vector<Camera> DrawCameraRing(const CameraRing& ring, unsigned seed);

// Projection and its inverse written apart from Camera's own, so that drawing
// and fitting share no code. The point must lie in front of the camera.
struct Projection {
  Eigen::Vector2d pixel;
  double depth = 0;
};
Projection ProjectForDrawing(const Camera& camera,
                             const Eigen::Vector3d& point_in_world);
// Unit ray through a pixel of the picture as taken, in the world.
Eigen::Vector3d RayForDrawing(const Camera& camera,
                              const Eigen::Vector2d& pixel);

}  // namespace sweepfit
