// SPDX-License-Identifier: Apache-2.0
//
// Fits of small synthetic captures, of people the template does not know.
#include <glog/logging.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <utility>

#include "experiments/metrics.h"
#include "experiments/result_folder.h"
#include "experiments/synthetic.h"
#include "model/file_io.h"
#include "model/gltf.h"
#include "model/input_error.h"
#include "model/lbs.h"
#include "model/template.h"
#include "solver/pipeline.h"
#include "tests/support/foreign_rig.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

SyntheticOptions SmallCapture() {
  SyntheticOptions options;
  options.num_cameras = 8;
  options.width = options.height = 400;
  options.background = false;  // given masks: segmentation has its own tests
  return options;
}

std::vector<std::string> CameraIds(const Capture& capture) {
  std::vector<std::string> ids;
  for (const CaptureCamera& camera : capture.cameras) {
    ids.push_back(camera.camera.id);
  }
  return ids;
}

JointPositions Joints(const PoseResult& pose) {
  return pose.frames.joint_in_world;
}

TEST(Fit, FollowsASyntheticPerson) {
  const TemporaryFolder folder;
  const Capture capture =
      WriteSyntheticCapture(folder.path() / "capture", SmallCapture(), nullptr);
  FitOptions options;
  options.until = "refine";
  const FitResult result =
      Fit(capture, {"A"}, CameraIds(capture), options, nullptr);
  for (const StageSummary& stage : result.stages) {
    EXPECT_TRUE(stage.status == "ok" || stage.status == "weak") << stage.stage;
    EXPECT_GE(stage.seconds, 0) << stage.stage;
    if (stage.stage != "refine") continue;
    EXPECT_EQ(stage.figures["turned_faces"].get<int>(), 0);
    EXPECT_EQ(stage.figures["torn_edges"].get<int>(), 0);
  }
  const std::filesystem::path truth = capture.folder / "truth" / "A";
  const JointError joints = CompareJoints(
      Joints(result.poses[0]), LoadTruthJoints(truth / "joints.json"));
  // One pixel is 7 mm here; the bounds are those of a fit that works, not its
  // accuracy, which tests/accuracy.sh measures on larger pictures.
  EXPECT_LT(joints.limb_mpjpe, 0.045);
  const TriangleMesh mesh =
      PosedMesh(result.body, result.poses[0].vertices_in_world);
  const TriangleMesh surface = LoadPly((truth / "surface.ply").string());
  EXPECT_LT(CompareSurfaces(mesh, surface, 10000, 1).mean, 0.010);
  EXPECT_LT(CompareSurfaces(surface, mesh, 10000, 1).mean, 0.010);
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
}

// Wherever the person turns and stands, left stays left.
class TurnedCapture : public ::testing::TestWithParam<int> {};

TEST_P(TurnedCapture, LeftStaysLeft) {
  const TemporaryFolder folder;
  SyntheticOptions synthetic = SmallCapture();
  synthetic.yaw_degrees = GetParam();
  synthetic.shift_x = 1;
  synthetic.shift_z = GetParam() == 90 ? -1 : 0;
  const Capture capture =
      WriteSyntheticCapture(folder.path() / "capture", synthetic, nullptr);
  FitOptions options;
  options.until = "global";
  const FitResult result =
      Fit(capture, {"A"}, CameraIds(capture), options, nullptr);
  const JointPositions truth =
      LoadTruthJoints(capture.folder / "truth" / "A" / "joints.json");
  const JointPositions joints = Joints(result.poses[0]);
  for (const int joint : {kLWrist, kRWrist, kLAnkle, kRAnkle, kLHip, kRHip}) {
    EXPECT_LT((joints[joint] - truth[joint]).norm(),
              (joints[joint] - truth[MirrorJoint(joint)]).norm())
        << kJointNames[joint];
  }
  EXPECT_LT(CompareJoints(joints, truth).limb_mpjpe, 0.06);
}

INSTANTIATE_TEST_SUITE_P(Yaw,
                         TurnedCapture,
                         ::testing::Values(0, 90, 180, 270));

TEST(Fit, PosesShareOneBody) {
  const TemporaryFolder folder;
  SyntheticOptions synthetic = SmallCapture();
  synthetic.poses = {"A", "T"};
  const Capture capture =
      WriteSyntheticCapture(folder.path() / "capture", synthetic, nullptr);
  FitOptions options;
  options.until = "local";
  const FitResult result =
      Fit(capture, {"A", "T"}, CameraIds(capture), options, nullptr);
  ASSERT_EQ(result.poses.size(), 2u);
  for (const PoseResult& pose : result.poses) {
    const JointError joints = CompareJoints(
        Joints(pose),
        LoadTruthJoints(capture.folder / "truth" / pose.name / "joints.json"));
    EXPECT_LT(joints.limb_mpjpe, 0.05) << pose.name;
    EXPECT_NEAR(
        (pose.frames.joint_in_world[kLKnee] - pose.frames.joint_in_world[kLHip])
            .norm(),
        result.body.skeleton.length[kLKnee],
        1e-9);
  }
}

TEST(Fit, ARingOfFourTakesMoreRounds) {
  const TemporaryFolder folder;
  const Capture capture =
      WriteSyntheticCapture(folder.path() / "capture", SmallCapture(), nullptr);
  const TriangleMesh surface =
      LoadPly((capture.folder / "truth" / "A" / "surface.ply").string());
  FitOptions options;
  options.until = "local";
  const auto fit = [&](const std::vector<std::string>& ids, int* rounds) {
    const FitResult result = Fit(capture, {"A"}, ids, options, nullptr);
    EXPECT_EQ(result.stages.back().stage, "local");
    *rounds = result.stages.back().figures["rounds"].get<int>();
    return CompareSurfaces(
               PosedMesh(result.body, result.poses[0].vertices_in_world),
               surface,
               10000,
               1)
        .mean;
  };
  const std::vector<std::string> all = CameraIds(capture);
  const std::vector<std::string> ring = {all[0], all[2], all[4], all[6]};
  int rounds = 0;
  fit(all, &rounds);
  EXPECT_EQ(rounds, options.local.rounds);
  const double error = fit(ring, &rounds);
  EXPECT_EQ(rounds, options.local.rounds_two_outlines);
  EXPECT_LT(error, 0.008);
  options.local.rounds_two_outlines = options.local.rounds;
  EXPECT_GT(fit(ring, &rounds), 1.02 * error);
}

TEST(Fit, LocalModesRunSideBySide) {
  const TemporaryFolder folder;
  const Capture capture =
      WriteSyntheticCapture(folder.path() / "capture", SmallCapture(), nullptr);
  for (const char* mode : {"paper", "hull"}) {
    FitOptions options;
    options.local.mode = mode;
    options.until = "local";
    const FitResult result =
        Fit(capture, {"A"}, CameraIds(capture), options, nullptr);
    const TriangleMesh mesh =
        PosedMesh(result.body, result.poses[0].vertices_in_world);
    const TriangleMesh surface =
        LoadPly((capture.folder / "truth" / "A" / "surface.ply").string());
    // Radii read off a hull inherit its bias, but not more than that.
    EXPECT_LT(CompareSurfaces(mesh, surface, 10000, 1).mean, 0.025) << mode;
  }
}

// The pictures see what the outlines do not.
TEST(Fit, PhotographsBringTheSurfaceCloser) {
  const TemporaryFolder folder;
  SyntheticOptions synthetic = SmallCapture();
  synthetic.width = synthetic.height = 700;
  const Capture capture =
      WriteSyntheticCapture(folder.path() / "capture", synthetic, nullptr);
  const TriangleMesh surface =
      LoadPly((capture.folder / "truth" / "A" / "surface.ply").string());
  std::array<double, 2> error{};
  // Of the left forearm's middle section.
  std::array<double, 2> sigma{}, photo_share{};
  for (const bool enabled : {false, true}) {
    FitOptions options;
    options.photo.enabled = enabled;
    options.until = "refine";
    const FitResult result =
        Fit(capture, {"A"}, CameraIds(capture), options, nullptr);
    const TriangleMesh mesh =
        PosedMesh(result.body, result.poses[0].vertices_in_world);
    error[enabled] = CompareSurfaces(mesh, surface, 10000, 1).mean +
                     CompareSurfaces(surface, mesh, 10000, 1).mean;
    for (const StageSummary& stage : result.stages) {
      if (stage.stage != "local") continue;
      const auto& arm = stage.figures["sections"]["l_arm"];
      const size_t middle = arm["u"].size() / 2;
      sigma[enabled] = arm["sigma"][middle];
      photo_share[enabled] = arm["photo"][middle];
    }
  }
  EXPECT_EQ(photo_share[0], 0);
  EXPECT_GT(photo_share[1], 0.05);
  EXPECT_LT(sigma[1], sigma[0]);
  EXPECT_GT(sigma[1], 0);
  RecordProperty("outlines_um", static_cast<int>(5e5 * error[0]));
  RecordProperty("photographs_um", static_cast<int>(5e5 * error[1]));
  EXPECT_LT(error[1], 0.8 * error[0]);
}

TEST(Fit, StartsFromAnImportedTemplate) {
  const TemporaryFolder folder;
  const Capture capture =
      WriteSyntheticCapture(folder.path() / "capture", SmallCapture(), nullptr);
  const Body person = BuildTemplate({.sex = 0.2, .stature = 1.6});
  FitOptions options;
  options.body_template.file = (folder.path() / "person.glb").string();
  SaveGlb(person,
          FitSkinWeights(person, 4, 1).weights,
          {},
          {},
          options.body_template.file);
  options.until = "refine";
  const FitResult result =
      Fit(capture, {"A"}, CameraIds(capture), options, nullptr);
  EXPECT_EQ(result.body.num_vertices(), person.num_vertices());
  const std::filesystem::path truth = capture.folder / "truth" / "A";
  EXPECT_LT(CompareJoints(Joints(result.poses[0]),
                          LoadTruthJoints(truth / "joints.json"))
                .limb_mpjpe,
            0.045);
  const TriangleMesh mesh =
      PosedMesh(result.body, result.poses[0].vertices_in_world);
  const TriangleMesh surface = LoadPly((truth / "surface.ply").string());
  EXPECT_LT(CompareSurfaces(mesh, surface, 10000, 1).mean, 0.012);
  EXPECT_LT(CompareSurfaces(surface, mesh, 10000, 1).mean, 0.012);
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());

  options.body_template.file = (folder.path() / "none.glb").string();
  EXPECT_THROW(Fit(capture, {"A"}, CameraIds(capture), options, nullptr),
               InputError);
}

// A rig of another make ends where our own template does.
TEST(Fit, AForeignRigIsAsAccurateAsOurTemplate) {
  const TemporaryFolder folder;
  const Capture capture =
      WriteSyntheticCapture(folder.path() / "capture", SmallCapture(), nullptr);
  const std::filesystem::path truth = capture.folder / "truth" / "A";
  const TriangleMesh surface = LoadPly((truth / "surface.ply").string());
  const std::string file = (folder.path() / "foreign.glb").string();
  WriteWholeFile(ForeignRig{}.Glb(BuildTemplate({.sex = 0.9, .stature = 1.85})),
                 file);
  std::array<double, 2> joints{}, distance{};
  for (const bool foreign : {false, true}) {
    FitOptions options;
    if (foreign) options.body_template.file = file;
    options.until = "refine";
    const FitResult result =
        Fit(capture, {"A"}, CameraIds(capture), options, nullptr);
    const TriangleMesh mesh =
        PosedMesh(result.body, result.poses[0].vertices_in_world);
    EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
    joints[foreign] = CompareJoints(Joints(result.poses[0]),
                                    LoadTruthJoints(truth / "joints.json"))
                          .limb_mpjpe;
    distance[foreign] = CompareSurfaces(mesh, surface, 10000, 1).mean +
                        CompareSurfaces(surface, mesh, 10000, 1).mean;
  }
  RecordProperty("joints_um", static_cast<int>(1e6 * joints[1]));
  RecordProperty("surface_um", static_cast<int>(5e5 * distance[1]));
  EXPECT_LT(joints[1], joints[0] + 0.010);
  EXPECT_LT(distance[1], 1.3 * distance[0]);
}

// A solution that is none is no result, whoever reads the report.
TEST(Fit, EndsWhereAStageFails) {
  const auto seen = std::make_shared<Observation>();
  seen->pose = "A";
  seen->landmarks.facing_in_world = Eigen::Vector3d::UnitZ();
  seen->landmarks.stature = 1.7;
  seen->landmarks.stature_sigma = 0.02;
  Landmark3 landmark;
  landmark.name = "head";
  landmark.joint = kHead;
  landmark.point_in_world.setConstant(std::nan(""));
  landmark.covariance = 1e-4 * Eigen::Matrix3d::Identity();
  seen->landmarks.landmarks = {landmark};
  FitOptions options;
  options.until = "joints";
  // Ceres prints all of a residual that it cannot evaluate.
  const int level = std::exchange(FLAGS_minloglevel, google::GLOG_ERROR);
  try {
    FitObserved({seen}, {}, options, nullptr);
    ADD_FAILURE() << "no FitError";
  } catch (const FitError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("joints: no usable"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("pose A"));
  }
  FLAGS_minloglevel = level;
}

TEST(Fit, RefusesWhatItCannotFit) {
  const TemporaryFolder folder;
  SyntheticOptions synthetic = SmallCapture();
  synthetic.num_cameras = 4;
  const Capture capture =
      WriteSyntheticCapture(folder.path() / "capture", synthetic, nullptr);
  const std::vector<std::string> ids = CameraIds(capture);
  EXPECT_THROW(Fit(capture, {"Z"}, ids, {}, nullptr), InputError);
  EXPECT_THROW(Fit(capture, {}, ids, {}, nullptr), InputError);
  EXPECT_THROW(Fit(capture, {"A"}, {ids[0]}, {}, nullptr), InputError);
  FitOptions options;
  options.until = "breakfast";
  EXPECT_THROW(Fit(capture, {"A"}, ids, options, nullptr), InputError);
}

}  // namespace
}  // namespace sweepfit
