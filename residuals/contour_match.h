// SPDX-License-Identifier: Apache-2.0
//
//   m(x) = n . (pi(x) - c) z0 / (f sigma)
//
// c     a point of the observed contour, pinhole pixels
// n     its unit normal
// x     the rim point of the body that was matched to c
// z0, f depth of x when it was matched, focal length; sigma metres
//
// The direction image -> model: it sees parts of the person that the model does
// not cover, which the rim residual (model -> image) cannot.
#pragma once

#include "residuals/measurement.h"

namespace sweepfit {

class ContourMatch {
 public:
  ContourMatch(const Camera* camera,
               const Eigen::Vector2d& contour_pixel,
               const Eigen::Vector2d& unit_normal,
               double depth,
               double sigma)
      : camera_(camera),
        contour_pixel_(contour_pixel),
        scaled_normal_(unit_normal *
                       (depth / (camera->FocalLength() * sigma))) {}

  Measured operator()(const Eigen::Vector3d& point_in_world) const {
    const auto projection = ProjectWithDerivative(*camera_, point_in_world);
    if (!projection) return {};
    return {scaled_normal_.dot(projection->pixel - contour_pixel_),
            projection->pixel_by_world.transpose() * scaled_normal_};
  }

 private:
  const Camera* camera_;
  Eigen::Vector2d contour_pixel_;
  Eigen::Vector2d scaled_normal_;
};

}  // namespace sweepfit
