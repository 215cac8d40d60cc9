// SPDX-License-Identifier: Apache-2.0
#include "experiments/synthetic_cameras.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "experiments/random.h"

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Share of the half picture that the person may fill.
constexpr double kFill = 0.90;
constexpr double kDegree = std::numbers::pi / 180;

// Brown's model on normalised coordinates; distortion is k1 k2 p1 p2 k3.
Vector2d DistortNormalized(const Camera& camera, const Vector2d& n) {
  const auto& [k1, k2, p1, p2, k3] = camera.distortion;
  const double x = n.x(), y = n.y(), r2 = n.squaredNorm();
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

// Points that the picture must hold: the person turned about the vertical.
std::vector<Vector3d> PointsToSee(const CameraRing& ring) {
  std::vector<Vector3d> points;
  for (int i = 0; i < 24; ++i) {
    const double angle = i * std::numbers::pi / 12;
    const auto add = [&](double radius, double height) {
      points.push_back(
          ring.center_in_world +
          Vector3d(radius * std::sin(angle), height, radius * std::cos(angle)));
    };
    add(0.22 * ring.stature, 0);
    add(ring.reach, 0.40 * ring.stature);
    add(ring.reach, 0.90 * ring.stature);
    add(0.12 * ring.stature, 1.03 * ring.stature);
  }
  return points;
}

}  // namespace

double CameraRing::Radius() const { return 2.1 * std::max(stature, 1.5); }

std::vector<Camera> DrawCameraRing(const CameraRing& ring, unsigned seed) {
  Random random(0x63616d73ull * 1000003 + seed);
  const double radius = ring.Radius();
  const std::vector<Vector3d> points = PointsToSee(ring);
  std::vector<Camera> cameras;
  for (int i = 0; i < ring.count; ++i) {
    Camera camera;
    char id[16];
    std::snprintf(id, sizeof id, "cam%02d", i);
    camera.id = id;
    camera.width = ring.width;
    camera.height = ring.height;
    const double azimuth =
        2 * std::numbers::pi * i / ring.count + random.Spread(1.0) * kDegree;
    const bool high = i % 2 == 0;
    const Vector3d place =
        ring.center_in_world +
        Vector3d(radius * std::sin(azimuth) + random.Spread(0.03),
                 (high ? 1.9 : 0.7) + random.Spread(0.03),
                 radius * std::cos(azimuth) + random.Spread(0.03));
    const Vector3d target = ring.center_in_world +
                            Vector3d(random.Spread(0.01),
                                     0.51 * ring.stature + random.Spread(0.01),
                                     random.Spread(0.01));
    Eigen::Matrix3d world_from_camera;
    world_from_camera.col(2) = (target - place).normalized();
    world_from_camera.col(0) =
        world_from_camera.col(2).cross(Vector3d::UnitY()).normalized();
    world_from_camera.col(1) =
        world_from_camera.col(2).cross(world_from_camera.col(0));
    const Eigen::AngleAxisd roll(random.Spread(0.7) * kDegree,
                                 Vector3d::UnitZ());
    camera.camera_from_world =
        (world_from_camera * roll.toRotationMatrix()).transpose();
    camera.world_in_camera = -camera.camera_from_world * place;
    camera.distortion = {random.Spread(0.03),
                         random.Spread(0.005),
                         random.Spread(0.0003),
                         random.Spread(0.0003),
                         0};

    // The longest focal length that keeps everything in the picture.
    double widest = 0;
    for (const Vector3d& p : points) {
      const Vector3d c = camera.PointInCamera(p);
      const Vector2d n = DistortNormalized(camera, c.head<2>() / c.z());
      widest = std::max({widest,
                         std::abs(n.x()) / ring.width,
                         std::abs(n.y()) / ring.height});
    }
    const double focal = kFill * 0.5 / widest;
    camera.K << focal * (1 + random.Spread(0.001)), 0,
        0.5 * (ring.width - 1) + 0.006 * random.Spread(ring.width), 0,
        focal * (1 + random.Spread(0.001)),
        0.5 * (ring.height - 1) + 0.006 * random.Spread(ring.height), 0, 0, 1;
    cameras.push_back(camera);
  }
  return cameras;
}

Projection ProjectForDrawing(const Camera& camera,
                             const Vector3d& point_in_world) {
  const Vector3d c = camera.PointInCamera(point_in_world);
  const Vector2d n = DistortNormalized(camera, c.head<2>() / c.z());
  return {{camera.K(0, 0) * n.x() + camera.K(0, 1) * n.y() + camera.K(0, 2),
           camera.K(1, 1) * n.y() + camera.K(1, 2)},
          c.z()};
}

Vector3d RayForDrawing(const Camera& camera, const Vector2d& pixel) {
  const double y = (pixel.y() - camera.K(1, 2)) / camera.K(1, 1);
  const Vector2d distorted(
      (pixel.x() - camera.K(0, 2) - camera.K(0, 1) * y) / camera.K(0, 0), y);
  // The distortion is mild: every step leaves a few percent of the error.
  Vector2d n = distorted;
  for (int i = 0; i < 5; ++i) n -= DistortNormalized(camera, n) - distorted;
  return (camera.camera_from_world.transpose() * Vector3d(n.x(), n.y(), 1))
      .normalized();
}

}  // namespace sweepfit
