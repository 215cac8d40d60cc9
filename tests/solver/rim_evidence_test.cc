// SPDX-License-Identifier: Apache-2.0
#include "solver/rim_evidence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "model/template.h"
#include "tests/solver/seen_mesh.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// A standing body and its own silhouette.
class OwnOutline : public ::testing::Test {
 protected:
  OwnOutline() : body_(BuildTemplate({.stature = 1.7})) {
    Pose pose;
    pose.root_in_world = {0, 0.95, 0};
    posed_ = PoseForFit(body_, pose);
  }

  RimEvidence Look(const std::vector<Vector3d>& from,
                   const OutlineOptions& options = {}) const {
    constexpr double kMaxDistance = 20;  // pixels
    const testing::SeenMesh seen =
        testing::SeeMesh(posed_.mesh, from, 1000, 900);
    return GatherRimEvidence(posed_,
                             body_.topology.quads,
                             seen.views,
                             seen.contours,
                             kMaxDistance,
                             options);
  }

  bool IsLowerLeg(int vertex) const {
    const double height = posed_.mesh.vertices[vertex].y();
    return height > 0.2 && height < 0.5;
  }

  // Mean weight of the contour points that lower legs explain, as a share of
  // that of the others.
  double LegShare(const RimEvidence& rims) const {
    double legs = 0, rest = 0;
    int num_legs = 0, num_rest = 0;
    for (const ContourPair& pair : rims.contour) {
      const bool is_leg = IsLowerLeg(pair.vertex);
      (is_leg ? legs : rest) += pair.weight;
      ++(is_leg ? num_legs : num_rest);
    }
    EXPECT_GT(num_legs, 20);
    EXPECT_GT(num_rest, 100);
    return legs / num_legs / (rest / num_rest);
  }

  Body body_;
  PosedBody posed_;
};

constexpr double kFar = 3.5;
const Vector3d kFront(0, 1.2, kFar), kBack(0, 1.6, -kFar);
const Vector3d kLeft(kFar, 1.2, 0), kRight(-kFar, 1.6, 0);

TEST_F(OwnOutline, EveryPartOfItIsExplained) {
  const RimEvidence rims = Look({kFront});
  EXPECT_LT(rims.num_unexplained, 0.01 * rims.contour.size());
  for (const RimPoint& rim : rims.rim) {
    EXPECT_GT(rim.weight, 0);
    EXPECT_LE(rim.weight, rim.trust);
  }
}

TEST_F(OwnOutline, OppositeCamerasShareTheOutlineOfLegsSideBySide) {
  EXPECT_LT(LegShare(Look({kLeft, kRight})), 0.8);
  EXPECT_GT(LegShare(Look({kFront, kBack})), 0.99);
  // Nobody else sees this one.
  EXPECT_GT(LegShare(Look({kLeft})), 0.99);
  EXPECT_GT(LegShare(Look({kLeft, kFront})), 0.99);
  // As asked for.
  EXPECT_GT(LegShare(Look({kLeft, kRight}, {.opposite_rival_weight = 1})),
            0.99);
}

TEST_F(OwnOutline, InnerOfTwoRimsSideBySideSaysLittle) {
  // Turned so far that from the left one leg's rim runs just inside the
  // other's.
  Pose pose;
  pose.root_in_world = {0, 0.95, 0};
  pose.rotation[0] = Eigen::AngleAxisd(0.04, Vector3d::UnitY());
  posed_ = PoseForFit(body_, pose);
  const auto legs = [&](const OutlineOptions& options) {
    std::vector<RimPoint> rims;
    for (const RimPoint& rim : Look({kLeft}, options).rim) {
      if (IsLowerLeg(rim.vertex)) rims.push_back(rim);
    }
    return rims;
  };
  int num_inner = 0, num_outer = 0;
  const std::vector<RimPoint> rims = legs({.inner_rival_weight = 0.2});
  for (const RimPoint& rim : rims) {
    const bool is_inner =
        std::any_of(rims.begin(), rims.end(), [&](const RimPoint& other) {
          const Eigen::Vector2d offset = other.pixel - rim.pixel;
          return posed_.mesh.vertices[rim.vertex].x() *
                         posed_.mesh.vertices[other.vertex].x() <
                     0 &&
                 offset.norm() < 3 && other.normal.dot(rim.normal) > 0.9 &&
                 offset.dot(rim.normal) > 0.5;
        });
    if (is_inner) {
      EXPECT_EQ(rim.trust, 0.2);
    }
    num_inner += is_inner;
    num_outer += rim.trust == 1;
  }
  EXPECT_GT(num_inner, 0);
  EXPECT_GT(num_outer, num_inner);
  for (const RimPoint& rim : legs({.inner_rival_weight = 1}))
    EXPECT_EQ(rim.trust, 1);
}

std::vector<View> Stand(const std::vector<Vector3d>& places) {
  std::vector<View> views;
  for (const Vector3d& place : places) {
    views.emplace_back().camera =
        testing::LookAt("camera", place, {0, 0.9, 0}, 1000, 900);
  }
  return views;
}

TEST(Outlines, OppositeViewsSeeOne) {
  const Vector3d kAbove(0, 5, 0.1), kHalfLeft(kFar, 1.2, kFar);
  EXPECT_EQ(NumOutlines({}), 0);
  EXPECT_EQ(NumOutlines(Stand({kFront})), 1);
  EXPECT_EQ(NumOutlines(Stand({kFront, kBack})), 1);
  EXPECT_EQ(NumOutlines(Stand({kLeft, kFront, kRight, kBack})), 2);
  EXPECT_EQ(NumOutlines(Stand({kFront, kHalfLeft, kLeft, kRight})), 3);
  // In whatever order.
  const Vector3d kBesideFront(0.3, 1.2, kFar);
  EXPECT_EQ(NumOutlines(Stand({kFront, kBesideFront, kBack})), 2);
  EXPECT_EQ(NumOutlines(Stand({kFront, kBack, kBesideFront})), 2);
  // From above there is no side.
  EXPECT_EQ(NumOutlines(Stand({kFront, kAbove, kBack})), 2);
  EXPECT_EQ(HaveOpposite(Stand({kFront, kHalfLeft, kBack})),
            (std::vector<bool>{true, false, true}));
}

}  // namespace
}  // namespace sweepfit
