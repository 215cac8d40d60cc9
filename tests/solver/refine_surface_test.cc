// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "model/template.h"
#include "solver/displacement.h"
#include "solver/fit_body.h"
#include "tests/solver/seen_mesh.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// A body whose thighs swell to the outside, the left one more, seen as
// silhouettes by a ring of cameras.
class SwollenThighs : public ::testing::Test {
 protected:
  SwollenThighs()
      : body_(BuildTemplate({.stature = 1.7})), rest_(RestVertices(body_)) {
    Pose pose;
    pose.root_in_world = {0, 0.95, 0};
    joints_.poses.resize(1);
    joints_.poses[0].pose = pose;
    swollen_ = body_;
    const std::vector<Vector3d> normals = NormalsAtRest();
    std::vector<Vector3d> move(rest_.size(), Vector3d::Zero());
    for (size_t v = 0; v < rest_.size(); ++v) {
      const bool is_left = rest_[v].x() > 0;
      const Vector3d out(std::abs(rest_[v].x()), rest_[v].y(), rest_[v].z());
      const double distance = (out - middle_).norm() / kReach;
      const double swelling = is_left ? kLeft : kRight;
      move[v] = swelling * std::exp(-distance * distance) * normals[v];
    }
    DisplaceAtRest(move, &swollen_);
    seen_ = testing::SeeMesh(PoseForFit(swollen_, pose).mesh,
                             {{0, 1, 3}, {3, 1, 0}, {0, 1, -3}, {-3, 1, 0.5}},
                             800,
                             600);
    hull_ = std::make_unique<Volume>(
        BuildVisualHull(seen_.views, {0.01}, nullptr, nullptr));
  }

  // By how much more the left thigh swells than the right one in a refinement
  // that starts from `body`, metres.
  double Difference(Body body,
                    const std::vector<Vector3d>& reference_rest,
                    double sigma_symmetry) const {
    RefineOptions options;
    options.sigma_symmetry = sigma_symmetry;
    StageSummary summary;
    RefineSurface({{&seen_.views, &seen_.contours, hull_.get(), &landmarks_}},
                  options,
                  reference_rest,
                  joints_,
                  &body,
                  &summary);
    EXPECT_GT(summary.figures["rounds"].get<int>(), 0);
    return Swelling(body, true) - Swelling(body, false);
  }

  std::vector<Vector3d> NormalsAtRest() const {
    return VertexNormals(
        {rest_, TriangulateQuads(body_.topology.quads, rest_)});
  }

  // To the outside, where the thigh swells most.
  double Swelling(const Body& body, bool is_left) const {
    const std::vector<Vector3d> now = RestVertices(body);
    double farthest = 0;
    for (size_t v = 0; v < rest_.size(); ++v) {
      if ((rest_[v].x() > 0) != is_left) continue;
      if (std::abs(rest_[v].y() - middle_.y()) > 0.3 * kReach) continue;
      farthest = std::max(farthest, std::abs(now[v].x()));
    }
    return farthest;
  }

  static constexpr double kLeft = 0.012, kRight = 0.004;  // metres
  static constexpr double kReach = 0.1;
  const Vector3d middle_{0.17, -0.25, 0};

  Body body_, swollen_;
  std::vector<Vector3d> rest_;
  JointResult joints_;
  testing::SeenMesh seen_;
  std::unique_ptr<Volume> hull_;
  LandmarkResult landmarks_;
};

// What the outlines see differs, and by default they decide; a body that must
// be symmetric takes the mean.
TEST_F(SwollenThighs, SymmetryYieldsToTheOutlines) {
  const double truth = Swelling(swollen_, true) - Swelling(swollen_, false);
  EXPECT_GT(truth, 0.006);
  EXPECT_NEAR(Difference(body_, rest_, RefineOptions().sigma_symmetry),
              truth,
              0.25 * truth);
  EXPECT_LT(std::abs(Difference(body_, rest_, 1e-4)), 0.15 * truth);
}

// A template may be made with one leg thicker than the other.
TEST_F(SwollenThighs, DifferencesOfTheTemplateStay) {
  const double truth = Swelling(swollen_, true) - Swelling(swollen_, false);
  std::vector<Vector3d> inwards = NormalsAtRest();
  for (Vector3d& move : inwards) move *= -0.003;
  Body thinner = swollen_;
  DisplaceAtRest(inwards, &thinner);
  EXPECT_NEAR(
      Difference(thinner, RestVertices(swollen_), 1e-4), truth, 0.15 * truth);
}

}  // namespace
}  // namespace sweepfit
