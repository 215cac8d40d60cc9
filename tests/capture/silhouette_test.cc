// SPDX-License-Identifier: Apache-2.0
#include "capture/silhouette.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "model/input_error.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;

constexpr int kSize = 240;

// A figure of a trunk, two legs and an arm with a gap between arm and trunk.
bool IsPerson(double x, double y) {
  const auto capsule =
      [&](double ax, double ay, double bx, double by, double radius) {
        const Eigen::Vector2d a(ax, ay), b(bx, by), p(x, y);
        const double s =
            std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
        return (p - a - s * (b - a)).norm() < radius;
      };
  return capsule(120.3, 50, 120.3, 120, 24.4) ||  // trunk
         capsule(108, 120, 96.6, 205, 11.3) ||    // legs
         capsule(132, 120, 146.2, 205, 11.3) ||
         capsule(140, 50, 172, 92, 7.7) ||  // arm, out and in again
         capsule(172, 92, 146, 122, 6.6);
}

cv::Mat1f DrawCoverage() {
  constexpr int kSamples = 8;
  cv::Mat1f coverage(kSize, kSize);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      int count = 0;
      for (int i = 0; i < kSamples * kSamples; ++i) {
        count += IsPerson(x + (i % kSamples + 0.5) / kSamples - 0.5,
                          y + (i / kSamples + 0.5) / kSamples - 0.5);
      }
      coverage(y, x) = static_cast<float>(count) / (kSamples * kSamples);
    }
  }
  return coverage;
}

const cv::Mat1f& TrueCoverage() {
  static const cv::Mat1f coverage = DrawCoverage();
  return coverage;
}

double Encode(double v) {
  return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
}

struct Scene {
  bool green = false;      // a key screen instead of a tiled room
  unsigned room = 1;       // which room
  double exposure = 1;     // of the picture against the plate, linear light
  double noise = 2;        // grey levels
  double shadow = 0.5;     // loss of light at the darkest place
  double hard_shadow = 0;  // the same between and below the legs, sharp
  double flicker = 0;      // of the light in a strip, per pixel and picture
  bool person = true;
};

constexpr int kTile = 30;  // px

// Brightness of the tiles of a room.
std::vector<double> TileLights(unsigned room) {
  std::mt19937 random(room);
  std::uniform_real_distribution<double> light(0.2, 0.35);
  std::vector<double> lights((kSize / kTile) * (kSize / kTile));
  for (double& value : lights) value = light(random);
  return lights;
}

// Background colour, linear BGR.
cv::Vec3d Background(const Scene& scene,
                     const std::vector<double>& tiles,
                     int x,
                     int y) {
  if (scene.green) return {0.03, 0.20 + 0.0002 * y, 0.02};
  const double light = tiles[(y / kTile) * (kSize / kTile) + x / kTile];
  return {light, light * 0.97, light * 0.9};
}

cv::Vec3d PersonColour(int x, int y) {
  const double shading = 0.8 + 0.2 * std::sin(0.05 * (x + 2 * y));
  if (y < 60) return cv::Vec3d(0.25, 0.35, 0.6) * shading;    // skin
  if (y < 125) return cv::Vec3d(0.03, 0.03, 0.30) * shading;  // red shirt
  return cv::Vec3d(0.12, 0.05, 0.03) * shading;               // dark jeans
}

cv::Mat3b Render(const Scene& scene, unsigned seed) {
  const cv::Mat1f& coverage = TrueCoverage();
  const std::vector<double> tiles = TileLights(scene.room);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, scene.noise);
  std::uniform_real_distribution<double> flicker(-scene.flicker, scene.flicker);
  cv::Mat3b picture(kSize, kSize);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double shadow =
          scene.person
              ? scene.shadow * std::exp(-std::pow((x - 125) / 50.0, 2) -
                                        std::pow((y - 212) / 12.0, 2))
              : 0.0;
      const cv::Vec3d background = Background(scene, tiles, x, y);
      const cv::Vec3d person = PersonColour(x, y);
      const double alpha = scene.person ? coverage(y, x) : 0.0;
      for (int c = 0; c < 3; ++c) {
        double back = background[c] * (1 - shadow);
        if (x >= 180 && x < 225) back *= 1 + flicker(random);
        if (scene.person && std::abs(x - 121) < 35 && y > 160 && y < 225) {
          back *= 1 - scene.hard_shadow;
        }
        double front = person[c];
        if (scene.green && c == 1) front += 0.02;  // spill
        const double light =
            scene.exposure * (alpha * front + (1 - alpha) * back);
        picture(y, x)[c] =
            cv::saturate_cast<uchar>(255 * Encode(light) + noise(random));
      }
    }
  }
  return picture;
}

class SegmentTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    capture_.folder = std::filesystem::path(::testing::TempDir()) /
                      (std::string("sweepfit_segment_") + info->name() + "_" +
                       std::to_string(getpid()));
    std::filesystem::remove_all(capture_.folder);
    std::filesystem::create_directories(capture_.folder);
    capture_.poses.push_back({"A", {}, {}});
  }
  void TearDown() override { std::filesystem::remove_all(capture_.folder); }

  std::string Save(const std::string& name, const cv::Mat& picture) {
    cv::imwrite((capture_.folder / name).string(), picture);
    return name;
  }

  // A camera that shows the scene, with a plate of its own noise.
  void AddCamera(const std::string& id, const Scene& scene) {
    Scene empty = scene;
    empty.person = false;
    empty.exposure = 1;
    const unsigned seed = 2 * static_cast<unsigned>(capture_.cameras.size());
    CaptureCamera entry;
    entry.camera.id = id;
    entry.camera.width = entry.camera.height = kSize;
    entry.camera.K << 300, 0, 119.5, 0, 300, 119.5, 0, 0, 1;
    if (scene.green) entry.chroma_key = "green";
    entry.background = {Save(id + "_plate.png", Render(empty, seed))};
    capture_.cameras.push_back(entry);
    capture_.poses[0].images[id] = Save(id + ".png", Render(scene, seed + 1));
    ids_.push_back(id);
  }

  std::vector<View> Run() {
    return Segment(
        capture_, capture_.poses[0], ids_, options_, nullptr, &summary_);
  }

  Capture capture_;
  std::vector<std::string> ids_;
  SegmentOptions options_;
  StageSummary summary_;
};

struct Score {
  double iou;
  double signed_offset;  // px, positive: too large
};

Score Compare(const cv::Mat1f& coverage) {
  const cv::Mat1f& truth = TrueCoverage();
  double perimeter = 0;
  for (const auto& contour : SubpixelContours(truth)) {
    for (std::size_t i = 0; i < contour.size(); ++i) {
      perimeter += (contour[(i + 1) % contour.size()] - contour[i]).norm();
    }
  }
  const double sum = cv::sum(coverage)[0], true_sum = cv::sum(truth)[0];
  return {cv::sum(cv::min(coverage, truth))[0] /
              cv::sum(cv::max(coverage, truth))[0],
          (sum - true_sum) / perimeter};
}

void ExpectGood(const View& view) {
  const Score score = Compare(view.coverage);
  EXPECT_GT(score.iou, 0.97) << view.camera.id;
  EXPECT_LT(std::abs(score.signed_offset), 0.15) << view.camera.id;
  // The gap between arm and trunk is open.
  EXPECT_LT(view.coverage(93, 152), 0.1) << view.camera.id;
  EXPECT_GT(view.coverage(85, 120), 0.9) << view.camera.id;
  EXPECT_GT(view.signed_distance(93, 152), 2) << view.camera.id;
}

TEST_F(SegmentTest, PlateWithNoiseShadowAndExposure) {
  AddCamera("same", {});
  AddCamera("brighter", {.exposure = 1.1});
  AddCamera("darker", {.exposure = 0.9});
  AddCamera("noisy", {.room = 2, .noise = 5});
  const std::vector<View> views = Run();
  ASSERT_EQ(views.size(), 4u);
  for (std::size_t i = 0; i < views.size(); ++i) {
    EXPECT_EQ(views[i].camera.id, ids_[i]);
    EXPECT_EQ(views[i].mode, "plate");
    ExpectGood(views[i]);
  }
  EXPECT_THAT(summary_.warnings, ::testing::IsEmpty());
  EXPECT_EQ(summary_.status, "ok");
}

TEST_F(SegmentTest, ChromaKeyWithSpillAlone) {
  AddCamera("left", {.green = true});
  AddCamera("right", {.green = true, .exposure = 0.8});
  for (const char* mode : {"chroma", "both"}) {
    options_.mode = mode;
    for (const View& view : Run()) {
      ExpectGood(view);
      EXPECT_EQ(view.key_channel, 1) << mode;
    }
  }
}

// The light of a screen is on the person however the silhouette is found.
TEST_F(SegmentTest, TellsAScreenFromARoom) {
  AddCamera("screen", {.green = true});
  AddCamera("room", {});
  options_.mode = "plate";
  const std::vector<View> views = Run();
  EXPECT_EQ(views[0].key_channel, 1);
  EXPECT_FALSE(views[1].key_channel.has_value());
}

// As under a chair: no soft edge says that it is a shadow, only its colour.
TEST_F(SegmentTest, HardShadowOnAColouredFloor) {
  AddCamera("light", {.green = true, .shadow = 0, .hard_shadow = 0.4});
  AddCamera("dark", {.green = true, .shadow = 0, .hard_shadow = 0.5});
  options_.mode = "plate";
  for (const View& view : Run()) {
    ExpectGood(view);
    EXPECT_LT(view.coverage(190, 121), 0.1) << view.camera.id;
    EXPECT_LT(view.coverage(220, 121), 0.1) << view.camera.id;
  }
}

// Leaves in the wind: one plate takes them for a person, many frames know them.
TEST_F(SegmentTest, ManyFramesLearnWhatFlickers) {
  const Scene scene = {.flicker = 0.6};
  const auto strip_covered = [](const View& view) {
    return cv::mean(view.coverage(cv::Rect(185, 5, 35, kSize - 10)))[0];
  };
  AddCamera("one", scene);
  AddCamera("many", scene);
  Scene empty = scene;
  empty.person = false;
  auto& frames = capture_.cameras[1].background;
  frames.clear();
  for (int i = 0; i < 14; ++i) {
    frames.push_back(Save("frame" + std::to_string(i) + ".png",
                          Render(empty, 100 + static_cast<unsigned>(i))));
  }
  const std::vector<View> views = Run();
  const View& many = views.back();
  ASSERT_EQ(many.camera.id, "many");
  ExpectGood(many);
  EXPECT_LT(strip_covered(many), 0.005);
  // What one plate cannot tell: else the frames would prove nothing.
  EXPECT_TRUE(views.size() == 1 || strip_covered(views.front()) > 0.02);
}

TEST_F(SegmentTest, LeavesOutTheCameraWithAnotherPlate) {
  AddCamera("good", {});
  AddCamera("swapped", {.room = 2});
  AddCamera("fine", {.room = 3});
  capture_.cameras[1].background = capture_.cameras[2].background;
  const std::vector<View> views = Run();
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(views[0].camera.id, "good");
  EXPECT_EQ(views[1].camera.id, "fine");
  ASSERT_EQ(summary_.warnings.size(), 1u);
  EXPECT_THAT(summary_.warnings[0], HasSubstr("camera swapped"));
  EXPECT_THAT(summary_.warnings[0],
              HasSubstr("is it the plate of this camera"));
  EXPECT_EQ(summary_.status, "weak");
}

TEST_F(SegmentTest, NobodyThereIsAFailedFit) {
  AddCamera("a", {.person = false});
  AddCamera("b", {});
  try {
    Run();
    ADD_FAILURE() << "no FitError";
  } catch (const FitError& e) {
    EXPECT_THAT(e.what(), HasSubstr("1 usable silhouette"));
    EXPECT_THAT(e.what(), HasSubstr("camera a"));
  }
  EXPECT_EQ(summary_.status, "failed");
}

TEST_F(SegmentTest, OneCameraAloneIsSegmentedOrLeftOut) {
  AddCamera("empty", {.person = false});
  AddCamera("good", {});
  const CapturePose& pose = capture_.poses[0];
  const std::optional<View> view =
      SegmentOne(capture_, pose, "good", options_, nullptr, &summary_);
  ASSERT_TRUE(view.has_value());
  ExpectGood(*view);
  EXPECT_THAT(summary_.warnings, ::testing::IsEmpty());
  EXPECT_FALSE(
      SegmentOne(capture_, pose, "empty", options_, nullptr, &summary_));
  ASSERT_EQ(summary_.warnings.size(), 1u);
  EXPECT_THAT(summary_.warnings[0], HasSubstr("camera empty is left out"));
}

TEST_F(SegmentTest, GivenMasksArePreferredAndChecked) {
  AddCamera("a", {});
  AddCamera("b", {});
  cv::Mat1b mask;
  TrueCoverage().convertTo(mask, CV_8U, 255);
  capture_.poses[0].masks["a"] = Save("mask.png", mask);
  const std::vector<View> views = Run();
  EXPECT_EQ(views[0].mode, "masks");
  EXPECT_EQ(views[1].mode, "plate");
  EXPECT_GT(Compare(views[0].coverage).iou, 0.995);

  for (const auto& [grey, word] :
       {std::pair{0, "empty"}, std::pair{255, "covers most"}}) {
    Save("mask.png", cv::Mat1b(kSize, kSize, static_cast<uchar>(grey)));
    try {
      Run();
      ADD_FAILURE() << "no InputError";
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), HasSubstr("mask.png: pose A, camera a"));
      EXPECT_THAT(e.what(), HasSubstr(word));
    }
  }
}

TEST_F(SegmentTest, AsksForWhatAModeNeeds) {
  AddCamera("a", {});
  AddCamera("b", {});
  const auto error = [&] {
    try {
      Run();
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string("no InputError");
  };
  options_.mode = "masks";
  EXPECT_THAT(error(), HasSubstr("camera a: segment.mode=masks needs a mask"));
  options_.mode = "chroma";
  EXPECT_THAT(error(), HasSubstr("needs a chroma_key"));
  capture_.cameras[1].background.clear();
  options_.mode = "plate";
  EXPECT_THAT(error(), HasSubstr("camera b: segment.mode=plate needs"));
  options_.mode = "auto";
  EXPECT_THAT(error(), HasSubstr("gives no mask, background or chroma_key"));
  options_.mode = "magic";
  EXPECT_THAT(error(), HasSubstr("segment.mode must be"));
}

TEST_F(SegmentTest, TwoRunsGiveTheSameBytes) {
  AddCamera("a", {});
  AddCamera("b", {.exposure = 1.05});
  const std::vector<View> first = Run();
  const std::vector<View> second = Run();
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(cv::norm(first[i].coverage, second[i].coverage, cv::NORM_INF), 0);
    EXPECT_EQ(
        cv::norm(
            first[i].signed_distance, second[i].signed_distance, cv::NORM_INF),
        0);
  }
}

}  // namespace
}  // namespace sweepfit
