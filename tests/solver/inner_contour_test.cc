// SPDX-License-Identifier: Apache-2.0
#include "solver/inner_contour.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "capture/render.h"
#include "model/median.h"
#include "model/template.h"
#include "tests/volume/capsule_person.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// A body seen from its left, with its arm in front of the trunk.
class SeenFromTheLeft : public ::testing::Test {
 protected:
  SeenFromTheLeft() : body_(BuildTemplate({.stature = 1.7})) {
    Pose pose;
    pose.root_in_world = {0, 0.95, 0};
    posed_ = PoseForFit(body_, pose);
    view_.camera =
        testing::LookAt("left", {3, 1.2, 0.2}, {0, 0.9, 0}, 1000, 900);
    view_.coverage = RenderCoverage(view_.camera, posed_.mesh);
    view_.signed_distance = SignedDistance(view_.camera, view_.coverage);
  }

  bool IsArm(int vertex) const {
    return body_.topology.part[vertex] == BodyPart::kLArm;
  }

  void Paint(const cv::Vec3b& arm, const cv::Vec3b& rest) {
    std::vector<cv::Vec3b> color;
    for (int v = 0; v < body_.num_vertices(); ++v) {
      color.push_back(IsArm(v) ? arm : rest);
    }
    view_.image = RenderShaded(view_.camera, posed_.mesh, color);
  }

  // The arm grown by so much along its normals.
  PosedBody Grown(double by) const {
    PosedBody grown = posed_;
    for (int v = 0; v < body_.num_vertices(); ++v) {
      if (IsArm(v)) grown.mesh.vertices[v] += by * posed_.normals[v];
    }
    return grown;
  }

  std::vector<ContourPair> Match(const PosedBody& posed) const {
    return MatchInnerContours({InnerContour(view_, {})},
                              posed,
                              body_.topology,
                              RayScene(posed.mesh),
                              0.025);
  }

  Body body_;
  PosedBody posed_;
  View view_;
};

TEST_F(SeenFromTheLeft, EdgesTellHowThickAnArmIs) {
  Paint({90, 90, 200}, {160, 120, 60});
  for (const double by : {0.0, 0.008, -0.006}) {
    const PosedBody grown = Grown(by);
    std::vector<double> found;
    for (const ContourPair& pair : Match(grown)) {
      if (!IsArm(pair.vertex)) continue;
      const Vector3d& x = grown.mesh.vertices[pair.vertex];
      const double pixel_size = pair.depth / view_.camera.FocalLength();
      found.push_back(pixel_size *
                      pair.contour_normal.dot(view_.camera.ProjectPinhole(x) -
                                              pair.contour_pixel));
      EXPECT_EQ(pair.view, 0);
      EXPECT_GT(pair.weight, 0);
      EXPECT_LE(pair.weight, 1);
    }
    ASSERT_GT(found.size(), 15u) << by;
    EXPECT_NEAR(MedianInPlace(&found), by, 0.0025) << by;
  }
}

TEST_F(SeenFromTheLeft, NoEdgeNoPair) {
  view_.image = cv::Mat3b(900, 900, cv::Vec3b(120, 120, 120));
  EXPECT_TRUE(Match(posed_).empty());
}

TEST_F(SeenFromTheLeft, NobodySeenNoPair) {
  view_.image = cv::Mat3b(900, 900, cv::Vec3b(120, 120, 120));
  view_.coverage = 0;
  EXPECT_TRUE(Match(posed_).empty());
}

// The outline of the person is others' business.
TEST_F(SeenFromTheLeft, PairsLieInsideTheSilhouette) {
  Paint({90, 90, 200}, {160, 120, 60});
  for (const ContourPair& pair : Match(Grown(0.005))) {
    EXPECT_LT(SampleBilinear(view_.signed_distance, pair.contour_pixel).value,
              -5);
  }
}

TEST(InnerContourOptions, RefusesNoWeight) {
  InnerContourOptions options;
  EXPECT_FALSE(options.Check());
  options.weight = 0;
  EXPECT_TRUE(options.Check());
}

}  // namespace
}  // namespace sweepfit
