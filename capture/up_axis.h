// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "capture/camera.h"

namespace sweepfit {

// Which way is up, as the cameras tell: they stand level, so that their x axes
// lie in the floor's plane; up is the direction that is most nearly
// perpendicular to all of them, towards the top of their pictures.
struct UpEstimate {
  Eigen::Vector3d up_in_world = Eigen::Vector3d::UnitY();
  // How far the cameras are from level about it, root mean square, radians.
  double roll = 0;
  // False when the cameras' x axes do not span a plane (all look the same way)
  // or are not level (some stand on their side): nothing can be said.
  bool sound = false;
};

UpEstimate EstimateUp(const std::vector<Camera>& cameras);

// The rotation that turns `up` to +y: the one of capture.yaml for its axes,
// else the shortest.
Eigen::Matrix3d RotationToYUp(const Eigen::Vector3d& up);

}  // namespace sweepfit
