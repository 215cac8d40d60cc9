// SPDX-License-Identifier: Apache-2.0
#include "volume/coherence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

#include "tests/volume/capsule_person.h"

namespace sweepfit {
namespace {

using testing::MakePerson;
using testing::RenderRing;
using Kind = Incoherence::Kind;

constexpr double kDegree = std::numbers::pi / 180;

// Two poses of one person before eight cameras.
std::vector<std::vector<View>> TwoPoses() {
  const Eigen::Vector3d target(0, 0.9, 0);
  return {
      RenderRing(MakePerson(0.7, 0.3, {0.1, 0, 0}).capsules, target, 8, 240),
      RenderRing(MakePerson(1.4, 0.2, {0, 0, 0.1}).capsules, target, 8, 240)};
}

void Turn(const std::string& id,
          const Eigen::Vector3d& axis,
          double angle,
          std::vector<std::vector<View>>* poses) {
  const Eigen::Matrix3d rotation =
      Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  for (auto& views : *poses) {
    for (View& view : views) {
      if (view.camera.id != id) continue;
      view.camera.camera_from_world = rotation * view.camera.camera_from_world;
      view.camera.world_in_camera = rotation * view.camera.world_in_camera;
    }
  }
}

// Removes the left half of the person from a silhouette, or adds a disc.
void Spoil(bool add, View* view) {
  const cv::Mat1f whole = view->signed_distance;
  cv::Mat1f spoilt = whole.clone();
  for (int v = 0; v < whole.rows; ++v) {
    for (int u = 0; u < whole.cols; ++u) {
      if (add) {
        const double disc = std::hypot(u - 45, v - 60) - 22;
        spoilt(v, u) = std::min(whole(v, u), static_cast<float>(disc));
      } else {
        spoilt(v, u) = std::max(whole(v, u), static_cast<float>(120 - u));
      }
    }
  }
  view->signed_distance = spoilt;
}

std::vector<Incoherence> Find(const std::vector<std::vector<View>>& poses,
                              bool thorough) {
  IncoherenceOptions options;
  options.thorough = thorough;
  return FindIncoherence(poses, options);
}

TEST(Coherence, IsSilentAboutSoundCameras) {
  const auto poses = TwoPoses();
  for (const bool thorough : {false, true}) {
    EXPECT_TRUE(Find(poses, thorough).empty());
  }
  const auto cameras = MeasureCoherence(poses);
  ASSERT_EQ(cameras.size(), 8u);
  for (const CameraCoherence& camera : cameras) {
    EXPECT_LT(camera.miss, 0.1) << camera.camera_id;
    EXPECT_LE(camera.others_without, camera.others_with);
  }
}

TEST(Coherence, NamesTheCameraThatIsTurnedByThreeTenthsOfADegree) {
  // With a focal length of 312 pixels that is 1.6 pixels sideways.
  auto poses = TwoPoses();
  Turn("cam3", Eigen::Vector3d::UnitY(), 0.3 * kDegree, &poses);
  const auto found = Find(poses, true);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, Kind::kTurned);
  EXPECT_EQ(found[0].camera.camera_id, "cam3");
  EXPECT_NEAR(found[0].camera.turn.y(), -0.3 * kDegree, 0.05 * kDegree);
  EXPECT_NEAR(found[0].camera.shift, 1.65, 0.3);
  EXPECT_THAT(found[0].Text(), ::testing::HasSubstr("camera cam3 is turned"));
}

TEST(Coherence, TurnsTheCameraBack) {
  auto poses = TwoPoses();
  const Camera sound = poses[0][5].camera;
  Turn("cam5", Eigen::Vector3d(1, -1, 0.5).normalized(), 2 * kDegree, &poses);
  const auto found = Find(poses, false);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, Kind::kTurned);
  RepairIncoherence(found, &poses);
  for (const auto& views : poses) {
    EXPECT_LT((views[5].camera.camera_from_world - sound.camera_from_world)
                  .cwiseAbs()
                  .maxCoeff(),
              0.1 * kDegree);
    EXPECT_LT((views[5].camera.CenterInWorld() - sound.CenterInWorld()).norm(),
              1e-12);
  }
}

TEST(Coherence, NamesTwoTurnedCameras) {
  auto poses = TwoPoses();
  Turn("cam1", Eigen::Vector3d::UnitX(), kDegree, &poses);
  Turn("cam4", Eigen::Vector3d::UnitY(), -kDegree, &poses);
  const auto found = Find(poses, false);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].kind, Kind::kTurned);
  EXPECT_EQ(found[1].kind, Kind::kTurned);
  EXPECT_THAT(
      (std::vector{found[0].camera.camera_id, found[1].camera.camera_id}),
      ::testing::UnorderedElementsAre("cam1", "cam4"));
}

TEST(Coherence, LeavesOutASilhouetteThatHidesHalfOfThePerson) {
  auto poses = TwoPoses();
  Spoil(false, &poses[1][2]);
  const auto found = Find(poses, false);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, Kind::kHides);
  EXPECT_EQ(found[0].camera.camera_id, "cam2");
  EXPECT_EQ(found[0].pose, 1);
  EXPECT_EQ(RepairIncoherence(found, &poses), std::vector<bool>{true});
  EXPECT_EQ(poses[0].size(), 8u);
  ASSERT_EQ(poses[1].size(), 7u);
  EXPECT_EQ(poses[1][2].camera.id, "cam3");
}

TEST(Coherence, SaysWhatItCouldNotLeaveOut) {
  Incoherence hides;
  hides.kind = Kind::kHides;
  hides.camera.camera_id = "cam2";
  hides.pose = 0;
  auto poses = TwoPoses();
  poses[0].resize(4);
  for (const bool expected : {true, false}) {  // the fourth view, the third
    const auto repaired = RepairIncoherence({hides}, &poses);
    ASSERT_EQ(repaired, std::vector<bool>{expected});
    EXPECT_EQ(poses[0].size(), 3u);
    const std::string text = hides.RepairText(repaired[0]);
    EXPECT_EQ(text.find("left out") != std::string::npos, expected) << text;
    hides.camera.camera_id = "cam3";
  }
}

// One camera that is wrong in both poses is one camera.
TEST(Coherence, LooksForAThirdOfTheCameras) {
  auto poses = TwoPoses();
  Spoil(false, &poses[0][2]);
  Spoil(false, &poses[1][2]);
  Turn("cam5", Eigen::Vector3d::UnitY(), kDegree, &poses);
  const auto found = Find(poses, false);
  ASSERT_EQ(found.size(), 3u);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(found[i].kind, Kind::kHides);
    EXPECT_EQ(found[i].camera.camera_id, "cam2");
    EXPECT_EQ(found[i].pose, i);
  }
  EXPECT_EQ(found[2].kind, Kind::kTurned);
  EXPECT_EQ(found[2].camera.camera_id, "cam5");
}

TEST(Coherence, TellsOfPartsThatNobodyElseSees) {
  auto poses = TwoPoses();
  Spoil(true, &poses[0][6]);
  const auto found = Find(poses, false);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, Kind::kShows);
  EXPECT_EQ(found[0].camera.camera_id, "cam6");
  EXPECT_EQ(found[0].pose, 0);
  auto kept = poses;
  RepairIncoherence(found, &kept);
  EXPECT_EQ(kept[0].size(), 8u);
}

TEST(Coherence, LeavesOutACameraThatLooksElsewhere) {
  auto poses = TwoPoses();
  // Pictures of another camera: no small turn explains them.
  for (auto& views : poses) views[2].signed_distance = views[3].signed_distance;
  const auto found = Find(poses, false);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].kind, Kind::kMoved);
  EXPECT_EQ(found[0].camera.camera_id, "cam2");
  RepairIncoherence(found, &poses);
  EXPECT_EQ(poses[0].size(), 7u);
}

TEST(Coherence, SaysNothingOfTwoViews) {
  auto poses = TwoPoses();
  for (auto& views : poses) views.resize(2);
  EXPECT_TRUE(Find(poses, true).empty());
  for (const CameraCoherence& camera : MeasureCoherence(poses)) {
    EXPECT_EQ(camera.miss, 0);
  }
}

TEST(Coherence, ChecksItsOptions) {
  IncoherenceOptions options;
  EXPECT_FALSE(options.Check());
  options.mode = "ignore";
  EXPECT_THAT(*options.Check(), ::testing::HasSubstr("coherence.mode"));
}

}  // namespace
}  // namespace sweepfit
