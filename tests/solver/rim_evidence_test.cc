// SPDX-License-Identifier: Apache-2.0
#include "solver/rim_evidence.h"

#include <gtest/gtest.h>

#include <vector>

#include "capture/render.h"
#include "model/template.h"
#include "tests/volume/capsule_person.h"

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

  RimEvidence Look(const Vector3d& from) const {
    View view;
    view.camera = testing::LookAt("camera", from, {0, 0.9, 0}, 1000, 900);
    view.coverage = RenderCoverage(view.camera, posed_.mesh);
    view.signed_distance = SignedDistance(view.camera, view.coverage);
    constexpr double kSpacing = 4, kMaxDistance = 20;  // pixels
    const std::vector<ObservedContour> contours = {
        ObserveContour(view, kSpacing)};
    return GatherRimEvidence(
        posed_, body_.topology.quads, {view}, contours, kMaxDistance);
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

TEST_F(OwnOutline, EveryPartOfItIsExplained) {
  const RimEvidence rims = Look({0, 1.2, 3.5});
  EXPECT_LT(rims.num_unexplained, 0.01 * rims.contour.size());
  for (const RimPoint& rim : rims.rim) {
    EXPECT_GT(rim.weight, 0);
    EXPECT_LE(rim.weight, rim.trust);
  }
}

TEST_F(OwnOutline, LegsSideBySideInThePictureAreTrustedLess) {
  EXPECT_GT(LegShare(Look({0, 1.2, 3.5})), 0.99);
  EXPECT_LT(LegShare(Look({3.5, 1.2, 0})), 0.5);
  const RimEvidence front = Look({0, 1.2, 3.5});
  size_t num_distrusted = 0;
  for (const RimPoint& rim : front.rim) {
    if (IsLowerLeg(rim.vertex)) {
      EXPECT_EQ(rim.trust, 1);
    }
    num_distrusted += rim.trust < 1;
  }
  EXPECT_LT(num_distrusted, front.rim.size() / 20);
}

}  // namespace
}  // namespace sweepfit
