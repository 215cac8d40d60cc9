// SPDX-License-Identifier: Apache-2.0
#include "capture/picture_pattern.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

class PatternTest : public ::testing::Test {
 protected:
  void Touch(const std::string& name) {
    fs::create_directories((folder_.path() / name).parent_path());
    WriteBytes(folder_.path() / name, "x");
  }
  FoundPictures Find(const std::string& pattern,
                     const std::vector<std::string>& ids) {
    return FindPictures((folder_.path() / pattern).string(), ids);
  }
  std::string Error(const std::string& pattern,
                    const std::vector<std::string>& ids) {
    try {
      Find(pattern, ids);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }
  TemporaryFolder folder_;
};

TEST_F(PatternTest, TellsPosesAndCamerasApart) {
  for (const char* name : {"shots/A/cam_1.jpg",
                           "shots/A/cam_2.jpg",
                           "shots/T/cam_1.jpg",
                           "shots/T/cam_1.txt",
                           "shots/T/cam_11.jpg",
                           "shots/deeper/T/cam_1.jpg"}) {
    Touch(name);
  }
  const auto found = Find("shots/{pose}/{camera}.jpg", {"cam_1", "cam_2"});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found.at("A").size(), 2u);
  ASSERT_EQ(found.at("T").size(), 1u);
  EXPECT_EQ(found.at("T").at("cam_1"),
            folder_.path() / "shots" / "T" / "cam_1.jpg");
}

TEST_F(PatternTest, SplitsNamesByTheKnownIds) {
  Touch("a_b_cam_0.png");
  const auto found = Find("{pose}_{camera}.png", {"cam_0"});
  EXPECT_EQ(found.at("a_b").at("cam_0"), folder_.path() / "a_b_cam_0.png");
}

TEST_F(PatternTest, FindsTheCameraInNamesWithoutAMark) {
  Touch("plates/left.png");
  Touch("plates/right-empty.png");
  Touch("plates/notes.png");
  const auto found = Find("plates/*.png", {"left", "right"});
  EXPECT_EQ(found.at("").size(), 2u);
  EXPECT_EQ(found.at("").at("right"),
            folder_.path() / "plates" / "right-empty.png");
  // A folder per camera.
  Touch("rig/left/0001.png");
  Touch("rig/right/0001.png");
  EXPECT_EQ(Find("rig/*/000?.png", {"left", "right"}).at("").at("left"),
            folder_.path() / "rig" / "left" / "0001.png");
}

TEST_F(PatternTest, TakesSignsOfExpressionsLiterally) {
  Touch("a+b (1)/cam.0.png");
  EXPECT_EQ(Find("a+b (1)/{camera}.png", {"cam.0"}).at("").size(), 1u);
  EXPECT_THAT(Error("a+b (1)/{camera}.png", {"cam-0"}),
              HasSubstr("no picture of a camera"));
}

TEST_F(PatternTest, RejectsWhatIsAmbiguous) {
  Touch("x/left.png");
  Touch("x/left.jpg");
  EXPECT_THAT(Error("x/{camera}.*", {"left"}), HasSubstr("the same camera"));
  Touch("y/left-right.png");
  EXPECT_THAT(Error("y/*", {"left", "right"}),
              HasSubstr("may be of camera left or right"));
  EXPECT_THAT(Error("none/*", {"left"}), HasSubstr("no picture of a camera"));
}

}  // namespace
}  // namespace sweepfit
