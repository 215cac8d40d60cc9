// SPDX-License-Identifier: Apache-2.0
//
//   m(x) = max(0, phi(x) - margin) / sigma_outside
//        + min(0, phi(x) + inflation) / sigma_inside
//
// phi   signed distance to the visual hull, metres, negative inside
//
// The hull contains the person: outside is (nearly) forbidden. Inside is only a
// weak pull to the depth `inflation` that hulls are known to be too fat by.
#pragma once

#include "residuals/measurement.h"

namespace sweepfit {

class HullDistance {
 public:
  struct Options {
    double margin = 0.002;
    double sigma_outside = 0.0015;
    double inflation = 0.006;
    double sigma_inside = 0.03;
  };

  HullDistance(const Volume* volume, const Options& options)
      : volume_(volume), options_(options) {}

  Measured operator()(const Eigen::Vector3d& point_in_world) const {
    Eigen::Vector3d gradient;
    const double phi = volume_->SampleWithGradient(point_in_world, &gradient);
    if (phi > options_.margin) {
      return {(phi - options_.margin) / options_.sigma_outside,
              gradient / options_.sigma_outside};
    }
    if (phi < -options_.inflation) {
      return {(phi + options_.inflation) / options_.sigma_inside,
              gradient / options_.sigma_inside};
    }
    return {};
  }

 private:
  const Volume* volume_;
  Options options_;
};

}  // namespace sweepfit
