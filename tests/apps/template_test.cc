// SPDX-License-Identifier: Apache-2.0
#include "model/template.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "experiments/synthetic.h"
#include "model/body_io.h"
#include "model/file_io.h"
#include "model/mesh.h"
#include "tests/apps/command.h"
#include "tests/support/foreign_rig.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;

TEST(Template, WritesBodyMeshModelAndPictures) {
  TemporaryFolder scratch;
  const auto out = std::filesystem::path(scratch.path()) / "woman";
  const CommandOutcome outcome = RunCommand({"template",
                                             "--out",
                                             out.string(),
                                             "--sex",
                                             "0",
                                             "--stature",
                                             "1.6",
                                             "--size",
                                             "64"},
                                            scratch.path());
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Body body = LoadBody((out / "body.json").string());
  EXPECT_EQ(body.sex, 0);
  EXPECT_EQ(body.stature, 1.6);
  const TriangleMesh mesh = LoadPly((out / "template.ply").string());
  EXPECT_EQ(static_cast<int>(mesh.vertices.size()), body.num_vertices());
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_GT(std::filesystem::file_size(out / "template.glb"), 100000u);
  for (const char* name : {"front", "head_left", "hand_palm", "crotch_below"}) {
    const cv::Mat picture =
        cv::imread((out / "renders" / (std::string(name) + ".png")).string());
    ASSERT_FALSE(picture.empty()) << name;
    // Something is drawn on the white ground.
    EXPECT_LT(cv::mean(picture)[0], 250) << name;
  }
}

// A rig of another make, looked at and fitted as a user does.
TEST(Template, AForeignRigIsImportedAndFitted) {
  TemporaryFolder scratch;
  const auto folder = std::filesystem::path(scratch.path());
  const std::string rig = (folder / "rig.glb").string();
  WriteWholeFile(ForeignRig{}.Glb(BuildTemplate({.sex = 1})), rig);
  const CommandOutcome looked = RunCommand({"template",
                                            "--from",
                                            rig,
                                            "--out",
                                            (folder / "looked").string(),
                                            "--size",
                                            "64"},
                                           scratch.path());
  ASSERT_EQ(looked.status, 0) << looked.err;
  EXPECT_THAT(looked.err, HasSubstr("2 holes filled"));
  EXPECT_TRUE(
      std::filesystem::exists(folder / "looked" / "renders" / "front.png"));

  SyntheticOptions options;
  options.num_cameras = 8;
  options.width = options.height = 260;
  options.background = false;
  WriteSyntheticCapture(folder / "capture", options, nullptr);
  const CommandOutcome fitted = RunCommand({"fit",
                                            (folder / "capture").string(),
                                            "--out",
                                            (folder / "result").string(),
                                            "--template",
                                            rig,
                                            "--set",
                                            "texture.size=256",
                                            "global.rounds=2",
                                            "local.rounds=2"},
                                           scratch.path());
  ASSERT_EQ(fitted.status, 0) << fitted.err;
  const Body body = LoadBody((folder / "result" / "body.json").string());
  const TriangleMesh mesh =
      LoadPly((folder / "result" / "mesh_A.ply").string());
  EXPECT_EQ(static_cast<int>(mesh.vertices.size()), body.num_vertices());
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_TRUE(std::filesystem::exists(folder / "result" / "model.glb"));

  const CommandOutcome unknown = RunCommand({"template",
                                             "--from",
                                             rig,
                                             "--names",
                                             "vrm",
                                             "--out",
                                             (folder / "none").string()},
                                            scratch.path());
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, HasSubstr("map file"));
}

TEST(Template, ReplacesATemplateAndNoFit) {
  TemporaryFolder scratch;
  const std::string out = (scratch.path() / "out").string();
  std::filesystem::create_directory(out);
  WriteBytes(scratch.path() / "out" / "body.json", "of a fit");
  const std::vector<std::string> arguments = {
      "template", "--out", out, "--size", "64"};
  const CommandOutcome refused = RunCommand(arguments, scratch.path());
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("is not replaced"));
  EXPECT_EQ(ReadBytes(scratch.path() / "out" / "body.json"), "of a fit");
  std::filesystem::remove_all(out);
  for (int i = 0; i < 2; ++i) {
    const CommandOutcome outcome = RunCommand(arguments, scratch.path());
    EXPECT_EQ(outcome.status, 0) << outcome.err;
  }
}

TEST(Template, RefusesWhatCannotBe) {
  TemporaryFolder scratch;
  const CommandOutcome tall = RunCommand(
      {"template", "--out", "giant", "--stature", "3"}, scratch.path());
  EXPECT_EQ(tall.status, 2);
  EXPECT_THAT(tall.err, HasSubstr("stature"));
  const CommandOutcome small =
      RunCommand({"template", "--out", "tiny", "--size", "1"}, scratch.path());
  EXPECT_EQ(small.status, 2);
  EXPECT_THAT(small.err, HasSubstr("--size"));
  EXPECT_FALSE(
      std::filesystem::exists(std::filesystem::path(scratch.path()) / "tiny"));
}

}  // namespace
}  // namespace sweepfit
