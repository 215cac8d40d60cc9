// SPDX-License-Identifier: Apache-2.0
//
//   m(x) = D(pi(x)) z(x) / (f sigma)
//
// x     a point of the body's rim in this view: a surface point whose normal is
//       perpendicular to the line of sight and that lies on the outline
// D     signed distance to the observed silhouette, pinhole pixels, negative
//       inside, bilinear
// z, f  depth of x and focal length: D z / f is the distance in metres
// sigma metres
//
// The rim point is held fixed in a solve: to first order it moves along the
// surface, so the derivative is exact (envelope theorem). A point behind the
// camera has residual 0 and no gradient: it says nothing.
#pragma once

#include "residuals/measurement.h"

namespace sweepfit {

class SilhouetteRim {
 public:
  SilhouetteRim(const Camera* camera,
                const cv::Mat1f* signed_distance,
                double sigma)
      : camera_(camera), signed_distance_(signed_distance), sigma_(sigma) {}

  Measured operator()(const Eigen::Vector3d& point_in_world) const {
    const auto projection = ProjectWithDerivative(*camera_, point_in_world);
    if (!projection) return {};
    const ImageSample sample =
        SampleBilinear(*signed_distance_, projection->pixel);
    const double scale = 1 / (camera_->FocalLength() * sigma_);
    const double z = projection->depth;
    return {
        sample.value * z * scale,
        scale * (z * projection->pixel_by_world.transpose() * sample.gradient +
                 sample.value * projection->depth_by_world)};
  }

 private:
  const Camera* camera_;
  const cv::Mat1f* signed_distance_;
  double sigma_;
};

}  // namespace sweepfit
