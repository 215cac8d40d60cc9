// SPDX-License-Identifier: Apache-2.0
//
// The offsets from outline to joint are those of the template: on pictures of
// the template itself the landmarks speak of its own joints.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <numbers>
#include <string>

#include "capture/render.h"
#include "model/body.h"
#include "model/joint_angles.h"
#include "model/template.h"
#include "solver/landmarks.h"
#include "tests/volume/capsule_person.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

struct Stance {
  double sex;
  double raise_degrees;  // of the arms above their rest, 45 degrees down
};

// Eight cameras around, alternately high and low.
std::vector<View> Photograph(const TriangleMesh& mesh) {
  std::vector<View> views;
  for (int i = 0; i < 8; ++i) {
    const double angle = 2 * std::numbers::pi * i / 8 + 0.1;
    View view;
    view.camera = testing::LookAt(
        "cam" + std::to_string(i),
        {3 * std::sin(angle), i % 2 == 0 ? 1.7 : 0.7, 3 * std::cos(angle)},
        {0, 0.85, 0},
        700,
        600);
    view.coverage = RenderCoverage(view.camera, mesh, 3);
    view.signed_distance = SignedDistance(view.camera, view.coverage);
    views.push_back(std::move(view));
  }
  return views;
}

class LandmarkTemplateTest : public ::testing::TestWithParam<Stance> {};

TEST_P(LandmarkTemplateTest, SpeaksOfTheTemplatesJoints) {
  TemplateOptions options;
  options.sex = GetParam().sex;
  const Body body = BuildTemplate(options);
  Pose pose;
  const double raise = GetParam().raise_degrees * std::numbers::pi / 180;
  // Raising an arm lifts the collar bone by about a third of what is above the
  // rest pose.
  const double lift = std::max(0.0, raise) / 4;
  for (const int side : {0, 1}) {
    const double sign = side == 0 ? 1 : -1;
    pose.collar[side] = Eigen::AngleAxisd(sign * lift, Vector3d::UnitZ());
    pose.rotation[side == 0 ? kLShoulder : kRShoulder] =
        Eigen::AngleAxisd(sign * raise, Vector3d::UnitZ());
  }
  TriangleMesh mesh;
  mesh.vertices = PoseVertices(body, pose);
  double floor = 1e9;
  for (const Vector3d& v : mesh.vertices) floor = std::min(floor, v.y());
  pose.root_in_world.y() -= floor;
  mesh.vertices = PoseVertices(body, pose);
  mesh.triangles = TriangulateQuads(body.topology.quads, mesh.vertices);
  const JointFrames frames = ForwardKinematics(body.skeleton, pose);
  const std::vector<View> views = Photograph(mesh);
  const Volume volume = BuildVisualHull(views, HullOptions(), nullptr, nullptr);
  const LandmarkResult result =
      FindLandmarks(views, volume, {}, LandmarkOptions(), nullptr, nullptr);
  // Metres; what the landmarks of a person that is all template may be off.
  const std::map<std::string, double> largest = {{"root", 0.03},
                                                 {"neck", 0.025},
                                                 {"head", 0.02},
                                                 {"head_end", 0.016},
                                                 {"l_shoulder", 0.055},
                                                 {"l_elbow", 0.035},
                                                 {"l_wrist", 0.03},
                                                 {"l_hand_end", 0.015},
                                                 {"l_hip", 0.03},
                                                 {"l_knee", 0.022},
                                                 {"l_ankle", 0.022},
                                                 {"l_foot_end", 0.015}};
  for (const auto& [name, bound] : largest) {
    for (const bool mirrored : {false, true}) {
      if (mirrored && name[0] != 'l') continue;
      const std::string side = mirrored ? "r" + name.substr(1) : name;
      const Landmark3* landmark = result.Find(side);
      ASSERT_NE(landmark, nullptr) << side;
      const Vector3d error =
          landmark->point_in_world - frames.joint_in_world[landmark->joint];
      EXPECT_LT(error.norm(), bound) << side << " " << error.transpose();
      EXPECT_LT(error.dot(landmark->covariance.ldlt().solve(error)), 12)
          << side << " " << error.transpose();
    }
  }
  // Armpits and crotch are found, beside the joints that they speak of.
  ASSERT_NE(result.Find("crotch"), nullptr);
  const Vector3d hip = frames.joint_in_world[kRoot];
  const Vector3d crotch = result.Find("crotch")->point_in_world;
  EXPECT_NEAR((hip.y() - crotch.y()) / result.stature, 0.052, 0.01);
  int armpits = 0;
  for (const char* name : {"l_armpit", "r_armpit"}) {
    const Landmark3* armpit = result.Find(name);
    if (armpit == nullptr) continue;
    ++armpits;
    EXPECT_EQ(armpit->joint, -1);
    const int joint = name[0] == 'l' ? kLShoulder : kRShoulder;
    EXPECT_LT((frames.joint_in_world[joint] - armpit->point_in_world).norm(),
              0.11 * result.stature);
  }
  // An arm nearer to the trunk than this closes its armpit.
  constexpr double kArmpitCloses = -20;  // degrees above rest
  if (GetParam().raise_degrees >= kArmpitCloses) {
    EXPECT_GE(armpits, 1);
  }
}

INSTANTIATE_TEST_SUITE_P(Stances,
                         LandmarkTemplateTest,
                         ::testing::Values(Stance{0, 0},
                                           Stance{1, 0},
                                           Stance{0, 43},
                                           Stance{1, 43},
                                           Stance{0.5, -20},
                                           Stance{0.5, -25}));

}  // namespace
}  // namespace sweepfit
