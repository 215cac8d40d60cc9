// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "model/body.h"

namespace sweepfit {

// A small body for tests: two sweeps, a trunk and a left arm, each with a
// closed quad tube of its own. The tubes overlap at the shoulder, where their
// vertices are bound to both sweeps. Sections differ along and around each
// sweep, centres lie off the axis, the arm is bent at rest.

inline Skeleton ToySkeleton() {
  Skeleton skeleton;
  const auto bone = [&skeleton](int joint, double x, double y, double z) {
    const Eigen::Vector3d along(x, y, z);
    skeleton.length[joint] = along.norm();
    skeleton.rest_direction[joint] = along.normalized();
  };
  skeleton.length[kRoot] = 0;
  skeleton.rest_direction[kRoot] = Eigen::Vector3d::UnitY();
  bone(kSpine, 0, 0.20, 0.01);
  bone(kNeck, 0, 0.36, -0.03);
  bone(kHead, 0, 0.10, 0.03);
  bone(kHeadEnd, 0, 0.15, 0);
  for (const int side : {1, -1}) {
    const bool left = side > 0;
    bone(left ? kLShoulder : kRShoulder, side * 0.18, -0.04, 0);
    bone(left ? kLElbow : kRElbow, side * 0.20, -0.20, -0.02);
    bone(left ? kLWrist : kRWrist, side * 0.18, -0.18, 0.03);
    bone(left ? kLHandEnd : kRHandEnd, side * 0.12, -0.13, 0.02);
    bone(left ? kLHip : kRHip, side * 0.09, 0, 0);
    bone(left ? kLKnee : kRKnee, side * 0.03, -0.40, 0);
    bone(left ? kLAnkle : kRAnkle, side * 0.02, -0.41, -0.02);
    bone(left ? kLFootEnd : kRFootEnd, side * 0.02, -0.06, 0.19);
  }
  return skeleton;
}

// A sweep over the chain with sections of about `radius`.
inline Sweep ToySweep(const std::string& name,
                      std::vector<int> chain,
                      const Eigen::Vector3d& rest_reference,
                      double radius) {
  constexpr int kColumns = 16;
  Sweep sweep;
  sweep.name = name;
  sweep.chain = std::move(chain);
  sweep.rest_reference = rest_reference;
  sweep.rigid_end = true;
  const double end = sweep.num_bones() + 0.1;
  for (double u = -0.1; u < end; u += 0.3 + 0.05 * std::sin(5 * u)) {
    sweep.key_u.push_back(u);
  }
  sweep.key_u.push_back(end);
  const int rows = sweep.num_rows();
  sweep.center_offset.resize(2, rows);
  sweep.radius.resize(rows, kColumns);
  sweep.log_ratio.resize(rows, kColumns);
  sweep.feature_weight = Eigen::VectorXd::Ones(rows);
  for (int i = 0; i < rows; ++i) {
    const double u = sweep.key_u[i];
    sweep.center_offset.col(i) =
        0.15 * radius * Eigen::Vector2d(std::sin(2 * u), std::cos(3 * u));
    for (int k = 0; k < kColumns; ++k) {
      const double theta = 2 * std::numbers::pi * k / kColumns;
      sweep.radius(i, k) = radius * (1 - 0.12 * u + 0.15 * std::cos(2 * theta) +
                                     0.05 * std::sin(3 * theta + u));
      sweep.log_ratio(i, k) = 0.1 * std::sin(u + theta);
    }
  }
  return sweep;
}

// Adds a tube of rings on the sweep's surface, closed by a pole at both ends.
inline void AddToyTube(const Sweep& sweep,
                       const Skeleton& skeleton,
                       int num_rings,
                       BodyPart part,
                       BodyTopology* topology,
                       std::vector<Eigen::Vector3d>* vertices) {
  constexpr int kRing = 16;
  const SweepAxis axis(sweep, skeleton, RestFrames(skeleton));
  const int base = static_cast<int>(vertices->size());
  const double first = sweep.key_u.front();
  const double range = sweep.key_u.back() - first;
  for (int i = 0; i < num_rings; ++i) {
    const double u = first + range * i / (num_rings - 1);
    const SectionFrame section = axis.At(u);
    for (int k = 0; k < kRing; ++k) {
      const double theta = 2 * std::numbers::pi * k / kRing;
      vertices->push_back(
          section.center_in_world +
          section.world_from_section * Radius(sweep, u, theta) *
              Eigen::Vector3d(std::cos(theta), std::sin(theta), 0));
    }
  }
  const int poles = static_cast<int>(vertices->size());
  for (const bool at_end : {false, true}) {
    const SectionFrame section = axis.At(at_end ? first + range : first);
    vertices->push_back(section.center_in_world +
                        (at_end ? 0.02 : -0.02) *
                            section.world_from_section.col(2));
  }

  const auto at = [&](int ring, int k) {
    return base + ring * kRing + k % kRing;
  };
  const auto add_quad = [&](const Quad& quad) {
    topology->quads.push_back(quad);
    topology->uv.push_back({Eigen::Vector2f(0.1f, 0.2f),
                            Eigen::Vector2f(0.3f, 0.2f),
                            Eigen::Vector2f(0.3f, 0.7f),
                            Eigen::Vector2f(0.1f, 0.7f)});
  };
  for (int i = 0; i + 1 < num_rings; ++i) {
    for (int k = 0; k < kRing; ++k) {
      add_quad({at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)});
    }
  }
  for (int k = 0; k < kRing; k += 2) {
    const int last = num_rings - 1;
    add_quad({poles, at(0, k + 2), at(0, k + 1), at(0, k)});
    add_quad({poles + 1, at(last, k), at(last, k + 1), at(last, k + 2)});
  }
  topology->part.resize(vertices->size(), part);
}

inline Body ToyBody(int rings_per_tube = 24) {
  Body body;
  body.skeleton = ToySkeleton();
  body.sweeps = {ToySweep("trunk",
                          {kRoot, kSpine, kNeck, kHead, kHeadEnd},
                          Eigen::Vector3d::UnitX(),
                          0.14),
                 ToySweep("l_arm",
                          {kLShoulder, kLElbow, kLWrist, kLHandEnd},
                          Eigen::Vector3d::UnitZ(),
                          0.05)};
  std::vector<Eigen::Vector3d> vertices;
  AddToyTube(body.sweeps[0],
             body.skeleton,
             rings_per_tube,
             BodyPart::kTrunk,
             &body.topology,
             &vertices);
  AddToyTube(body.sweeps[1],
             body.skeleton,
             rings_per_tube,
             BodyPart::kLArm,
             &body.topology,
             &vertices);

  const Eigen::Vector3d shoulder =
      RestFrames(body.skeleton).joint_in_world[kLShoulder];
  std::vector<std::vector<std::pair<int, double>>> sweep_weights;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const int own = body.topology.part[v] == BodyPart::kTrunk ? 0 : 1;
    const double other_weight =
        0.5 * std::exp(-(vertices[v] - shoulder).squaredNorm() / 0.01);
    if (other_weight < 0.01) {
      sweep_weights.push_back({{own, 1.0}});
    } else {
      sweep_weights.push_back(
          {{own, 1 - other_weight}, {1 - own, other_weight}});
    }
    body.topology.mirror_vertex.push_back(static_cast<int>(v));
  }
  BindVertices(vertices, sweep_weights, &body);
  return body;
}

// A posture with every joint turned by up to `max_angle` about a random axis,
// collar bones by 0.3 of it, and the root somewhere in the room.
inline Pose RandomPose(double max_angle, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] {
    const double x = uniform(generator);
    const double y = uniform(generator);
    const double z = uniform(generator);
    return Eigen::Vector3d(x, y, z);
  };
  Pose pose;
  pose.root_in_world = vector();
  for (Eigen::Quaterniond& rotation : pose.rotation) {
    const Eigen::Vector3d axis = vector().normalized();
    rotation = Eigen::AngleAxisd(max_angle * uniform(generator), axis);
  }
  for (Eigen::Quaterniond& rotation : pose.collar) {
    const Eigen::Vector3d axis = vector().normalized();
    rotation = Eigen::AngleAxisd(0.3 * max_angle * uniform(generator), axis);
  }
  return pose;
}

}  // namespace sweepfit
