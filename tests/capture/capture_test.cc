// SPDX-License-Identifier: Apache-2.0
#include "capture/capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "model/input_error.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;

constexpr char kYaml[] = R"(version: 1
units: m
up: y
cameras:
  - id: front
    width: 32
    height: 24
    K: [40, 0, 15.5, 0, 41, 11.5, 0, 0, 1]
    distortion: [0.1, -0.02, 0.001, 0.002, 0.01]
    R: [1, 0, 0, 0, 1, 0, 0, 0, 1]
    t: [0.1, 0.2, 3]
    background: plate.png
    chroma_key: green
  - id: side
    width: 32
    height: 24
    K: [40, 0, 15.5, 0, 41, 11.5, 0, 0, 1]
    R: [0, 0, 1, 0, 1, 0, -1, 0, 0]
    t: [0, 0, 2.5]
holdout: [side]
poses:
  - name: A
    images: {front: a.png, side: b.png}
    masks: {front: m.png}
)";

class CaptureTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(::testing::TempDir()) /
              (std::string("sweepfit_") + info->test_suite_name() + "_" +
               info->name() + "_" + std::to_string(getpid()));
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_ / "folder");
    for (const char* name : {"a.png", "b.png", "m.png", "plate.png"}) {
      cv::imwrite((folder_ / name).string(),
                  cv::Mat3b(24, 32, cv::Vec3b(10, 20, 30)));
    }
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void Write(const std::string& yaml) const {
    std::ofstream(folder_ / "capture.yaml") << yaml;
  }
  void WriteBytes(const std::string& name,
                  const std::vector<unsigned char>& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
  Capture LoadGood() const {
    Write(kYaml);
    return LoadCapture(folder_);
  }
  // The message of the InputError that `action` throws.
  template <typename Action>
  static std::string ErrorOf(Action action) {
    try {
      action();
    } catch (const InputError& e) {
      return e.what();
    }
    return "no InputError";
  }

  std::filesystem::path folder_;
};

std::string Replaced(std::string text,
                     const std::string& from,
                     const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  if (at != std::string::npos) text.replace(at, from.size(), to);
  return text;
}

TEST_F(CaptureTest, ReadsEveryField) {
  const Capture capture = LoadGood();
  ASSERT_EQ(capture.cameras.size(), 2u);
  const Camera& camera = capture.cameras[0].camera;
  EXPECT_EQ(camera.id, "front");
  EXPECT_EQ(camera.width, 32);
  EXPECT_EQ(camera.height, 24);
  EXPECT_EQ(camera.K(1, 1), 41);
  EXPECT_EQ(camera.K(0, 2), 15.5);
  EXPECT_EQ(camera.distortion[4], 0.01);
  EXPECT_EQ(camera.world_in_camera, Eigen::Vector3d(0.1, 0.2, 3));
  EXPECT_EQ(capture.cameras[1].camera.camera_from_world(0, 2), 1);
  EXPECT_THAT(capture.cameras[0].background,
              ::testing::ElementsAre("plate.png"));
  EXPECT_EQ(capture.cameras[0].chroma_key, "green");
  EXPECT_TRUE(capture.cameras[1].background.empty());
  EXPECT_TRUE(capture.IsHoldout("side"));
  EXPECT_FALSE(capture.IsHoldout("front"));
  EXPECT_EQ(capture.FindPose("A").images.at("side"), "b.png");
  EXPECT_EQ(capture.FindPose("A").masks.at("front"), "m.png");
  EXPECT_THROW(capture.FindPose("B"), InputError);
  EXPECT_THROW(capture.FindCamera("top"), InputError);
}

TEST_F(CaptureTest, SavedCaptureLoadsToTheSameNumbers) {
  Capture capture = LoadGood();
  capture.cameras[0].camera.K(0, 0) = 1513.0 / 7;
  capture.cameras[0].camera.camera_from_world =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized())
          .toRotationMatrix();
  capture.cameras[0].camera.world_in_camera = {1.0 / 3, -1e-7, 2.0 / 7};
  SaveCapture(capture);
  const Capture loaded = LoadCapture(folder_);
  for (int i = 0; i < 2; ++i) {
    const Camera& a = capture.cameras[i].camera;
    const Camera& b = loaded.cameras[i].camera;
    EXPECT_EQ(a.id, b.id);
    EXPECT_EQ(a.K, b.K);
    EXPECT_EQ(a.distortion, b.distortion);
    EXPECT_EQ(a.camera_from_world, b.camera_from_world);
    EXPECT_EQ(a.world_in_camera, b.world_in_camera);
    EXPECT_EQ(capture.cameras[i].background, loaded.cameras[i].background);
    EXPECT_EQ(capture.cameras[i].chroma_key, loaded.cameras[i].chroma_key);
  }
  EXPECT_EQ(capture.holdout, loaded.holdout);
  EXPECT_EQ(capture.poses[0].images, loaded.poses[0].images);
  EXPECT_EQ(capture.poses[0].masks, loaded.poses[0].masks);
}

TEST_F(CaptureTest, TurnsTheUpAxisAndConvertsUnits) {
  // A point 1 m along the file's up axis must come out at (0, 1, 0), and the
  // camera must see it where it saw it before.
  const std::vector<std::pair<std::string, Eigen::Vector3d>> cases = {
      {"y", {0, 1, 0}},
      {"z", {0, 0, 1}},
      {"-y", {0, -1, 0}},
      {"-z", {0, 0, -1}}};
  for (const auto& [up, up_in_file] : cases) {
    Write(Replaced(kYaml, "up: y", "up: " + up));
    const Camera camera = LoadCapture(folder_).cameras[1].camera;
    Eigen::Matrix3d camera_from_file;
    camera_from_file << 0, 0, 1, 0, 1, 0, -1, 0, 0;
    const Eigen::Vector3d expected =
        camera_from_file * up_in_file + Eigen::Vector3d(0, 0, 2.5);
    EXPECT_NEAR(
        (camera.PointInCamera(Eigen::Vector3d::UnitY()) - expected).norm(),
        0,
        1e-12)
        << up;
    EXPECT_NEAR(camera.camera_from_world.determinant(), 1, 1e-12) << up;
  }
  Write(Replaced(kYaml, "units: m", "units: mm"));
  EXPECT_NEAR(
      LoadCapture(folder_).cameras[0].camera.world_in_camera.z(), 0.003, 1e-15);
}

TEST_F(CaptureTest, OrthonormalisesRoundedRotations) {
  Write(Replaced(kYaml,
                 "R: [1, 0, 0, 0, 1, 0, 0, 0, 1]",
                 "R: [0.8, 0.6001, 0, -0.6, 0.8, 0, 0, 0, 1]"));
  const Eigen::Matrix3d R =
      LoadCapture(folder_).cameras[0].camera.camera_from_world;
  EXPECT_NEAR(
      (R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 0, 1e-14);
}

TEST_F(CaptureTest, RejectsEveryMalformedFile) {
  struct Case {
    std::string from, to, message;
  };
  const std::vector<Case> cases = {
      {"version: 1", "version: 2", "'version' must be 1"},
      {"version: 1\n", "", "'version' is missing"},
      {"units: m", "units: inch", "'units' must be"},
      {"up: y", "up: x", "'up' must be"},
      {"holdout:", "hold_out:", "unknown key 'hold_out'"},
      {"    height: 24", "    hight: 24", "unknown key 'hight'"},
      {"    width: 32\n", "", "'width' is missing"},
      {"width: 32", "width: wide", "'width' must be an integer"},
      {"width: 32", "width: 8", "'width' must be 16"},
      {"K: [40,", "K: [.nan,", "not finite"},
      {"K: [40,", "K: [-40,", "positive focal"},
      {"K: [40, 0,", "K: [40, 0.5,", "no skew"},
      {"0, 0, 1]\n    distortion", "0, 0, 2]\n    distortion", "row 0, 0, 1"},
      {"K: [40, 0,", "K: [40,", "must have 9 numbers, not 8"},
      {"K: [40,", "K: [forty,", "numbers only"},
      {"[0.1, -0.02, 0.001, 0.002, 0.01]", "[0.1, 0.2]", "4 or 5 numbers"},
      {"[0.1, -0.02,",
       "[-8, 4,",
       "camera front: 'distortion' folds the picture"},
      {"R: [1, 0, 0, 0, 1", "R: [1, 0, 0, 0, -1", "reflection"},
      {"R: [1, 0, 0, 0, 1", "R: [1, 0, 0, 0, 1.1", "no rotation"},
      {"t: [0.1, 0.2, 3]", "t: [0.1, 0.2]", "must have 3 numbers"},
      {"t: [0.1, 0.2, 3]", "t: [.inf, 0.2, 3]", "not finite"},
      {"id: side", "id: front", "used twice"},
      {"id: side", "id: ../side", "plain name"},
      {"holdout: [side]", "holdout: [top]", "unknown camera top"},
      {"holdout: [side]", "holdout: [side, side]", "twice"},
      {"holdout: [side]", "holdout: side", "must be a list"},
      {"chroma_key: green", "chroma_key: red", "green, blue or auto"},
      {"background: plate.png", "background: none.png", "no file"},
      {"front: a.png", "front: none.png", "no file"},
      {"front: a.png", "front: folder", "not a file"},
      {"front: a.png", "top: a.png", "unknown camera top"},
      {"{front: a.png,", "{front: a.png, front: b.png,", "given twice"},
      {"{front: a.png, side: b.png}", "{}", "names no picture"},
      {"{front: a.png, side: b.png}", "{side: b.png}", "mask but no image"},
      {"masks: {front", "masks: {top", "unknown camera top"},
      {"name: A", "name: A/B", "plain name"},
      {"poses:", "poses: 3\nx:", "unknown key 'x'"},
      {"    images", "    - images", "not well-formed"},
  };
  for (const Case& c : cases) {
    Write(Replaced(kYaml, c.from, c.to));
    const std::string message = ErrorOf([&] { LoadCapture(folder_); });
    EXPECT_THAT(message, HasSubstr(c.message)) << c.to;
    EXPECT_THAT(message, HasSubstr("capture.yaml:")) << c.to;
    EXPECT_EQ(message.find('\n'), std::string::npos) << c.to;
  }
}

TEST_F(CaptureTest, ErrorsNameFileLineAndCamera) {
  Write(Replaced(kYaml, "t: [0, 0, 2.5]", "t: [0, 0, .nan]"));
  const std::string message = ErrorOf([&] { LoadCapture(folder_); });
  EXPECT_THAT(message, HasSubstr("capture.yaml:19: camera side: 't'"));
}

TEST_F(CaptureTest, RejectsOneCameraAndMissingFiles) {
  EXPECT_THAT(ErrorOf([&] { LoadCapture(folder_); }),
              HasSubstr("no such file"));
  std::filesystem::create_directories(folder_ / "capture.yaml");
  EXPECT_THAT(ErrorOf([&] { LoadCapture(folder_); }), HasSubstr("not a file"));
  std::filesystem::remove(folder_ / "capture.yaml");
  std::string yaml = kYaml;
  yaml.erase(yaml.find("  - id: side"),
             yaml.find("poses:") - yaml.find("  - id: side"));
  Write(Replaced(yaml, ", side: b.png", ""));
  EXPECT_THAT(ErrorOf([&] { LoadCapture(folder_); }),
              HasSubstr("at least two cameras"));
}

TEST_F(CaptureTest, LoadsColourGreyAndSixteenBitPictures) {
  const Capture capture = LoadGood();
  const Camera& camera = capture.cameras[0].camera;
  EXPECT_EQ(LoadPicture(capture, "a.png", camera)(3, 4), cv::Vec3b(10, 20, 30));
  cv::imwrite((folder_ / "grey.png").string(), cv::Mat1b(24, 32, uchar{77}));
  EXPECT_EQ(LoadPicture(capture, "grey.png", camera)(3, 4),
            cv::Vec3b(77, 77, 77));
  cv::imwrite((folder_ / "deep.png").string(),
              cv::Mat(24, 32, CV_16UC3, cv::Scalar(257 * 5, 257 * 6, 65535)));
  EXPECT_EQ(LoadPicture(capture, "deep.png", camera)(3, 4),
            cv::Vec3b(5, 6, 255));
}

TEST_F(CaptureTest, LoadsMasks) {
  const Capture capture = LoadGood();
  const Camera& camera = capture.cameras[0].camera;
  cv::imwrite((folder_ / "mask.png").string(), cv::Mat1b(24, 32, uchar{51}));
  EXPECT_FLOAT_EQ(LoadMask(capture, "mask.png", camera)(3, 4), 0.2f);
  cv::imwrite((folder_ / "deep.png").string(),
              cv::Mat(24, 32, CV_16UC1, cv::Scalar(13107)));
  EXPECT_FLOAT_EQ(LoadMask(capture, "deep.png", camera)(3, 4), 0.2f);
}

TEST_F(CaptureTest, RejectsUnusablePictures) {
  const Capture capture = LoadGood();
  const Camera& camera = capture.cameras[0].camera;
  const auto error = [&](const std::string& name) {
    return ErrorOf([&] { LoadPicture(capture, name, camera); });
  };
  EXPECT_THAT(error("none.png"), HasSubstr("no such file"));
  EXPECT_THAT(error("folder"), HasSubstr("not a file"));
  cv::imwrite((folder_ / "dot.png").string(), cv::Mat3b(1, 1));
  EXPECT_THAT(error("dot.png"), HasSubstr("1 x 1 pixels, the camera 32 x 24"));
  EXPECT_THAT(error("dot.png"), HasSubstr("camera front"));
  WriteBytes("empty.png", {});
  EXPECT_THAT(error("empty.png"), HasSubstr("the file is empty"));
  WriteBytes("text.png", {'h', 'e', 'l', 'l', 'o'});
  EXPECT_THAT(error("text.png"), HasSubstr("cannot be decoded"));

  cv::Mat3b noise(24, 32);
  cv::randu(noise, 0, 255);
  for (const std::string extension : {".jpg", ".png"}) {
    std::vector<unsigned char> bytes;
    cv::imencode(extension, noise, bytes);
    WriteBytes("whole" + extension, bytes);
    EXPECT_NO_THROW(LoadPicture(capture, "whole" + extension, camera));
    for (const std::size_t lost : {std::size_t{2}, bytes.size() / 2}) {
      WriteBytes("cut" + extension, {bytes.begin(), bytes.end() - lost});
      EXPECT_THAT(error("cut" + extension), HasSubstr("truncated"))
          << extension << " without the last " << lost;
    }
  }
}

TEST_F(CaptureTest, CannotSaveIntoAMissingFolder) {
  Capture capture = LoadGood();
  capture.folder = folder_ / "none";
  EXPECT_THAT(ErrorOf([&] { SaveCapture(capture); }),
              HasSubstr("cannot be written"));
}

}  // namespace
}  // namespace sweepfit
