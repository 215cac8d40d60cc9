// SPDX-License-Identifier: Apache-2.0
//
//   m(x) = n . (x - p) / sigma
//
// p  a point of the person's surface, world metres
// n  its unit normal
//
// Unlike the hull the photographs say on which side of them x lies.
#pragma once

#include "residuals/measurement.h"

namespace sweepfit {

class SurfacePoint {
 public:
  SurfacePoint(const Eigen::Vector3d& point_in_world,
               const Eigen::Vector3d& unit_normal,
               double sigma)
      : point_in_world_(point_in_world), scaled_normal_(unit_normal / sigma) {}

  Measured operator()(const Eigen::Vector3d& point_in_world) const {
    return {scaled_normal_.dot(point_in_world - point_in_world_),
            scaled_normal_};
  }

 private:
  Eigen::Vector3d point_in_world_;
  Eigen::Vector3d scaled_normal_;
};

}  // namespace sweepfit
