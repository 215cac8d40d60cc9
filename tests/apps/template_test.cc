// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "model/body_io.h"
#include "model/mesh.h"
#include "tests/apps/command.h"

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
