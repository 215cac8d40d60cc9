// SPDX-License-Identifier: Apache-2.0
#include "volume/silhouette_cones.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "model/input_error.h"

namespace sweepfit {
namespace {

// Mean pinhole pixel of the silhouette.
Eigen::Vector2d SilhouetteCentroid(const View& view) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  std::int64_t count = 0;
  for (int v = 0; v < view.signed_distance.rows; ++v) {
    const float* row = view.signed_distance[v];
    for (int u = 0; u < view.signed_distance.cols; ++u) {
      if (row[u] >= 0) continue;
      sum += Eigen::Vector2d(u, v);
      ++count;
    }
  }
  if (count == 0) {
    throw FitError("camera " + view.camera.id + ": the silhouette is empty");
  }
  return sum / static_cast<double>(count);
}

}  // namespace

SilhouetteCone::SilhouetteCone(const View& view)
    : pixel_from_world_(view.camera.K * view.camera.camera_from_world),
      world_in_pixel_(view.camera.K * view.camera.world_in_camera),
      center_in_world_(view.camera.CenterInWorld()),
      axis_in_world_(view.camera.RayInWorld(SilhouetteCentroid(view))),
      principal_point_(view.camera.K(0, 2), view.camera.K(1, 2)),
      focal_length_(view.camera.FocalLength()),
      signed_distance_(view.signed_distance) {}

double SilhouetteCone::Distance(double u, double v) const {
  const int width = signed_distance_.cols;
  const int height = signed_distance_.rows;
  u = std::clamp(u, 0.0, width - 1.0);
  v = std::clamp(v, 0.0, height - 1.0);
  const int u0 = std::clamp(static_cast<int>(u), 0, std::max(0, width - 2));
  const int v0 = std::clamp(static_cast<int>(v), 0, std::max(0, height - 2));
  const int u1 = std::min(u0 + 1, width - 1);
  const float* top = signed_distance_[v0];
  const float* bottom = signed_distance_[std::min(v0 + 1, height - 1)];
  const double fu = u - u0;
  const double fv = v - v0;
  const double a = top[u0] + fu * (top[u1] - top[u0]);
  const double b = bottom[u0] + fu * (bottom[u1] - bottom[u0]);
  return a + fv * (b - a);
}

bool SilhouetteCone::Evaluate(const Eigen::Vector3d& point_in_world,
                              double* phi) const {
  const Eigen::Vector3d p =
      pixel_from_world_ * point_in_world + world_in_pixel_;
  if (!(p.z() > 0)) return false;
  const double u = p.x() / p.z();
  const double v = p.y() / p.z();
  if (!(u >= -0.5 && v >= -0.5 && u <= signed_distance_.cols - 0.5 &&
        v <= signed_distance_.rows - 0.5)) {
    return false;
  }
  *phi = Distance(u, v) * p.z() / focal_length_;
  return true;
}

void SilhouetteCone::RaiseBlock(const Eigen::Vector3d& first_in_world,
                                double voxel_size,
                                float limit,
                                BlockField* field) const {
  constexpr int kSide = BlockGrid::kSide;
  const Eigen::Vector3d first =
      pixel_from_world_ * first_in_world + world_in_pixel_;
  const Eigen::Matrix3d step = voxel_size * pixel_from_world_;
  const double right = signed_distance_.cols - 0.5;
  const double bottom = signed_distance_.rows - 0.5;
  for (int row = 0; row < kSide * kSide; ++row) {
    const Eigen::Vector3d start =
        first + row / kSide * step.col(0) + row % kSide * step.col(1);
    // Apart from the look-ups, so that the compiler can do several at once.
    std::array<double, kSide> u, v, depth;
    for (int k = 0; k < kSide; ++k) {
      depth[k] = start.z() + k * step(2, 2);
      u[k] = (start.x() + k * step(0, 2)) / depth[k];
      v[k] = (start.y() + k * step(1, 2)) / depth[k];
    }
    for (int k = 0; k < kSide; ++k) {
      const int voxel = kSide * row + k;
      float& value = field->values[voxel];
      if (value >= limit || !(depth[k] > 0) ||
          !(u[k] >= -0.5 && v[k] >= -0.5 && u[k] <= right && v[k] <= bottom)) {
        continue;
      }
      ++field->num_views[voxel];
      const double phi = Distance(u[k], v[k]) * depth[k] / focal_length_;
      value = std::max(value, static_cast<float>(phi));
    }
  }
}

SilhouetteCone::Sees SilhouetteCone::EvaluateBall(
    const Eigen::Vector3d& center_in_world, double radius, double* phi) const {
  const Eigen::Vector3d p =
      pixel_from_world_ * center_in_world + world_in_pixel_;
  if (p.z() + radius <= 0) return Sees::kNothing;
  const double nearest = p.z() - radius;
  if (nearest <= 0) {
    *phi = -std::numeric_limits<double>::infinity();
    return Sees::kPart;
  }
  const Eigen::Vector2d pixel = p.head<2>() / p.z();
  // A bound of the ball's image: off the axis it is stretched.
  const double slope = (pixel - principal_point_).norm() / focal_length_;
  const double margin =
      1.25 * radius * focal_length_ / nearest * std::hypot(1.0, slope);
  const double width = signed_distance_.cols - 0.5;
  const double height = signed_distance_.rows - 0.5;
  if (pixel.x() + margin < -0.5 || pixel.y() + margin < -0.5 ||
      pixel.x() - margin > width || pixel.y() - margin > height) {
    return Sees::kNothing;
  }
  if (pixel.x() - margin < -0.5 || pixel.y() - margin < -0.5 ||
      pixel.x() + margin > width || pixel.y() + margin > height) {
    // Moving to the nearest pixel of the frame brings no visible point farther
    // away, so the margin still holds there.
    *phi = (Distance(pixel.x(), pixel.y()) - margin) * nearest / focal_length_;
    return Sees::kPart;
  }
  *phi = Distance(pixel.x(), pixel.y()) * p.z() / focal_length_;
  return Sees::kAll;
}

std::vector<SilhouetteCone> MakeSilhouetteCones(
    const std::vector<View>& views) {
  if (views.size() < 2) {
    throw FitError("a volume needs at least two views, there " +
                   std::string(views.empty() ? "is none" : "is one"));
  }
  std::vector<SilhouetteCone> cones;
  cones.reserve(views.size());
  for (const View& view : views) cones.emplace_back(view);
  return cones;
}

Eigen::Vector3d MeetingPoint(const std::vector<SilhouetteCone>& cones) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const SilhouetteCone& cone : cones) {
    const Eigen::Matrix3d across =
        Eigen::Matrix3d::Identity() -
        cone.axis_in_world() * cone.axis_in_world().transpose();
    normal += across;
    right += across * cone.center_in_world();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(normal);
  if (eigen.eigenvalues()[0] < 1e-6 * static_cast<double>(cones.size())) {
    throw FitError(
        "the views look along parallel rays: they cannot tell where the "
        "person is");
  }
  return normal.ldlt().solve(right);
}

}  // namespace sweepfit
