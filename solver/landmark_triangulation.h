// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "capture/camera.h"

namespace sweepfit {

// Where one picture shows a point: within the covariance described by an
// orthogonal pair of axes in the picture.
struct PointObservation {
  const Camera* camera;
  Eigen::Vector2d pinhole_pixel;
  Eigen::Vector2d axis;      // unit
  double sigma_along_axis;   // pixels
  double sigma_across_axis;  // pixels; 0: the picture does not say
  Eigen::Matrix2d Whitening() const;
  Eigen::Matrix2d Covariance() const;  // not when sigma_across_axis is 0
};

// Covariance with one standard deviation along a direction (unit) and another
// across it.
inline Eigen::Matrix3d AlongAcross(const Eigen::Vector3d& unit_direction,
                                   double along,
                                   double across) {
  const Eigen::Matrix3d projection =
      unit_direction * unit_direction.transpose();
  return along * along * projection +
         across * across * (Eigen::Matrix3d::Identity() - projection);
}

// What is known of the point without these observations.
struct PointPrior {
  Eigen::Vector3d point_in_world;
  Eigen::Matrix3d covariance;  // square metres
};

struct TriangulationOptions {
  double huber = 2.5;       // of the length of a whitened residual
  double reject = 4;        // beyond it a view does not agree
  int min_views = 2;        // that must agree
  double max_sigma = 0.06;  // largest acceptable standard deviation, metres
};

struct Triangulation {
  Eigen::Vector3d point_in_world;
  Eigen::Matrix3d covariance;
  std::vector<bool> agrees;  // per observation
  int num_views = 0;         // that agree
  // Share of the information that came from the pictures, 0 .. 1.
  double contour_share = 1;
};

// The point that best explains what the pictures show,
//   min_X sum_i rho_Huber(|W_i (pi_i(X) - m_i)|^2) + |X - X_0|^2 in C_0,
// by Ceres, from the prior or else from the pair of views (20 to 160 degrees
// apart) whose linear triangulation most views agree with (Hartley & Zisserman,
// Multiple View Geometry, 12.2). Views that do not agree are dropped and the
// problem is solved again. The covariance is the inverse of J^T J of the views
// that are left and the prior, grown by their chi-square where they scatter
// more than they claim. Empty when fewer than min_views agree or the point is
// not known to max_sigma.
std::optional<Triangulation> TriangulatePoint(
    const std::vector<PointObservation>& observations,
    const std::optional<PointPrior>& prior,
    const TriangulationOptions& options = {});

}  // namespace sweepfit
