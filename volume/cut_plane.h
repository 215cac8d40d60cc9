// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "volume/volume.h"

namespace sweepfit {

// The part of a volume's cross-section with a plane that is connected, within
// the plane, to the seed (the nearest inside point within 0.03 m of it): a
// knee plane does not collect the other knee.
struct CutPlaneSection {
  bool found = false;
  bool touches_border = false;  // the component leaves the square
  Eigen::Vector3d centroid_in_world = Eigen::Vector3d::Zero();
  double area = 0;  // square metres, sub-voxel coverage
  // Half-axes, metres (sqrt of 4 x second moments, i.e. exact for an ellipse),
  // and the in-plane direction of the longer one, in the world.
  double half_axis_long = 0;
  double half_axis_short = 0;
  Eigen::Vector3d long_direction = Eigen::Vector3d::Zero();
};

// Looks at a square of the plane about the seed; half_size is half its side,
// metres. `unit_normal` is the plane's, in the world.
CutPlaneSection CutPlane(const Volume& volume,
                         const Eigen::Vector3d& seed_in_world,
                         const Eigen::Vector3d& unit_normal,
                         double half_size);

// Distance from an inside point to the first crossing of the zero level along
// a direction in the world; negative when there is none within max_distance.
// Metres.
double RayExit(const Volume& volume,
               const Eigen::Vector3d& origin_in_world,
               const Eigen::Vector3d& unit_direction,
               double max_distance);

}  // namespace sweepfit
