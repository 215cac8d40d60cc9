// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_contours.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/volume/capsule_person.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;
using testing::Capsule;

constexpr double kRadius = 0.055;

// Four cameras around two upright legs at these places on the floor; the middle
// of the first leg as each view measures it.
std::vector<EdgeMidpoint> MeasureFirstLeg(const std::vector<View>& views,
                                          const Vector3d& knee) {
  std::vector<EdgeMidpoint> edges;
  for (const View& view : views) {
    const auto edge = MeasureLimb(view, knee, Vector3d::UnitY(), 0.12);
    if (edge) edges.push_back(*edge);
  }
  return edges;
}

std::vector<View> SeeLegs(const Vector3d& left, const Vector3d& right) {
  std::vector<Capsule> legs;
  for (const Vector3d& at : {left, right}) {
    legs.push_back(
        {at - 0.4 * Vector3d::UnitY(), at + 0.4 * Vector3d::UnitY(), kRadius});
  }
  std::vector<View> views;
  for (int i = 0; i < 4; ++i) {
    const double angle = 0.5 * std::numbers::pi * i;
    const Vector3d center(
        3 * std::sin(angle), left.y() + 0.3, 3 * std::cos(angle));
    views.push_back(testing::RenderCapsules(
        testing::LookAt(
            "cam" + std::to_string(i), center, {0, left.y(), 0}, 600, 500),
        legs));
  }
  return views;
}

// Pixels between the measured middle and the limb's own, across the limb.
double Miss(const PointObservation& seen, const Vector3d& knee) {
  return std::abs(
      seen.axis.dot(seen.pinhole_pixel - seen.camera->ProjectPinhole(knee)));
}

TEST(AllowForNeighbours, TheOtherLegCountsAsNotKnown) {
  const Vector3d left(0.13, 0.5, 0), right(-0.13, 0.5, -0.06);
  const std::vector<View> views = SeeLegs(left, right);
  const std::vector<EdgeMidpoint> edges = MeasureFirstLeg(views, left);
  ASSERT_EQ(edges.size(), 4u);
  const std::vector<PointObservation> seen = AllowForNeighbours(edges);
  ASSERT_EQ(seen.size(), 4u);
  for (size_t i = 0; i < seen.size(); ++i) {
    const double before = edges[i].observation.sigma_along_axis;
    const double miss = Miss(seen[i], left);
    if (i % 2 == 0) {
      // From the front and from behind the legs stand apart.
      EXPECT_DOUBLE_EQ(seen[i].sigma_along_axis, before);
      EXPECT_LT(miss, 3 * before);
    } else {
      // From the sides they look like one wide leg.
      EXPECT_GT(miss, 4 * before);
      EXPECT_LT(miss, 2 * seen[i].sigma_along_axis);
    }
  }
  // Both sides err in the same way: together they know no more than one.
  const TriangulationOptions options;
  const PointPrior prior{left, AlongAcross(Vector3d::UnitY(), 0.02, 0.05)};
  const auto found = TriangulatePoint(seen, prior, options);
  ASSERT_TRUE(found);
  const double error = std::abs(found->point_in_world.z() - left.z());
  EXPECT_GT(error, 0.01);
  EXPECT_LT(error, 2.5 * std::sqrt(found->covariance(2, 2)));
}

TEST(AllowForNeighbours, ALimbThatStandsAloneIsKnownAsMeasured) {
  const Vector3d left(0.13, 0.5, 0), far(-0.13, 0.5, -0.4);
  const std::vector<View> views = SeeLegs(left, far);
  const std::vector<EdgeMidpoint> edges = MeasureFirstLeg(views, left);
  ASSERT_GE(edges.size(), 3u);
  const std::vector<PointObservation> seen = AllowForNeighbours(edges);
  for (size_t i = 0; i < seen.size(); ++i) {
    EXPECT_DOUBLE_EQ(seen[i].sigma_along_axis,
                     edges[i].observation.sigma_along_axis);
  }
  EXPECT_TRUE(AllowForNeighbours({}).empty());
}

// A tip less than its reach from its base, which no outline is near.
TEST(MeasureTip, SaysNothingWhereThereIsNoEdge) {
  const View view = SeeLegs({0.13, 0.5, 0}, {-0.13, 0.5, 0}).front();
  TipPlace place;
  place.base_in_world = {0, 0.5, 0};  // between the legs
  place.half_width = 0.01;
  EXPECT_FALSE(MeasureTip(view, place, {0, 0.48, 0}));
}

}  // namespace
}  // namespace sweepfit
