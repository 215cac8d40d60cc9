// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "model/input_error.h"
#include "tests/volume/capsule_person.h"
#include "volume/coverage.h"
#include "volume/floor_cut.h"
#include "volume/floor_level.h"
#include "volume/volume.h"

namespace sweepfit {
namespace {

using testing::Capsule;
using ::testing::HasSubstr;
using testing::MakePerson;
using testing::RenderCapsules;
using testing::RenderRing;

constexpr int kSize = 240;

Volume Hull(const std::vector<View>& views,
            double voxel_size = 0.008,
            StageSummary* summary = nullptr) {
  HullOptions options;
  options.voxel_size = voxel_size;
  return BuildVisualHull(views, options, nullptr, summary);
}

std::string Bytes(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::filesystem::path TempFile(const std::string& name) {
  return std::filesystem::temp_directory_path() /
         (std::to_string(::getpid()) + "_" + name);
}

// A ball wherever it stands.
class BallTest : public ::testing::TestWithParam<Eigen::Vector3d> {};

TEST_P(BallTest, HullHoldsTheBallAndLittleMore) {
  const Eigen::Vector3d center = GetParam();
  const double radius = 0.5;
  const Volume volume =
      Hull(RenderRing({{center, center, radius}}, center, 12, kSize));
  // A hull never cuts into the body, but for rounding to pixels.
  for (int i = 0; i < 200; ++i) {
    const double z = -1 + 2 * (i + 0.5) / 200;
    const double angle = 2.4 * i;
    const double r = std::sqrt(1 - z * z);
    const Eigen::Vector3d direction(
        r * std::cos(angle), z, r * std::sin(angle));
    EXPECT_LT(volume.Sample(center + (radius - 0.008) * direction), 0);
    EXPECT_LT(volume.Sample(center + radius * direction), 0.004);
  }
  const double ball = 4.0 / 3 * std::numbers::pi * std::pow(radius, 3);
  EXPECT_GT(volume.EnclosedVolume(), ball);
  EXPECT_LT(volume.EnclosedVolume(), 1.15 * ball);
  const Eigen::Vector3d middle = 0.5 * (volume.BoxMin() + volume.BoxMax());
  EXPECT_LT((middle - center).norm(), 0.05);
}

INSTANTIATE_TEST_SUITE_P(Places,
                         BallTest,
                         ::testing::Values(Eigen::Vector3d(0, 0, 0),
                                           Eigen::Vector3d(7, -3, 2.5),
                                           Eigen::Vector3d(-40, 12, 100)));

TEST(HullTest, MoreViewsNeverAdd) {
  const auto person = MakePerson(0.8, 0.3, {0, 0, 0});
  const std::vector<View> views =
      RenderRing(person.capsules, {0, 0.85, 0}, 8, kSize);
  const Volume few = Hull({views.begin(), views.begin() + 5});
  const Volume many = Hull(views);
  EXPECT_LT(many.EnclosedVolume(), few.EnclosedVolume());
}

TEST(HullTest, MeshIsClosedOutwardAndOfTheVolumesSize) {
  const auto person = MakePerson(0.8, 0.3, {0.5, 0, -1});
  const Volume volume =
      Hull(RenderRing(person.capsules, {0.5, 0.85, -1}, 8, kSize));
  const TriangleMesh mesh = volume.ExtractMesh();
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_NEAR(EnclosedVolume(mesh) / volume.EnclosedVolume(), 1, 0.01);
  Eigen::Vector3d low = mesh.vertices[0];
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  EXPECT_LT((low - volume.BoxMin()).norm(), 0.01);
  EXPECT_LT((high - volume.BoxMax()).norm(), 0.01);
}

TEST(HullTest, KeepsTheLargestPart) {
  const Capsule body{{0, 0.3, 0}, {0, 1.4, 0}, 0.2};
  const Capsule ball{{0.55, 0.2, 0}, {0.55, 0.2, 0}, 0.1};
  StageSummary summary;
  const Volume volume =
      Hull(RenderRing({body, ball}, {0.1, 0.8, 0}, 12, kSize), 0.008, &summary);
  EXPECT_LT(volume.Sample({0, 0.8, 0}), 0);
  EXPECT_EQ(volume.Sample(ball.a), volume.band_half_width());
  EXPECT_GE(summary.figures["num_components"].get<int>(), 2);
  EXPECT_GT(summary.figures["dropped_volume"].get<double>(), 0.003);
  EXPECT_EQ(summary.status, "weak");
}

// Cameras opposite each other that frame the person closely see a phantom
// between them that is larger than the person, and that no other one looks at.
// Large voxels bring it so near that coarse cells do not tell them apart.
TEST(HullTest, LargeVoxelsFindThePersonAmongPhantoms) {
  const testing::CapsulePerson person = MakePerson(0.8, 0, {0, 0, 0});
  std::vector<View> views;
  for (const Eigen::Vector3d& center : {Eigen::Vector3d(0, 1, 3),
                                        Eigen::Vector3d(3, 1, 0),
                                        Eigen::Vector3d(0, 1, -3),
                                        Eigen::Vector3d(-3, 1, 0.5)}) {
    views.push_back(RenderCapsules(
        testing::LookAt("camera", center, {0, 0.9, 0}, 1.33 * kSize, kSize),
        person.capsules));
  }
  for (const int count : {4, 3}) {
    views.resize(count);
    const Volume volume = Hull(views, 0.02);
    for (const int joint : {kRoot, kHead, kLKnee, kRKnee, kLElbow, kRElbow}) {
      EXPECT_LT(volume.Sample(person.joint[joint]), 0) << count << " " << joint;
    }
    EXPECT_LT((volume.BoxMax() - volume.BoxMin()).maxCoeff(), 2);
  }
}

// Two of three silhouettes meet in a larger place than the person is.
TEST(HullTest, ThreeCamerasFindThePerson) {
  const testing::CapsulePerson person = MakePerson(0.8, 0.2, {0, 0, 0});
  std::vector<View> views;
  for (const Eigen::Vector3d& center : {Eigen::Vector3d(-0.07, 1.9, 3.33),
                                        Eigen::Vector3d(3.08, 0.69, -1.13),
                                        Eigen::Vector3d(-2.99, 0.73, -1.23)}) {
    views.push_back(RenderCapsules(
        testing::LookAt("camera", center, {0, 0.85, 0}, 1.25 * kSize, kSize),
        person.capsules));
  }
  const Volume volume = Hull(views);
  for (const int joint : {kRoot, kHead, kLKnee, kRKnee, kLElbow, kRElbow}) {
    EXPECT_LT(volume.Sample(person.joint[joint]), 0) << joint;
  }
}

TEST(HullTest, CameraAbstainsOutsideItsFrame) {
  const Capsule body{{0, 0.2, 0}, {0, 1.5, 0}, 0.2};
  std::vector<View> views = RenderRing({body}, {0, 0.85, 0}, 8, kSize);
  // One camera near by sees the middle only.
  views.push_back(RenderCapsules(
      testing::LookAt("near", {1.2, 0.85, 0.1}, {0, 0.85, 0}, 400, kSize),
      {body}));
  const Volume volume = Hull(views);
  EXPECT_LT(volume.BoxMin().y(), 0.02);
  EXPECT_GT(volume.BoxMax().y(), 1.68);
}

// Somebody who stands on y = 0, from cameras above at these azimuths (radians).
std::vector<View> FromAbove(const std::vector<double>& azimuths,
                            double height = 1.8,
                            bool on_a_board = false) {
  std::vector<Capsule> person = {{{0, 0.9, 0}, {0, 1.5, 0}, 0.15}};
  for (const double x : {-0.13, 0.13}) {
    person.push_back({{x, 0.1, 0}, {x, 0.9, 0}, 0.07});
    person.push_back({{x, 0.04, -0.05}, {x, 0.04, 0.2}, 0.04});
  }
  if (on_a_board) {
    for (double z = -0.3; z < 0.31; z += 0.02) {
      person.push_back({{-0.4, 0.01, z}, {0.4, 0.01, z}, 0.01});
    }
  }
  std::vector<View> views;
  for (const double azimuth : azimuths) {
    views.push_back(RenderCapsules(
        testing::LookAt("cam" + std::to_string(views.size()),
                        {3 * std::sin(azimuth), height, 3 * std::cos(azimuth)},
                        {0, 0.85, 0},
                        2 * kSize,
                        2 * kSize),
        person));
  }
  return views;
}
const std::vector<double> kAllAround = {
    0, 0.785, 1.57, 2.36, 3.14, 3.93, 4.71, 5.5};

// Seen from above the hull goes on below the feet.
TEST(FloorTest, LiesUnderTheFeetAndNotUnderTheHull) {
  std::vector<View> views = FromAbove(kAllAround);
  const Volume hull = Hull(views);
  EXPECT_LT(hull.BoxMin().y(), -0.005);
  const double pixel = 3.2 / views[0].camera.FocalLength();
  EXPECT_GT(FindFloor(views, hull), -0.5 * pixel);
  // A ray a pixel within the edge enters a round sole well above the floor.
  EXPECT_LT(FindFloor(views, hull), 5 * pixel);
  // The frame cuts the shins: it needs all that it sees.
  for (View& view : views) {
    const int row = static_cast<int>(view.camera.Project({0, 0.25, 0}).y());
    view.signed_distance = view.signed_distance.rowRange(0, row).clone();
    view.camera.height = row;
  }
  EXPECT_LT(FindFloor(views, Hull(views)), 0.3);
}

TEST(FloorTest, CutsADeepWedgeOnly) {
  double depth = -1;
  const std::vector<View> around = FromAbove(kAllAround);
  const Volume whole = CutBelowFloor(around, Hull(around), &depth);
  EXPECT_EQ(depth, 0);
  EXPECT_EQ(whole.BoxMin(), Hull(around).BoxMin());

  // A broad base, seen from one side.
  std::vector<View> one_side = FromAbove({-1, -0.3, 0.3, 1}, 1.4, true);
  const Volume hull = Hull(one_side);
  EXPECT_LT(hull.BoxMin().y(), -0.06);
  const Volume cut = CutBelowFloor(one_side, Hull(one_side), &depth);
  EXPECT_NEAR(depth, cut.BoxMin().y() - hull.BoxMin().y(), 1e-6);
  const double pixel = 3.2 / one_side[0].camera.FocalLength();
  EXPECT_GT(cut.BoxMin().y(), -1.5 * pixel);
  EXPECT_LT(cut.BoxMin().y(), 3 * pixel);
  EXPECT_NEAR(cut.BoxMax().y(), hull.BoxMax().y(), 1e-6);
}

TEST(HullTest, CoherentSilhouettesAreCovered) {
  const auto person = MakePerson(0.8, 0.3, {0, 0, 0});
  std::vector<View> views = RenderRing(person.capsules, {0, 0.85, 0}, 8, kSize);
  const Volume volume = Hull(views);
  for (const double share : SilhouetteCoverage(views, volume)) {
    EXPECT_GT(share, 0.97);
  }
  // One view lost the head and a whole side's limbs: the others notice.
  std::vector<Capsule> rest(person.capsules.begin(),
                            person.capsules.begin() + 4);
  rest.insert(rest.end(), person.capsules.end() - 8, person.capsules.end());
  views[3] = RenderCapsules(views[3].camera, rest);
  StageSummary summary;
  const Volume cut = Hull(views, 0.008, &summary);
  EXPECT_GT(SilhouetteCoverage(views, cut)[3], 0.97);
  EXPECT_LT(SilhouetteCoverage(views, cut)[0], 0.85);
  EXPECT_EQ(summary.status, "weak");
}

TEST(HullTest, SameBytesEveryTime) {
  const auto person = MakePerson(0.8, 0.3, {0, 0, 0});
  const std::vector<View> views =
      RenderRing(person.capsules, {0, 0.85, 0}, 8, kSize);
  const auto first = TempFile("first.vdb");
  const auto second = TempFile("second.vdb");
  Hull(views).SaveVdb(first.string());
  Hull(views).SaveVdb(second.string());
  const std::string bytes = Bytes(first);
  EXPECT_GT(bytes.size(), 10000u);
  EXPECT_TRUE(bytes == Bytes(second));
  // Other content, other identity.
  Hull(views, 0.009).SaveVdb(second.string());
  EXPECT_NE(bytes.substr(21, 36), Bytes(second).substr(21, 36));
  std::filesystem::remove(first);
  std::filesystem::remove(second);
}

TEST(HullTest, WhatCannotBeSavedLeavesNothing) {
  const Capsule body{{0, 0.2, 0}, {0, 1.5, 0}, 0.2};
  const Volume hull = Hull(RenderRing({body}, {0, 0.85, 0}, 4, kSize));
  const auto taken = TempFile("taken.vdb");
  std::filesystem::create_directories(taken / "by_a_folder");
  EXPECT_THROW(hull.SaveVdb(taken.string()), InputError);
  EXPECT_FALSE(std::filesystem::exists(taken.string() + ".part"));
  EXPECT_THROW(hull.SaveVdb("/no/such/folder/hull.vdb"), InputError);
  std::filesystem::remove_all(taken);
}

TEST(HullTest, SaysWhyItCannot) {
  const Capsule body{{0, 0.2, 0}, {0, 1.5, 0}, 0.2};
  const std::vector<View> views = RenderRing({body}, {0, 0.85, 0}, 4, kSize);
  const auto message = [](const std::vector<View>& bad) -> std::string {
    try {
      Hull(bad);
    } catch (const FitError& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_THAT(message({views[0]}), HasSubstr("at least two views"));

  std::vector<View> empty = views;
  empty[2].signed_distance = cv::Mat1f(kSize, kSize, 5.f);
  EXPECT_THAT(message(empty), HasSubstr("camera cam2"));
  EXPECT_THAT(message(empty), HasSubstr("empty"));

  std::vector<View> apart = views;
  apart[1] = RenderCapsules(apart[1].camera,
                            {{{0, 0.85, -0.9}, {0, 0.85, -0.9}, 0.1}});
  EXPECT_THAT(message(apart), HasSubstr("no common part"));

  // Millimetres taken for metres.
  std::vector<View> large = views;
  for (View& view : large) view.camera.world_in_camera *= 1000;
  EXPECT_THAT(message(large), HasSubstr("units"));
}

TEST(HullOptionsTest, ChecksRanges) {
  HullOptions options;
  EXPECT_FALSE(options.Check());
  options.voxel_size = 0;
  EXPECT_THAT(*options.Check(), HasSubstr("voxel_size"));
}

}  // namespace
}  // namespace sweepfit
