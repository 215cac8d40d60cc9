// SPDX-License-Identifier: Apache-2.0
#include "experiments/check_capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>

#include "experiments/synthetic.h"
#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

CameraCheck Of(const CaptureCheck& check, const std::string& id) {
  for (const CameraCheck& camera : check.cameras) {
    if (camera.id == id) return camera;
  }
  ADD_FAILURE() << "no camera " << id;
  return {};
}

// Small pictures with given masks.
Capture CaptureWithMasks(const TemporaryFolder& folder, int num_cameras) {
  SyntheticOptions options;
  options.num_cameras = num_cameras;
  options.width = options.height = 240;
  options.background = false;
  return WriteSyntheticCapture(folder.path(), options, nullptr);
}

// One synthetic capture, sound and with one thing wrong at a time.
TEST(CheckCapture, PassesSoundCapturesAndNamesWhatIsWrong) {
  TemporaryFolder folder;
  SyntheticOptions options;
  options.num_cameras = 8;
  options.width = options.height = 420;
  const Capture sound = WriteSyntheticCapture(folder.path(), options, nullptr);

  const CaptureCheck fine = CheckCapture(sound, {}, nullptr);
  EXPECT_TRUE(fine.CanWork());
  EXPECT_THAT(fine.warnings, IsEmpty());
  for (const CameraCheck& camera : fine.cameras) {
    EXPECT_THAT(camera.problems, IsEmpty()) << camera.id;
    EXPECT_TRUE(camera.is_used);
    EXPECT_LT(camera.coherence.miss, 0.6) << camera.id;
    EXPECT_NEAR(camera.exposure_gain, 1, 0.1);
  }
  EXPECT_EQ(fine.num_fit_cameras, 8);
  EXPECT_NEAR(fine.largest_gap, 45, 10);
  EXPECT_NEAR(fine.largest_outline_gap, 45, 10);
  EXPECT_LT(fine.lean, 15);
  EXPECT_GT(fine.person_height, 1.4);
  EXPECT_LT(fine.person_height, 2.1);
  EXPECT_THAT(CheckTable(fine), HasSubstr("verdict: fine"));
  EXPECT_EQ(CheckToJson(fine)["cameras"].size(), 8u);
  EXPECT_EQ(CheckToJson(fine)["can_work"], true);

  Capture turned = sound;
  Camera& camera = turned.cameras[5].camera;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.3 * std::numbers::pi / 180, Eigen::Vector3d::UnitY())
          .toRotationMatrix();
  camera.camera_from_world = turn * camera.camera_from_world;
  camera.world_in_camera = turn * camera.world_in_camera;
  const CaptureCheck off = CheckCapture(turned, {}, nullptr);
  EXPECT_TRUE(off.CanWork());
  for (const CameraCheck& c : off.cameras) {
    EXPECT_EQ(c.problems.empty(), c.id != camera.id) << c.id;
  }
  ASSERT_THAT(Of(off, camera.id).problems, ::testing::SizeIs(1));
  EXPECT_THAT(Of(off, camera.id).problems[0], HasSubstr("is turned by 0."));
  EXPECT_THAT(CheckTable(off), HasSubstr("look at " + camera.id));

  Capture swapped = sound;
  swapped.cameras[2].background = sound.cameras[6].background;
  const CaptureCheck plate = CheckCapture(swapped, {}, nullptr);
  EXPECT_THAT(Of(plate, sound.cameras[2].camera.id).problems,
              ::testing::Contains(HasSubstr("does not belong")));
  EXPECT_THAT(Of(plate, sound.cameras[6].camera.id).problems, IsEmpty());
}

// With few cameras it counts where they stand.
TEST(CheckCapture, OppositeCamerasAreOneOutline) {
  TemporaryFolder folder;
  const Capture eight = CaptureWithMasks(folder, 8);
  const auto with = [&eight](const std::vector<int>& kept) {
    Capture capture = eight;
    for (int c = 0; c < 8; ++c) {
      if (std::find(kept.begin(), kept.end(), c) == kept.end()) {
        capture.holdout.push_back(eight.cameras[c].camera.id);
      }
    }
    return CheckCapture(capture, {}, nullptr);
  };
  const CaptureCheck ring = with({0, 2, 4, 6});
  EXPECT_NEAR(ring.largest_gap, 90, 10);
  EXPECT_NEAR(ring.largest_outline_gap, 90, 10);
  EXPECT_THAT(CheckTable(ring), HasSubstr("opposite each other"));
  const CaptureCheck spread = with({0, 1, 3, 6});
  EXPECT_NEAR(spread.largest_gap, 135, 10);
  EXPECT_NEAR(spread.largest_outline_gap, 45, 10);
  EXPECT_THAT(CheckTable(spread), Not(HasSubstr("opposite each other")));
  EXPECT_LT(spread.expected_surface, ring.expected_surface);
}

// Units, axis and number of cameras, on given masks.
TEST(CheckCapture, SaysWhyACaptureCannotWork) {
  TemporaryFolder folder;
  const Capture sound = CaptureWithMasks(folder, 6);

  Capture giant = sound;
  for (CaptureCamera& entry : giant.cameras) {
    entry.camera.world_in_camera *= 100;
  }
  const CaptureCheck units = CheckCapture(giant, {}, nullptr);
  EXPECT_FALSE(units.CanWork());
  EXPECT_THAT(CheckTable(units), HasSubstr("correct 'units'"));

  Capture lying = sound;
  const Eigen::Matrix3d quarter =
      Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitX())
          .toRotationMatrix();
  for (CaptureCamera& entry : lying.cameras) {
    entry.camera.camera_from_world *= quarter;
  }
  const CaptureCheck axis = CheckCapture(lying, {}, nullptr);
  EXPECT_FALSE(axis.CanWork());
  EXPECT_THAT(CheckTable(axis), HasSubstr("correct 'up'"));

  // A fit takes two cameras, and the check does not call that impossible.
  Capture few = sound;
  few.holdout = {"cam00", "cam01", "cam02", "cam03"};
  const CaptureCheck two = CheckCapture(few, {}, nullptr);
  EXPECT_TRUE(two.CanWork());
  EXPECT_THAT(CheckTable(two), HasSubstr("2 cameras leave the body much"));
  few.holdout.push_back("cam04");
  const CaptureCheck one = CheckCapture(few, {}, nullptr);
  EXPECT_FALSE(one.CanWork());
  EXPECT_THAT(CheckTable(one), HasSubstr("only 1 of the cameras"));
}

// The check sees what a fit with these options would see.
TEST(CheckCapture, FindsSilhouettesAsTheOptionsSay) {
  TemporaryFolder folder;
  const Capture capture = CaptureWithMasks(folder, 4);
  SegmentOptions options;
  options.mode = "plate";
  EXPECT_THROW(CheckCapture(capture, options, nullptr), InputError);
}

}  // namespace
}  // namespace sweepfit
