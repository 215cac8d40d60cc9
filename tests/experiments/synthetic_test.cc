// SPDX-License-Identifier: Apache-2.0
#include "experiments/synthetic.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "capture/render.h"
#include "experiments/metrics.h"
#include "experiments/synthetic_cameras.h"
#include "experiments/synthetic_person.h"
#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

SyntheticOptions SmallOptions() {
  SyntheticOptions options;
  options.seed = 3;
  options.num_cameras = 4;
  options.width = options.height = 200;
  return options;
}

// Most tests look at one capture with two poses.
class SyntheticCapture : public ::testing::Test {
 protected:
  void SetUp() override {
    if (folder_) return;
    folder_ = std::make_unique<TemporaryFolder>();
    SyntheticOptions options = SmallOptions();
    options.poses = {"A", "N"};
    WriteSyntheticCapture(Folder(), options, nullptr);
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static fs::path Folder() { return folder_->path() / "first"; }
  // For a second capture.
  static fs::path OtherFolder() { return folder_->path() / "second"; }
  static fs::path Truth(const std::string& pose) {
    return Folder() / "truth" / pose;
  }
  static cv::Mat1f TruthMask(const std::string& pose, const std::string& id) {
    cv::Mat1f mask;
    cv::imread((Truth(pose) / "masks" / (id + ".png")).string(),
               cv::IMREAD_GRAYSCALE)
        .convertTo(mask, CV_32F, 1 / 255.0);
    return mask;
  }

 private:
  static inline std::unique_ptr<TemporaryFolder> folder_;
};

std::vector<fs::path> Files(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files.push_back(fs::relative(entry.path(), folder));
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

TEST_F(SyntheticCapture, LoadsWithItsPicturesAndPlates) {
  const Capture capture = LoadCapture(Folder());
  ASSERT_EQ(capture.cameras.size(), 4u);
  EXPECT_TRUE(capture.holdout.empty());
  ASSERT_EQ(capture.poses.size(), 2u);
  for (const CaptureCamera& entry : capture.cameras) {
    const cv::Mat3b plate =
        LoadPicture(capture, entry.background.at(0), entry.camera);
    const cv::Mat3b image = LoadPicture(
        capture, capture.poses[0].images.at(entry.camera.id), entry.camera);
    const cv::Mat1f mask = TruthMask("A", entry.camera.id);
    // Where nobody stands, plate and picture agree but for the noise; where
    // somebody does, they do not.
    double outside = 0, inside = 0;
    int count_outside = 0, count_inside = 0;
    for (int y = 0; y < mask.rows; ++y) {
      for (int x = 0; x < mask.cols; ++x) {
        const double d =
            cv::norm(cv::Vec3d(plate(y, x)) - cv::Vec3d(image(y, x)));
        // The upper half has no shadow of the person.
        if (mask(y, x) == 0 && y < mask.rows / 2) {
          outside += d;
          ++count_outside;
        } else if (mask(y, x) == 1) {
          inside += d;
          ++count_inside;
        }
      }
    }
    ASSERT_GT(count_outside, 0);
    ASSERT_GT(count_inside, 0);
    EXPECT_LT(outside / count_outside, 12) << entry.camera.id;
    EXPECT_GT(inside / count_inside, 30) << entry.camera.id;
  }
}

TEST_F(SyntheticCapture, JointsLieInTheMasks) {
  const Capture capture = LoadCapture(Folder());
  for (const CapturePose& pose : capture.poses) {
    const JointPositions joints =
        LoadTruthJoints(Truth(pose.name) / "joints.json");
    for (const CaptureCamera& entry : capture.cameras) {
      const cv::Mat1f mask = TruthMask(pose.name, entry.camera.id);
      for (int j = 0; j < kNumJoints; ++j) {
        const Eigen::Vector2d pixel = entry.camera.Project(joints[j]);
        const int x = static_cast<int>(std::lround(pixel.x()));
        const int y = static_cast<int>(std::lround(pixel.y()));
        ASSERT_TRUE(x > 0 && y > 0 && x < mask.cols - 1 && y < mask.rows - 1);
        // Joints at the tips may fall into a pixel beside the edge.
        double covered = 0;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            covered = std::max<double>(covered, mask(y + dy, x + dx));
          }
        }
        EXPECT_GT(covered, 0.5)
            << pose.name << " " << entry.camera.id << " " << kJointNames[j];
      }
    }
  }
}

TEST_F(SyntheticCapture, MasksAreTheSilhouettesOfTheMesh) {
  const Capture capture = LoadCapture(Folder());
  const TriangleMesh mesh = LoadPly((Truth("A") / "surface.ply").string());
  for (const CaptureCamera& entry : capture.cameras) {
    const SilhouetteError error = CompareMasks(
        RenderCoverage(entry.camera, mesh), TruthMask("A", entry.camera.id));
    EXPECT_GT(error.iou, 0.985) << entry.camera.id;
    EXPECT_LT(error.boundary_mean, 0.12) << entry.camera.id;
    EXPECT_LT(std::abs(error.signed_mean), 0.03) << entry.camera.id;
  }
}

TEST_F(SyntheticCapture, TruthIsAClosedPersonOnTheFloor) {
  for (const std::string pose : {"A", "N"}) {
    const TriangleMesh mesh = LoadPly((Truth(pose) / "surface.ply").string());
    const MeshTopology topology = CheckTopology(mesh);
    EXPECT_TRUE(topology.IsClosedManifold()) << pose;
    EXPECT_EQ(topology.num_components, 1) << pose;
    EXPECT_GT(EnclosedVolume(mesh), 0.015) << pose;
    double lowest = 1, highest = 0;
    for (const Vector3d& v : mesh.vertices) {
      lowest = std::min(lowest, v.y());
      highest = std::max(highest, v.y());
    }
    EXPECT_NEAR(lowest, 0, 1e-6);
    const double stature =
        LoadTruthJoints(Truth(pose) / "joints.json")[kHeadEnd].y();
    EXPECT_NEAR(highest / stature, 1, 0.02) << pose;
  }
}

TEST_F(SyntheticCapture, SameBytesAgainWithOneThread) {
  const tbb::global_control one_thread(
      tbb::global_control::max_allowed_parallelism, 1);
  SyntheticOptions options = SmallOptions();
  options.poses = {"A", "N"};
  WriteSyntheticCapture(OtherFolder(), options, nullptr);
  const std::vector<fs::path> files = Files(Folder());
  EXPECT_EQ(files, Files(OtherFolder()));
  for (const fs::path& file : files) {
    EXPECT_TRUE(ReadBytes(Folder() / file) == ReadBytes(OtherFolder() / file))
        << file;
  }
}

TEST_F(SyntheticCapture, YawAndShiftMoveTheTruth) {
  SyntheticOptions options = SmallOptions();
  options.num_cameras = 2;
  options.yaw_degrees += 90;
  options.shift_x = 1;
  options.shift_z = -2;
  options.background = false;
  const Capture written =
      WriteSyntheticCapture(OtherFolder(), options, nullptr);
  const JointPositions before = LoadTruthJoints(Truth("A") / "joints.json");
  const JointPositions after =
      LoadTruthJoints(OtherFolder() / "truth" / "A" / "joints.json");
  for (int j = 0; j < kNumJoints; ++j) {
    // A quarter turn about +Y takes +Z to +X.
    const Vector3d expected(
        before[j].z() + 1, before[j].y(), -before[j].x() - 2);
    EXPECT_LT((after[j] - expected).norm(), 1e-9) << kJointNames[j];
  }
  // Given masks instead of plates.
  const Capture capture = LoadCapture(OtherFolder());
  EXPECT_TRUE(capture.cameras[0].background.empty());
  const cv::Mat1f mask = LoadMask(
      capture, capture.poses[0].masks.at("cam00"), capture.cameras[0].camera);
  EXPECT_GT(cv::mean(mask)[0], 0.02);
}

TEST(SyntheticCameras, ProjectionAgreesWithTheCameraModel) {
  const std::vector<Camera> cameras = DrawCameraRing({}, 4);
  ASSERT_EQ(cameras.size(), 16u);
  for (const Camera& camera : cameras) {
    const Vector3d point(0.4, 1.1, -0.3);
    const Projection drawn = ProjectForDrawing(camera, point);
    EXPECT_LT((drawn.pixel - camera.Project(point)).norm(), 1e-9);
    const Vector3d ray = RayForDrawing(camera, drawn.pixel);
    const Vector3d to_point = (point - camera.CenterInWorld()).normalized();
    EXPECT_LT((ray - to_point).norm(), 1e-6);
  }
  EXPECT_GT(cameras[0].CenterInWorld().y(), 1.7);
  EXPECT_LT(cameras[1].CenterInWorld().y(), 0.9);
}

TEST(SyntheticPerson, PeopleDifferButKeepTheirShape) {
  double shortest = 3, tallest = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    const PersonShape shape = DrawPersonShape(seed);
    shortest = std::min(shortest, shape.stature);
    tallest = std::max(tallest, shape.stature);
    const PosedPerson a = PosePerson(shape, "A", seed);
    const PosedPerson t = PosePerson(shape, "T", seed);
    for (int j = 1; j < kNumJoints; ++j) {
      const auto length = [&](const PosedPerson& person) {
        return (person.joint_in_world[j] -
                person.joint_in_world[kJointParents[j]])
            .norm();
      };
      EXPECT_NEAR(length(a), length(t), 1e-9) << seed << kJointNames[j];
    }
    EXPECT_GT(a.joint_in_world[kLWrist].x(), a.joint_in_world[kLElbow].x());
    EXPECT_GT(a.joint_in_world[kLFootEnd].z(), a.joint_in_world[kLAnkle].z());
    EXPECT_NEAR(
        a.joint_in_world[kHeadEnd].y(), shape.stature, 0.02 * shape.stature);
    EXPECT_NEAR(
        a.joint_in_world[kLAnkle].y(), a.joint_in_world[kRAnkle].y(), 1e-9);
  }
  EXPECT_LT(shortest, 1.5);
  EXPECT_GT(tallest, 1.8);
}

TEST(SyntheticOptions, BadOptionsAreInputErrors) {
  const TemporaryFolder folder;
  const auto fails = [&](auto change) {
    SyntheticOptions options = SmallOptions();
    change(&options);
    EXPECT_TRUE(options.Check());
    EXPECT_THROW(WriteSyntheticCapture(folder.path() / "x", options, nullptr),
                 InputError);
    EXPECT_FALSE(fs::exists(folder.path() / "x"));
  };
  fails([](SyntheticOptions* o) { o->num_cameras = 1; });
  fails([](SyntheticOptions* o) { o->width = 0; });
  fails([](SyntheticOptions* o) { o->poses = {"B"}; });
  fails([](SyntheticOptions* o) { o->poses = {"A", "A"}; });
  fails([](SyntheticOptions* o) { o->poses.clear(); });
  fails([](SyntheticOptions* o) { o->noise = -1; });
  fails([](SyntheticOptions* o) {
    o->shift_x = std::numeric_limits<double>::quiet_NaN();
  });
}

}  // namespace
}  // namespace sweepfit
