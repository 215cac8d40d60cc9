// SPDX-License-Identifier: Apache-2.0
#include "solver/solve_person.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "model/template.h"
#include "tests/solver/seen_mesh.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// A body seen from the front and from behind only, and what is known of it.
class FrontAndBack : public ::testing::Test {
 protected:
  FrontAndBack() : body_(BuildTemplate({.stature = 1.7})) {
    truth_.root_in_world = {0, 0.95, 0};
    const PosedBody posed = PoseForFit(body_, truth_);
    seen_ = testing::SeeMesh(posed.mesh, {{0, 0.9, 3}, {0, 0.9, -3}}, 400, 300);
    hull_ = std::make_unique<Volume>(
        BuildVisualHull(seen_.views, {0.02}, nullptr, nullptr));
    photo_ = std::make_unique<PhotoEvidence>(
        seen_.views, *hull_, PhotoEvidenceOptions());
    for (int v = 0; v < body_.num_vertices(); v += 7) {
      points_.push_back({v, posed.mesh.vertices[v], posed.normals[v], 0.0015});
    }
  }

  // How far the root is off in depth after a solve that starts 20 mm off.
  double DepthError(const std::vector<PictureMatches>& pictures,
                    double weight) {
    Body body = body_;
    JointResult joints;
    joints.base = joints.skeleton = body.skeleton;
    joints.stature = body.stature;
    joints.stature_sigma = 0.02;
    const JointAngles angles(body.skeleton);
    std::vector<double> start(angles.num_parameters(), 0.0);
    start[1] = truth_.root_in_world.y();
    start[2] = truth_.root_in_world.z() + 0.02;
    joints.coordinates = {start};
    JointEstimate estimate;
    estimate.pose = angles.ToPose(start.data());
    estimate.frames = ForwardKinematics(body.skeleton, estimate.pose);
    joints.poses = {estimate};
    JointOptions options;
    options.weights.photo = weight;
    EXPECT_TRUE(SolvePerson({{&seen_.views,
                              &seen_.contours,
                              hull_.get(),
                              &landmarks_,
                              photo_.get()}},
                            {0.004, 20, 10, 3},
                            pictures,
                            options,
                            nullptr,
                            nullptr,
                            &body,
                            &joints,
                            nullptr));
    return std::abs(joints.poses[0].pose.root_in_world.z() -
                    truth_.root_in_world.z());
  }

  Body body_;
  Pose truth_;
  testing::SeenMesh seen_;
  std::unique_ptr<Volume> hull_;
  std::unique_ptr<PhotoEvidence> photo_;
  LandmarkResult landmarks_;
  std::vector<PhotoPoint> points_;
};

// Outlines from the front and from behind hardly change when a person stands
// nearer to one of the cameras; the matched surface does.
TEST_F(FrontAndBack, PhotographsTellTheDepth) {
  const double without = DepthError({}, JointOptions::Weights().photo);
  const double with =
      DepthError({{{points_}, {}}}, JointOptions::Weights().photo);
  EXPECT_LT(with, 0.003);
  EXPECT_LT(with, 0.5 * without);
  EXPECT_DOUBLE_EQ(DepthError({{{points_}, {}}}, 0), without);
}

}  // namespace
}  // namespace sweepfit
