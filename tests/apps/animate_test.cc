// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "model/body_io.h"
#include "model/bvh.h"
#include "model/file_io.h"
#include "model/template.h"
#include "tests/apps/command.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/walking_rig.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;

// A result folder with nothing but a body, and a motion.
class AnimateTest : public ::testing::Test {
 protected:
  AnimateTest() {
    static const Body kBody = BuildTemplate({});
    std::filesystem::create_directory(Path("result"));
    SaveBody(kBody, Path("result/body.json"));
    WalkingRig rig;
    rig.Walk(1.5);
    SaveBvh(rig.motion(), Path("walk.bvh"));
  }

  std::string Path(const std::string& name) const {
    return (folder_.path() / name).string();
  }

  CommandOutcome Animate(const std::vector<std::string>& options) const {
    std::vector<std::string> arguments = {"animate", Path("result")};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return RunCommand(arguments, folder_.path());
  }

  static void ExpectError(const CommandOutcome& outcome,
                          const std::string& text) {
    EXPECT_EQ(outcome.status, 2) << outcome.err;
    ASSERT_EQ(outcome.ErrorLines().size(), 1u) << outcome.err;
    EXPECT_THAT(outcome.ErrorLines()[0], HasSubstr(text));
  }

  TemporaryFolder folder_;
};

TEST_F(AnimateTest, WritesClipMotionAndPreviewRepeatably) {
  std::vector<std::string> first;
  for (const char* threads : {"1", "2"}) {
    const CommandOutcome outcome = Animate({"--bvh",
                                            Path("walk.bvh"),
                                            "--out",
                                            Path("walk.glb"),
                                            "--bvh-out",
                                            Path("ours.bvh"),
                                            "--preview",
                                            Path("walk.webp"),
                                            "--fps",
                                            "30",
                                            "--start",
                                            "0.5",
                                            "--end",
                                            "0.7",
                                            "--threads",
                                            threads});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("7 frames, 0.20 s"));
    EXPECT_THAT(outcome.err, HasSubstr("retarget"));
    std::vector<std::string> bytes;
    for (const char* name :
         {"walk.glb", "ours.bvh", "walk.webp", "walk_sheet.png"}) {
      bytes.push_back(ReadWholeFile(Path(name)));
      EXPECT_GT(bytes.back().size(), 100u) << name;
    }
    if (first.empty()) first = bytes;
    EXPECT_EQ(bytes, first);
  }
  EXPECT_EQ(first[0].substr(0, 4), "glTF");
  const BvhPoses ours =
      PosesFromBvh(LoadBvh(Path("ours.bvh")), Path("ours.bvh"));
  ASSERT_EQ(ours.poses.size(), 7u);
  EXPECT_GT(ours.poses[0].root_in_world.y(), 0.7);
}

TEST_F(AnimateTest, WhatIsWrongIsNamed) {
  const std::string walk = Path("walk.bvh"), out = Path("bad.glb");
  ExpectError(Animate({"--bvh", Path("none.bvh"), "--out", out}),
              Path("none.bvh"));
  ExpectError(RunCommand({"animate", Path("x"), "--bvh", walk, "--out", out},
                         folder_.path()),
              "body.json");
  WriteWholeFile("HIERARCHY\nROOT Hips\n{\n  OFFSET 0 0\n", Path("bad.bvh"));
  ExpectError(Animate({"--bvh", Path("bad.bvh"), "--out", out}),
              Path("bad.bvh") + ":5: OFFSET is not a number");
  ExpectError(Animate({"--bvh", walk, "--out", out, "--map", "acclaim"}),
              "acclaim");
  ExpectError(Animate({"--bvh", walk, "--out", out, "--map", "makehuman"}),
              "unmapped");
  ExpectError(Animate({"--bvh", walk, "--out", out, "--scale", "parsec"}),
              "--scale");
  ExpectError(Animate({"--bvh", walk, "--out", out, "--start", "99"}),
              "no frame");
  ExpectError(Animate({"--bvh", walk, "--out", out, "--preview", "a.avi"}),
              "*.webp");
  ExpectError(Animate({"--bvh",
                       walk,
                       "--out",
                       out,
                       "--preview",
                       Path("a.webp"),
                       "--view",
                       "nan"}),
              "azimuth");
  ExpectError(Animate({"--bvh", walk, "--out", out, "--fps", "-3"}),
              "frames per second");
  ExpectError(Animate({"--bvh", walk}), "--out");
  EXPECT_FALSE(std::filesystem::exists(out));
}

}  // namespace
}  // namespace sweepfit
