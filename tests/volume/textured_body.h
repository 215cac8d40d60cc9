// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "model/mesh.h"
#include "tests/volume/capsule_person.h"

// Pictures of bodies made of capsules, with or without texture.
namespace sweepfit::testing {

// Repeatable noise in [-1, 1] on the integers.
inline double LatticeNoise(int x, int y, int z) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x9e3779b1U ^
                    static_cast<std::uint32_t>(y) * 0x85ebca77U ^
                    static_cast<std::uint32_t>(z) * 0xc2b2ae3dU;
  h ^= h >> 15;
  h *= 0x2c1b3c6dU;
  h ^= h >> 12;
  h *= 0x297a2d39U;
  h ^= h >> 15;
  return h / 2147483647.5 - 1;
}

// Trilinear noise over cells of the given size.
inline double SolidNoise(const Eigen::Vector3d& point, double cell) {
  const Eigen::Vector3d p = point / cell;
  const Eigen::Vector3d base = p.array().floor();
  const Eigen::Vector3d f = p - base;
  const Eigen::Vector3i i = base.cast<int>();
  double sum = 0;
  for (int c = 0; c < 8; ++c) {
    const Eigen::Vector3i corner(c >> 2, c >> 1 & 1, c & 1);
    double weight = 1;
    for (int axis = 0; axis < 3; ++axis) {
      weight *= corner[axis] == 1 ? f[axis] : 1 - f[axis];
    }
    sum += weight * LatticeNoise(i.x() + corner.x(),
                                 i.y() + corner.y(),
                                 i.z() + corner.z());
  }
  return sum;
}

inline double CapsuleDistance(const std::vector<Capsule>& capsules,
                              const Eigen::Vector3d& point,
                              Eigen::Vector3d* normal) {
  double nearest = 1e9;
  for (const Capsule& capsule : capsules) {
    const Eigen::Vector3d axis = capsule.b - capsule.a;
    const double s =
        axis.squaredNorm() > 0
            ? std::clamp(
                  (point - capsule.a).dot(axis) / axis.squaredNorm(), 0.0, 1.0)
            : 0;
    const Eigen::Vector3d from_axis = point - capsule.a - s * axis;
    const double distance = from_axis.norm() - capsule.radius;
    if (distance < nearest) {
      nearest = distance;
      *normal = from_axis.normalized();
    }
  }
  return nearest;
}

// How a body looks, grey levels; always with noise of one level and light from
// above.
struct Paint {
  double contrast = 0;    // of the solid texture
  double side_light = 0;  // from +x
  // Every other camera is exposed longer by this factor of linear light.
  double exposure = 1;
};

// Adds picture and coverage to a view that RenderCapsules made.
inline void PaintCapsules(const std::vector<Capsule>& capsules,
                          const Paint& paint,
                          View* view) {
  const Camera& camera = view->camera;
  view->image.create(camera.height, camera.width);
  view->coverage.create(camera.height, camera.width);
  const Eigen::Vector3d center = camera.CenterInWorld();
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const float distance = view->signed_distance(v, u);
      view->coverage(v, u) = std::clamp(0.5f - distance, 0.f, 1.f);
      double grey = 60;
      if (distance < 0.5f) {
        const Eigen::Vector3d ray = camera.RayInWorld({u, v});
        Eigen::Vector3d normal = -ray;
        double at = 1;
        for (int step = 0; step < 60; ++step) {
          const double d =
              CapsuleDistance(capsules, center + at * ray, &normal);
          if (d < 2e-4 || at > 8) break;
          at += d;
        }
        const Eigen::Vector3d point = center + at * ray;
        grey = 120 + 30 * normal.y() + paint.side_light * normal.x() +
               paint.contrast *
                   (SolidNoise(point, 0.03) + SolidNoise(point, 0.012));
      }
      const auto seed = static_cast<int>(camera.id.back());
      if (seed % 2 == 1) grey *= std::pow(paint.exposure, 1 / 2.2);
      grey += LatticeNoise(u, v, seed);
      const auto value =
          static_cast<unsigned char>(std::clamp(grey + 0.5, 0.0, 255.0));
      view->image(v, u) = cv::Vec3b(value, value, value);
    }
  }
}

inline std::vector<View> PaintRing(const std::vector<Capsule>& capsules,
                                   const Eigen::Vector3d& target,
                                   int count,
                                   int size,
                                   const Paint& paint) {
  std::vector<View> views = RenderRing(capsules, target, count, size);
  for (View& view : views) PaintCapsules(capsules, paint, &view);
  return views;
}

// Mean distance of the volume's surface from the capsules', metres.
inline double MeanError(const TriangleMesh& mesh,
                        const std::vector<Capsule>& capsules) {
  double sum = 0;
  Eigen::Vector3d normal;
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    sum += std::abs(CapsuleDistance(capsules, vertex, &normal));
  }
  return sum / static_cast<double>(mesh.vertices.size());
}

}  // namespace sweepfit::testing
