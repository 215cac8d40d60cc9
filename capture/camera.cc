// SPDX-License-Identifier: Apache-2.0
#include "capture/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace sweepfit {
namespace {

// Image plane coordinates at z = 1 of a pixel.
Eigen::Vector2d Normalise(const Eigen::Matrix3d& K,
                          const Eigen::Vector2d& pixel) {
  const double y = (pixel.y() - K(1, 2)) / K(1, 1);
  return {(pixel.x() - K(0, 2) - K(0, 1) * y) / K(0, 0), y};
}

Eigen::Vector2d ToPixel(const Eigen::Matrix3d& K, const Eigen::Vector2d& p) {
  return {K(0, 0) * p.x() + K(0, 1) * p.y() + K(0, 2),
          K(1, 1) * p.y() + K(1, 2)};
}

// Brown's model in OpenCV's order,
//   p (1 + k1 r^2 + k2 r^4 + k3 r^6) + tangential terms p1, p2,
// and optionally its Jacobian.
Eigen::Vector2d DistortNormalised(const std::array<double, 5>& k,
                                  const Eigen::Vector2d& p,
                                  Eigen::Matrix2d* jacobian) {
  const double x = p.x();
  const double y = p.y();
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  if (jacobian) {
    // d radial / d r^2
    const double slope = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);
    const double cross = 2 * x * y * slope + 2 * k[2] * x + 2 * k[3] * y;
    *jacobian << radial + 2 * x * x * slope + 2 * k[2] * y + 6 * k[3] * x,
        cross, cross, radial + 2 * y * y * slope + 6 * k[2] * y + 2 * k[3] * x;
  }
  return {x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
          y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y};
}

}  // namespace

bool Camera::HasDistortion() const {
  return std::any_of(
      distortion.begin(), distortion.end(), [](double k) { return k != 0; });
}

Eigen::Vector3d Camera::RayInWorld(const Eigen::Vector2d& pinhole_pixel) const {
  const Eigen::Vector3d ray_in_camera =
      Normalise(K, pinhole_pixel).homogeneous();
  return (camera_from_world.transpose() * ray_in_camera).normalized();
}

Eigen::Vector2d Camera::ProjectPinhole(
    const Eigen::Vector3d& point_in_world) const {
  return ToPinholePixel(PointInCamera(point_in_world));
}

Eigen::Vector2d Camera::ToPinholePixel(
    const Eigen::Vector3d& point_in_camera) const {
  return ToPixel(K, point_in_camera.hnormalized());
}

Eigen::Vector2d Camera::Project(const Eigen::Vector3d& point_in_world) const {
  const Eigen::Vector2d p = PointInCamera(point_in_world).hnormalized();
  return ToPixel(K, DistortNormalised(distortion, p, nullptr));
}

Eigen::Vector2d Camera::Distort(const Eigen::Vector2d& pinhole_pixel) const {
  if (!HasDistortion()) return pinhole_pixel;
  return ToPixel(
      K, DistortNormalised(distortion, Normalise(K, pinhole_pixel), nullptr));
}

Eigen::Vector2d Camera::Undistort(const Eigen::Vector2d& pixel) const {
  if (!HasDistortion()) return pixel;
  constexpr int kMaxSteps = 50;
  constexpr double kMaxStep = 0.1;
  const double tolerance = 1e-10 / FocalLength();
  const Eigen::Vector2d target = Normalise(K, pixel);
  Eigen::Vector2d p = target;
  for (int i = 0; i < kMaxSteps; ++i) {
    Eigen::Matrix2d jacobian;
    const Eigen::Vector2d error =
        DistortNormalised(distortion, p, &jacobian) - target;
    // Newton where the model is well invertible, else fixed point; short steps
    // keep on the branch that holds the principal point.
    Eigen::Vector2d step = jacobian.determinant() > 0.1
                               ? Eigen::Vector2d(jacobian.inverse() * error)
                               : Eigen::Vector2d(0.5 * error);
    const double length = step.norm();
    if (length > kMaxStep) step *= kMaxStep / length;
    p -= step;
    if (length < tolerance) break;
  }
  return ToPixel(K, p);
}

bool Camera::CanUndistort() const {
  if (!HasDistortion()) return true;
  constexpr double kTolerance = 0.01;  // pixels
  // Sound calibrations often fold at the very corners, where no board was.
  constexpr double kInner = 0.85;
  constexpr int kPerSide = 16;
  constexpr int kOnTheWay = 16;
  const double right = width - 1, bottom = height - 1;
  for (int i = 0; i < kPerSide; ++i) {
    const double f = static_cast<double>(i) / kPerSide;
    for (const Eigen::Vector2d& pixel :
         {Eigen::Vector2d(f * right, 0),
          Eigen::Vector2d(right, f * bottom),
          Eigen::Vector2d((1 - f) * right, bottom),
          Eigen::Vector2d(0, (1 - f) * bottom)}) {
      const Eigen::Vector2d inner =
          kInner * pixel + (1 - kInner) * 0.5 * Eigen::Vector2d(right, bottom);
      const Eigen::Vector2d pinhole = Undistort(inner);
      if (!((Distort(pinhole) - inner).norm() < kTolerance)) return false;
      // A point beyond a fold may be distorted to the same pixel.
      const Eigen::Vector2d p = Normalise(K, pinhole);
      for (int step = 1; step <= kOnTheWay; ++step) {
        Eigen::Matrix2d jacobian;
        DistortNormalised(
            distortion, static_cast<double>(step) / kOnTheWay * p, &jacobian);
        if (!(jacobian.determinant() > 0)) return false;
      }
    }
  }
  return true;
}

std::optional<std::string> MakeRotation(Eigen::Matrix3d* matrix) {
  constexpr double kMaxDeviation = 1e-3;
  constexpr double kRounding = 1e-12;
  const double deviation =
      (matrix->transpose() * *matrix - Eigen::Matrix3d::Identity())
          .cwiseAbs()
          .maxCoeff();
  if (!(deviation <= kMaxDeviation)) {
    return "is no rotation: its rows are not orthonormal";
  }
  if (matrix->determinant() < 0) return "is a reflection, not a rotation";
  // Numbers that were saved by this program must come back as they were.
  if (deviation <= kRounding) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      *matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  *matrix = svd.matrixU() * svd.matrixV().transpose();
  return std::nullopt;
}

}  // namespace sweepfit
