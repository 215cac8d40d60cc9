// SPDX-License-Identifier: Apache-2.0
#include "experiments/import_to_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "experiments/synthetic.h"
#include "model/input_error.h"
#include "model/mesh.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

// One synthetic person, with its calibration in a world of another size and
// attitude as transforms.json.
class ImportToFolderTest : public ::testing::Test {
 protected:
  static constexpr double kUnit = 0.37;  // metres

  void SetUp() override {
    SyntheticOptions options;
    options.num_cameras = 6;
    options.width = options.height = 240;
    options.background = false;
    truth_ = WriteSyntheticCapture(folder_.path() / "truth", options, nullptr);
    turn_ = Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, 2, -2).normalized())
                .toRotationMatrix();
    nlohmann::json frames = nlohmann::json::array();
    for (const CaptureCamera& entry : truth_.cameras) {
      const Camera& camera = entry.camera;
      const Eigen::Vector3d center =
          turn_ * camera.CenterInWorld() / kUnit + Eigen::Vector3d(5, 6, 7);
      const Eigen::Matrix3d axes = turn_ *
                                   camera.camera_from_world.transpose() *
                                   Eigen::Vector3d(1, -1, -1).asDiagonal();
      nlohmann::json rows = nlohmann::json::array();
      for (int r = 0; r < 3; ++r) {
        rows.push_back({axes(r, 0), axes(r, 1), axes(r, 2), center[r]});
      }
      rows.push_back({0, 0, 0, 1});
      const auto& k = camera.distortion;
      frames.push_back({{"file_path", "images/A/" + camera.id + ".jpg"},
                        {"w", camera.width},
                        {"h", camera.height},
                        {"fl_x", camera.K(0, 0)},
                        {"fl_y", camera.K(1, 1)},
                        {"cx", camera.K(0, 2) + 0.5},
                        {"cy", camera.K(1, 2) + 0.5},
                        {"k1", k[0]},
                        {"k2", k[1]},
                        {"p1", k[2]},
                        {"p2", k[3]},
                        {"k3", k[4]},
                        {"transform_matrix", rows}});
    }
    WriteBytes(folder_.path() / "transforms.json",
               nlohmann::json({{"frames", frames}}).dump());
    options_.format = "nerfstudio";
    options_.source = folder_.path() / "transforms.json";
    options_.images = (folder_.path() / "truth/images/{pose}/{camera}.*");
    options_.masks = (folder_.path() / "truth/masks/{pose}/{camera}.*");
  }
  fs::path out() const { return folder_.path() / "out"; }

  TemporaryFolder folder_;
  Capture truth_;
  Eigen::Matrix3d turn_;
  ImportOptions options_;
};

TEST_F(ImportToFolderTest, MakesACaptureOfAForeignWorld) {
  const Eigen::Vector3d up = turn_.col(1);
  char text[100];
  std::snprintf(
      text, sizeof(text), "%.17g,%.17g,%.17g", up.x(), up.y(), up.z());
  options_.scale = kUnit;
  options_.up = text;
  options_.holdout = {"cam01"};
  const ImportReport report = ImportToFolder(options_, out(), nullptr);
  EXPECT_TRUE(report.notes.empty());
  const Capture capture = LoadCapture(out());
  ASSERT_EQ(capture.cameras.size(), truth_.cameras.size());
  EXPECT_EQ(capture.holdout, std::vector<std::string>{"cam01"});
  ASSERT_EQ(capture.poses.size(), 1u);
  EXPECT_EQ(capture.poses[0].name, "A");
  EXPECT_EQ(capture.poses[0].images.size(), 6u);
  EXPECT_EQ(capture.poses[0].masks.size(), 6u);
  // The same up to a turn about the vertical and a shift: same distances
  // between cameras, same heights above the first, same lenses.
  const Camera& first = capture.cameras[0].camera;
  const Camera& true_first = truth_.cameras[0].camera;
  for (size_t i = 0; i < capture.cameras.size(); ++i) {
    const Camera& camera = capture.cameras[i].camera;
    const Camera& expected = truth_.cameras[i].camera;
    EXPECT_EQ(camera.id, expected.id);
    EXPECT_LT((camera.K - expected.K).norm(), 1e-12);
    const Eigen::Vector3d offset =
        camera.CenterInWorld() - first.CenterInWorld();
    const Eigen::Vector3d expected_offset =
        expected.CenterInWorld() - true_first.CenterInWorld();
    EXPECT_NEAR(offset.norm(), expected_offset.norm(), 1e-9);
    EXPECT_NEAR(offset.y(), expected_offset.y(), 1e-9);
    EXPECT_EQ(ReadBytes(out() / capture.poses[0].images.at(camera.id)),
              ReadBytes(folder_.path() / "truth" /
                        truth_.poses[0].images.at(camera.id)));
  }
  EXPECT_TRUE(fs::exists(out() / "import.json"));
  ImportOptions no_scale = options_;
  no_scale.scale = 0;
  EXPECT_THROW(ImportToFolder(no_scale, folder_.path() / "none", nullptr),
               InputError);
  // An import may replace an earlier one.
  options_.link = true;
  ImportToFolder(options_, out(), nullptr);
  EXPECT_TRUE(fs::is_symlink(out() / "images/A/cam00.jpg") ||
              fs::is_symlink(out() / "images/A/cam00.png"));

  // Scale from the stature, up from the cameras.
  options_.link = false;
  options_.scale = 0;
  options_.up.clear();
  double low = 1e9, high = -1e9;
  const TriangleMesh surface =
      LoadPly((folder_.path() / "truth/truth/A/surface.ply").string());
  for (const Eigen::Vector3d& vertex : surface.vertices) {
    low = std::min(low, vertex.y());
    high = std::max(high, vertex.y());
  }
  options_.stature = high - low;
  const ImportReport measured = ImportToFolder(options_, out(), nullptr);
  // The hull of six views is a few millimetres taller than the person.
  EXPECT_NEAR(measured.metres_per_unit, kUnit, 0.015 * kUnit);
  // The synthetic cameras are rolled by a degree or two each.
  EXPECT_GT(measured.up_in_source.dot(turn_.col(1)), std::cos(0.03));
  EXPECT_FALSE(measured.notes.empty());
}

// Two cameras with tiny pictures, for what goes wrong.
class ImportErrorTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* folder : {"images/A", "masks/A"}) {
      fs::create_directories(truth() / folder);
      for (const char* id : {"/cam02.png", "/cam03.png"}) {
        cv::imwrite((truth() / folder).string() + id, cv::Mat3b(20, 30));
      }
    }
    WriteBytes(folder_.path() / "x_par.txt",
               "2\n"
               "cam02.png 50 0 15 0 50 10 0 0 1 1 0 0 0 1 0 0 0 1 0 0 3\n"
               "cam03.png 50 0 15 0 50 10 0 0 1 0 0 1 0 1 0 -1 0 0 0 0 3\n");
    options_.format = "middlebury";
    options_.source = folder_.path() / "x_par.txt";
    options_.images = truth() / "images/{pose}/{camera}.png";
    options_.masks = truth() / "masks/{pose}/{camera}.png";
  }
  fs::path truth() const { return folder_.path() / "truth"; }
  fs::path out() const { return folder_.path() / "out"; }
  std::string Error(const ImportOptions& options) {
    try {
      ImportToFolder(options, out(), nullptr);
    } catch (const InputError& error) {
      EXPECT_FALSE(fs::exists(out()));
      return error.what();
    }
    return "no error";
  }

  TemporaryFolder folder_;
  ImportOptions options_;
};

TEST_F(ImportErrorTest, RejectsWhatItCannotUse) {
  const auto with = [&](auto change) {
    ImportOptions options = options_;
    options.scale = 1;
    change(&options);
    return Error(options);
  };
  EXPECT_THAT(with([](auto* o) { o->format = "x"; }), HasSubstr("no calibr"));
  EXPECT_THAT(with([](auto* o) { o->scale = -1; }), HasSubstr("--scale"));
  EXPECT_THAT(with([](auto* o) { o->stature = 1.7; }), HasSubstr("exclude"));
  EXPECT_THAT(with([](auto* o) { o->up = "north"; }), HasSubstr("--up"));
  EXPECT_THAT(with([](auto* o) { o->up = "0,0,0"; }), HasSubstr("--up"));
  EXPECT_THAT(with([](auto* o) { o->holdout = {"cam77"}; }),
              HasSubstr("no camera 'cam77'"));
  EXPECT_THAT(with([](auto* o) { o->poses = {"T"}; }),
              HasSubstr("no picture of pose T"));
  EXPECT_THAT(with([](auto* o) { o->chroma_key = "red"; }),
              HasSubstr("--chroma-key"));
  EXPECT_THAT(with([](auto* o) { o->masks = "alpha"; }),
              HasSubstr("has no alpha channel"));
  EXPECT_THAT(with([](auto* o) { o->images = ""; }),
              HasSubstr("say where with --images"));
  EXPECT_THAT(with([&](auto* o) { o->background = truth() / "none/*"; }),
              HasSubstr("none/*: no picture"));
  // A picture of another size.
  const fs::path image = truth() / "images/A/cam03.png";
  cv::imwrite(image.string(), cv::Mat3b(10, 20));
  EXPECT_THAT(
      with([](auto*) {}),
      HasSubstr(
          "truth/masks/A/cam03.png: camera cam03: the picture has 30 x 20"));
  // A mask too few.
  fs::remove(truth() / "masks/A/cam03.png");
  EXPECT_THAT(with([](auto*) {}), HasSubstr("camera cam03: no mask"));
  fs::create_directories(out());
  WriteBytes(out() / "thesis.txt", "x");
  EXPECT_THROW(ImportToFolder(options_, out(), nullptr), InputError);
  EXPECT_TRUE(fs::exists(out() / "thesis.txt"));
}

}  // namespace
}  // namespace sweepfit
