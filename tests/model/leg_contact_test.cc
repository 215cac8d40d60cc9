// SPDX-License-Identifier: Apache-2.0
#include "model/leg_contact.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

// Hips 0.2 m apart, legs straight down, thigh and shank 0.4 m each.
Skeleton StraightLegs() {
  Skeleton skeleton = ToySkeleton();
  for (const int hip : {kLHip, kRHip}) {
    skeleton.rest_direction[hip] = Vector3d(hip == kLHip ? 1 : -1, 0, 0);
    skeleton.length[hip] = 0.1;
    for (const int joint : {hip + 1, hip + 2}) {
      skeleton.rest_direction[joint] = -Vector3d::UnitY();
      skeleton.length[joint] = 0.4;
    }
  }
  return skeleton;
}

Pose Turned(int joint, double degrees, const Vector3d& axis) {
  Pose pose;
  pose.rotation[joint] = Eigen::AngleAxisd(degrees * kDegree, axis);
  return pose;
}

TEST(LegContact, ParallelLegsAreApartByTheirDistanceLessTheirBreadth) {
  // Thickest where thighs begin: 0.2 m at the hip, 0.08 m at the knee.
  const LegContact contact(StraightLegs(), 0.1, 0.1);
  EXPECT_NEAR(contact.Gap(Pose()), 0.15 * (0.2 - 0.08), 1e-9);
  // Feet broader than what parts the legs.
  const LegContact broad(StraightLegs(), 0.1, 0.3);
  EXPECT_NEAR(broad.Gap(Pose()), 0.2 - 0.3 * 0.8, 1e-9);
}

TEST(LegContact, LegsThatCrossAtOneHeightOverlapByTheirBreadth) {
  const LegContact contact(StraightLegs(), 0.1, 0.1);
  // To the right: the left shank passes the right one.
  const Pose pose = Turned(kLHip, -20, Vector3d::UnitZ());
  EXPECT_LT(contact.Gap(pose), -0.07);
  EXPECT_GE(contact.Gap(pose), -0.2);
  // The same in front of it.
  Pose front = pose;
  front.rotation[kLHip] = Eigen::AngleAxisd(-40 * kDegree, Vector3d::UnitX()) *
                          front.rotation[kLHip];
  EXPECT_GT(contact.Gap(front), 0);
}

// Against distances of closely spaced points of the bones.
TEST(LegContact, FindsTheLeastGap) {
  const Skeleton skeleton = ToySkeleton();
  constexpr double kKnee = 0.15, kFoot = 0.1, kCrotch = 0.15;
  const LegContact contact(skeleton, kKnee, kFoot);
  const double leg = skeleton.length[kLKnee] + skeleton.length[kLAnkle];
  const double hips = 2 * skeleton.length[kLHip];
  for (unsigned seed = 0; seed < 30; ++seed) {
    const Pose pose = RandomPose(0.8, seed);
    const JointFrames frames = ForwardKinematics(skeleton, pose);
    constexpr int kSteps = 400;
    const auto point = [&](int hip, int i, double* radius) {
      const double u = kCrotch + (2 - kCrotch) * i / kSteps;
      const auto& x = frames.joint_in_world;
      if (u < 1) {
        *radius = ((1 - u) * hips + u * kKnee * leg) / 2;
        return Vector3d((1 - u) * x[hip] + u * x[hip + 1]);
      }
      *radius = ((2 - u) * kKnee + (u - 1) * kFoot) * leg / 2;
      return Vector3d((2 - u) * x[hip + 1] + (u - 1) * x[hip + 2]);
    };
    double least = 1e9;
    for (int i = 0; i <= kSteps; ++i) {
      for (int k = 0; k <= kSteps; ++k) {
        double left = 0, right = 0;
        const Vector3d way = point(kLHip, i, &left) - point(kRHip, k, &right);
        least = std::min(least, way.norm() - left - right);
      }
    }
    EXPECT_LE(contact.Gap(pose), least + 1e-9) << seed;
    EXPECT_NEAR(contact.Gap(pose), least, 0.003) << seed;
  }
}

}  // namespace
}  // namespace sweepfit
