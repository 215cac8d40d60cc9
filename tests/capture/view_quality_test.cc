// SPDX-License-Identifier: Apache-2.0
#include "capture/view_quality.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "capture/plate_shift.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Somebody fills a tenth of the picture, and nothing is wrong.
ViewEvidence Sound() {
  ViewEvidence evidence;
  evidence.covered = 0.1;
  return evidence;
}

TEST(ViewQuality, NothingWrongIsOne) {
  const ViewQuality quality = JudgeView(Sound());
  EXPECT_DOUBLE_EQ(quality.value, 1);
  EXPECT_THAT(quality.reasons, IsEmpty());
}

TEST(ViewQuality, EachFaultCostsAndIsNamed) {
  const auto expect = [](auto spoil, const char* says) {
    ViewEvidence evidence = Sound();
    spoil(&evidence);
    const ViewQuality quality = JudgeView(evidence);
    EXPECT_LT(quality.value, 0.9) << says;
    ASSERT_EQ(quality.reasons.size(), 1u) << says;
    EXPECT_THAT(quality.reasons[0], HasSubstr(says));
  };
  using E = ViewEvidence;
  expect([](E* e) { e->noise_ratio = 5; }, "is it the plate of this camera");
  expect([](E* e) { e->gain = {1.8, 1.8, 1.8}; }, "exposure");
  expect([](E* e) { e->plate_shift = 8; }, "moved by 8.0 px");
  expect([](E* e) { e->outline_contrast = 0.3; }, "70 % of the outline");
  expect([](E* e) { e->stray = 1.5; }, "other things changed too");
  expect([](E* e) { e->covered = 0.9; }, "covers most");
  expect([](E* e) { e->covered = 0; }, "nobody is seen");
  expect([](E* e) { e->on_frame = 0.4; }, "cuts the person");
}

TEST(ViewQuality, FaultsAddUp) {
  ViewEvidence moved = Sound(), stray = Sound(), both = Sound();
  moved.plate_shift = both.plate_shift = 6;
  stray.stray = both.stray = 1;
  EXPECT_DOUBLE_EQ(JudgeView(both).value,
                   JudgeView(moved).value * JudgeView(stray).value);
  EXPECT_LT(JudgeView(both).value, JudgeView(moved).value);
}

// A wall of smooth random patches.
cv::Mat3b Wall() {
  cv::RNG random(7);
  cv::Mat3b wall(180, 240);
  random.fill(wall, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(wall, wall, {0, 0}, 3);
  cv::normalize(wall, wall, 20, 235, cv::NORM_MINMAX);
  return wall;
}

TEST(PlateShift, FindsHowFarTheCameraMoved) {
  const cv::Mat3b plate = Wall();
  const cv::Point2d moved(2.4, -1.3);
  cv::Mat3b picture = Shift(plate, moved);
  // Somebody stands there, who does not move with the wall.
  cv::rectangle(picture, {90, 30, 50, 140}, {40, 60, 200}, cv::FILLED);
  const cv::Point2d found = MeasurePlateShift(picture, plate, {1, 1, 1});
  EXPECT_NEAR(found.x, moved.x, 0.1);
  EXPECT_NEAR(found.y, moved.y, 0.1);
}

TEST(PlateShift, StillCameraAndBareWallAreZero) {
  const cv::Mat3b plate = Wall();
  cv::Mat3b picture = plate.clone();
  cv::rectangle(picture, {90, 30, 50, 140}, {40, 60, 200}, cv::FILLED);
  EXPECT_LT(cv::norm(MeasurePlateShift(picture, plate, {1, 1, 1})), 0.1);
  const cv::Mat3b bare(180, 240, cv::Vec3b(90, 90, 90));
  EXPECT_EQ(MeasurePlateShift(bare, bare, {1, 1, 1}), cv::Point2d(0, 0));
}

}  // namespace
}  // namespace sweepfit
