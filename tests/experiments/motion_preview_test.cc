// SPDX-License-Identifier: Apache-2.0
#include "experiments/motion_preview.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "experiments/animated_webp.h"
#include "model/file_io.h"
#include "model/input_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

PreviewOptions Small() {
  PreviewOptions options;
  options.width = 96;
  options.height = 108;
  options.frames_per_second = 10;
  options.sheet_columns = 3;
  options.sheet_rows = 1;
  return options;
}

std::vector<Pose> Walk(int num) {
  std::vector<Pose> poses(num);
  for (int i = 0; i < num; ++i) {
    poses[i].root_in_world = {0, 0.9, 0.05 * i};
    poses[i].rotation[kLShoulder] =
        Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d::UnitX());
  }
  return poses;
}

// Chunks of a WebP file by name, in order.
std::vector<std::pair<std::string, std::string>> Chunks(
    const std::string& bytes) {
  std::vector<std::pair<std::string, std::string>> chunks;
  for (std::size_t at = 12; at + 8 <= bytes.size();) {
    std::uint32_t size = 0;
    for (int i = 3; i >= 0; --i) {
      size = size << 8 | static_cast<unsigned char>(bytes[at + 4 + i]);
    }
    chunks.emplace_back(bytes.substr(at, 4), bytes.substr(at + 8, size));
    at += 8 + size + size % 2;
  }
  return chunks;
}

int Number(const std::string& bytes, int at, int size) {
  int number = 0;
  for (int i = size - 1; i >= 0; --i) {
    number = number << 8 | static_cast<unsigned char>(bytes[at + i]);
  }
  return number;
}

TEST(MotionPreviewTest, ShowsTheBodyOnTheFloor) {
  const Body body = ToyBody();
  const cv::Mat3b red(4, 4, cv::Vec3b(0, 0, 200));
  const MotionPreview preview(body, red, Walk(11), 0.1, Small());
  EXPECT_EQ(preview.num_frames(), 11);
  EXPECT_FALSE(preview.is_cut_short());
  for (const int frame : {0, 5, 10}) {
    const cv::Mat3b picture = preview.Render(frame);
    int red_pixels = 0;
    double x = 0;
    for (int i = 0; i < picture.rows; ++i) {
      for (int j = 0; j < picture.cols; ++j) {
        const cv::Vec3b& color = picture(i, j);
        if (color[2] > 2 * color[0]) {
          ++red_pixels;
          x += j;
        }
      }
    }
    // The camera goes along: the body stays in the middle.
    EXPECT_GT(red_pixels, 100) << frame;
    EXPECT_NEAR(x / red_pixels, 48, 20) << frame;
    // The floor under it is darker than the background.
    EXPECT_LT(picture(picture.rows - 2, 4)[1], picture(1, 4)[1]);
  }
  // It does move.
  EXPECT_GT(cv::norm(preview.Render(0), preview.Render(10)), 100);
}

TEST(MotionPreviewTest, LongMotionsAreCutShort) {
  PreviewOptions options = Small();
  options.longest = 0.5;
  const Body body = ToyBody(6);
  const MotionPreview preview(body, {}, Walk(21), 0.1, options);
  EXPECT_TRUE(preview.is_cut_short());
  EXPECT_EQ(preview.num_frames(), 6);
}

TEST(MotionPreviewTest, FilesAreWholeAndTheSameForAnyNumberOfThreads) {
  const Body body = ToyBody(6);
  const MotionPreview preview(body, {}, Walk(5), 0.1, Small());
  const TemporaryFolder folder;
  std::string first_animation, first_sheet;
  for (const int threads : {1, 4}) {
    const tbb::global_control control(
        tbb::global_control::max_allowed_parallelism, threads);
    const std::string animation = (folder.path() / "a.webp").string();
    const std::string sheet = (folder.path() / "a.png").string();
    WriteMotionPreview(preview, Small(), animation, sheet, nullptr);
    const std::string bytes = ReadWholeFile(animation);
    if (threads == 1) {
      first_animation = bytes;
      first_sheet = ReadWholeFile(sheet);
    }
    EXPECT_EQ(bytes, first_animation);
    EXPECT_EQ(ReadWholeFile(sheet), first_sheet);
  }
  const cv::Mat sheet =
      cv::imread((folder.path() / "a.png").string(), cv::IMREAD_COLOR);
  EXPECT_EQ(sheet.cols, 3 * 48);
  EXPECT_EQ(sheet.rows, 54);

  ASSERT_EQ(first_animation.substr(0, 4), "RIFF");
  ASSERT_EQ(first_animation.substr(8, 4), "WEBP");
  int frames = 0, milliseconds = 0;
  for (const auto& [name, data] : Chunks(first_animation)) {
    if (name == "VP8X") {
      EXPECT_EQ(Number(data, 4, 3) + 1, 96);
      EXPECT_EQ(Number(data, 7, 3) + 1, 108);
    } else if (name == "ANIM") {
      EXPECT_EQ(Number(data, 4, 2), 0) << "plays for ever";
    } else if (name == "ANMF") {
      ++frames;
      milliseconds += Number(data, 12, 3);
    }
  }
  EXPECT_EQ(frames, 5);
  EXPECT_EQ(milliseconds, 500);
}

TEST(MotionPreviewTest, PathsThatCannotBeWrittenAreNamed) {
  const Body body = ToyBody(6);
  const MotionPreview preview(body, {}, Walk(1), 0.1, Small());
  EXPECT_THROW(
      WriteMotionPreview(
          preview, Small(), "/nowhere/a.webp", "/nowhere/a.png", nullptr),
      InputError);
}

TEST(MotionPreviewTest, OptionsAreChecked) {
  EXPECT_FALSE(PreviewOptions().Check());
  PreviewOptions options;
  options.width = 3;
  EXPECT_TRUE(options.Check());
  options = {};
  options.frames_per_second = 0;
  EXPECT_TRUE(options.Check());
  options = {};
  options.azimuth = NAN;
  EXPECT_TRUE(options.Check());
}

}  // namespace
}  // namespace sweepfit
