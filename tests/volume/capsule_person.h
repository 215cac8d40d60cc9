// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "capture/silhouette.h"
#include "model/skeleton.h"

// Bodies made of capsules whose silhouettes are known in closed form.
namespace sweepfit::testing {

struct Capsule {
  Eigen::Vector3d a, b;
  double radius;
};

// Least distance of a ray from `origin` (unit direction) to the capsule's
// surface, negative where the ray passes through, and the depth along the ray.
inline double RayDistance(const Capsule& capsule,
                          const Eigen::Vector3d& origin,
                          const Eigen::Vector3d& direction,
                          double* depth) {
  const Eigen::Vector3d axis = capsule.b - capsule.a;
  const Eigen::Vector3d offset = capsule.a - origin;
  const double ad = axis.dot(direction);
  const double aa = axis.squaredNorm();
  const double denominator = aa - ad * ad;
  double s = 0;
  if (denominator > 1e-12) {
    s = (ad * offset.dot(direction) - offset.dot(axis)) / denominator;
  }
  const Eigen::Vector3d nearest =
      capsule.a + std::clamp(s, 0.0, 1.0) * axis - origin;
  *depth = nearest.dot(direction);
  return (nearest - *depth * direction).norm() - capsule.radius;
}

// Camera at `center` looking at `target`; `roll` turns it about its axis.
inline Camera LookAt(const std::string& id,
                     const Eigen::Vector3d& center,
                     const Eigen::Vector3d& target,
                     double focal_length,
                     int size,
                     double roll = 0) {
  Camera camera;
  camera.id = id;
  camera.width = size;
  camera.height = size;
  camera.K << focal_length, 0, 0.5 * (size - 1), 0, focal_length,
      0.5 * (size - 1), 0, 0, 1;
  const Eigen::Vector3d z = (target - center).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitY()).normalized();
  Eigen::Matrix3d rotation;
  rotation.row(0) = x;
  rotation.row(1) = z.cross(x);
  rotation.row(2) = z;
  camera.camera_from_world =
      Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()) * rotation;
  camera.world_in_camera = -camera.camera_from_world * center;
  return camera;
}

inline View RenderCapsules(const Camera& camera,
                           const std::vector<Capsule>& capsules) {
  View view;
  view.camera = camera;
  view.signed_distance.create(camera.height, camera.width);
  const Eigen::Vector3d center = camera.CenterInWorld();
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d ray = camera.RayInWorld({u, v});
      double nearest = 1e9;
      for (const Capsule& capsule : capsules) {
        double depth = 0;
        const double distance = RayDistance(capsule, center, ray, &depth);
        if (depth <= 0) continue;
        nearest = std::min(nearest, distance * camera.FocalLength() / depth);
      }
      view.signed_distance(v, u) = static_cast<float>(nearest);
    }
  }
  return view;
}

// `count` cameras on a ring of 3 m about the target, alternately high and low.
inline std::vector<View> RenderRing(const std::vector<Capsule>& capsules,
                                    const Eigen::Vector3d& target,
                                    int count,
                                    int size,
                                    double roll = 0) {
  std::vector<View> views;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count + 0.1;
    const Eigen::Vector3d center =
        target + Eigen::Vector3d(3 * std::sin(angle),
                                 i % 2 == 0 ? 0.9 : -0.4,
                                 3 * std::cos(angle));
    views.push_back(RenderCapsules(
        LookAt(
            "cam" + std::to_string(i), center, target, 1.3 * size, size, roll),
        capsules));
  }
  return views;
}

// A person of 1.7 m with known joints. `arm` is the angle of the arms to the
// vertical (0: hanging), `yaw` turns the person about the vertical.
struct CapsulePerson {
  std::array<Eigen::Vector3d, kNumJoints> joint;
  std::vector<Capsule> capsules;
};

inline CapsulePerson MakePerson(double arm,
                                double yaw,
                                const Eigen::Vector3d& shift,
                                bool left_arm = true) {
  using Eigen::Vector3d;
  CapsulePerson person;
  auto& j = person.joint;
  j[kRoot] = {0, 0.90, 0};
  j[kSpine] = {0, 1.06, -0.02};
  j[kNeck] = {0, 1.44, -0.02};
  j[kHead] = {0, 1.55, 0};
  j[kHeadEnd] = {0, 1.70, 0};
  for (const int side : {0, 1}) {
    const double sign = side == 0 ? 1 : -1;
    const int s = side == 0 ? kLShoulder : kRShoulder;
    const int h = side == 0 ? kLHip : kRHip;
    const Vector3d out(sign * std::sin(arm), -std::cos(arm), 0);
    j[s] = {sign * 0.17, 1.38, -0.02};
    j[s + 1] = j[s] + 0.28 * out;
    j[s + 2] = j[s] + 0.53 * out;
    j[s + 3] = j[s] + 0.71 * out;
    j[h] = {sign * 0.09, 0.90, 0};
    j[h + 1] = {sign * 0.12, 0.49, 0};
    j[h + 2] = {sign * 0.15, 0.08, -0.01};
    j[h + 3] = {sign * 0.17, 0.03, 0.17};
  }
  const Eigen::AngleAxisd turn(yaw, Vector3d::UnitY());
  for (Vector3d& point : j) point = turn * point + shift;

  const Vector3d left = turn * Vector3d::UnitX();
  const Vector3d up = Vector3d::UnitY();
  auto& c = person.capsules;
  c.push_back({j[kRoot] - 0.06 * left, j[kRoot] + 0.06 * left, 0.11});
  c.push_back({j[kRoot], j[kSpine], 0.12});
  c.push_back({j[kSpine], j[kNeck] - 0.14 * up, 0.13});
  c.push_back({j[kLShoulder] - 0.03 * up - 0.04 * left,
               j[kRShoulder] - 0.03 * up + 0.04 * left,
               0.075});
  c.push_back({j[kNeck] - 0.05 * up, j[kHead], 0.055});
  c.push_back({j[kHead] + 0.01 * up, j[kHeadEnd] - 0.085 * up, 0.085});
  for (const int side : {0, 1}) {
    const int s = side == 0 ? kLShoulder : kRShoulder;
    const int h = side == 0 ? kLHip : kRHip;
    if (side == 1 || left_arm) {
      c.push_back({j[s], j[s + 1], 0.048});
      c.push_back({j[s + 1], 0.2 * j[s + 1] + 0.8 * j[s + 2], 0.04});
      c.push_back({j[s + 1], j[s + 2], 0.028});
      const Vector3d hand = (j[s + 3] - j[s + 2]).normalized();
      c.push_back({j[s + 2] + 0.05 * hand, j[s + 3] - 0.04 * hand, 0.04});
    }
    c.push_back({j[h], j[h + 1], 0.075});
    c.push_back({j[h + 1], 0.4 * j[h + 1] + 0.6 * j[h + 2], 0.055});
    c.push_back({j[h + 1], j[h + 2], 0.042});
    c.push_back({j[h + 2] - 0.04 * up, j[h + 3], 0.035});
  }
  return person;
}

}  // namespace sweepfit::testing
