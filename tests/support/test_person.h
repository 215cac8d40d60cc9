// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "model/joint_angles.h"

namespace sweepfit {

// A plain skeleton for tests: arms 45 degrees down, legs straight.
inline Skeleton TestSkeleton() {
  Skeleton s;
  s.rest_direction[kRoot].setZero();
  s.length[kRoot] = 0;
  const auto set = [&](int joint, double x, double y, double z, double length) {
    s.rest_direction[joint] = Eigen::Vector3d(x, y, z).normalized();
    s.length[joint] = length;
  };
  set(kSpine, 0, 1, -0.1, 0.18);
  set(kNeck, 0, 1, -0.05, 0.38);
  set(kHead, 0, 1, 0.2, 0.10);
  set(kHeadEnd, 0, 1, 0.05, 0.15);
  for (const double side : {1.0, -1.0}) {
    const int arm = side > 0 ? kLShoulder : kRShoulder;
    const int leg = side > 0 ? kLHip : kRHip;
    set(arm, side, -0.3, 0, 0.2);
    set(arm + 1, side, -1, 0, 0.28);
    set(arm + 2, side, -1, 0.05, 0.26);
    set(arm + 3, side, -1, 0.05, 0.18);
    set(leg, side, -0.4, 0, 0.1);
    set(leg + 1, 0.05 * side, -1, 0, 0.4);
    set(leg + 2, 0.05 * side, -1, -0.03, 0.41);
    set(leg + 3, 0.1 * side, -0.2, 1, 0.19);
  }
  return s;
}

// Coordinates drawn within the joint limits, up to `scale` of their spread.
inline std::vector<double> RandomCoordinates(const JointAngles& angles,
                                             unsigned seed,
                                             double scale = 1) {
  std::mt19937 generator(seed);
  const auto uniform = [&] { return 2.0 * (generator() / 4294967296.0) - 1.0; };
  std::vector<double> pose = {uniform(), 1 + uniform(), uniform()};
  for (const JointAngle& angle : angles.angles()) {
    const double value =
        angle.usual + scale * uniform() * std::min(angle.sigma, 1.0);
    pose.push_back(std::clamp(value, angle.lower + 0.01, angle.upper - 0.01));
  }
  return pose;
}

}  // namespace sweepfit
