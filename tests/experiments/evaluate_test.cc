// SPDX-License-Identifier: Apache-2.0
#include "experiments/evaluate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "capture/render.h"
#include "experiments/result_folder.h"
#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TriangleMesh Sphere(double radius) {
  constexpr int kRings = 48, kColumns = 96;
  TriangleMesh mesh;
  mesh.vertices.push_back({0, radius, 0});
  for (int ring = 1; ring < kRings; ++ring) {
    const double polar = M_PI * ring / kRings;
    for (int column = 0; column < kColumns; ++column) {
      const double azimuth = 2 * M_PI * column / kColumns;
      mesh.vertices.push_back(
          radius * Eigen::Vector3d(std::sin(polar) * std::sin(azimuth),
                                   std::cos(polar),
                                   std::sin(polar) * std::cos(azimuth)));
    }
  }
  mesh.vertices.push_back({0, -radius, 0});
  const int last = static_cast<int>(mesh.vertices.size()) - 1;
  for (int column = 0; column < kColumns; ++column) {
    const int next = (column + 1) % kColumns;
    mesh.triangles.push_back({0, 1 + column, 1 + next});
    for (int ring = 0; ring + 2 < kRings; ++ring) {
      const int above = 1 + ring * kColumns, below = above + kColumns;
      mesh.triangles.push_back({above + column, below + column, below + next});
      mesh.triangles.push_back({above + column, below + next, above + next});
    }
    const int base = 1 + (kRings - 2) * kColumns;
    mesh.triangles.push_back({last, base + next, base + column});
  }
  return mesh;
}

void SaveCoverage(const fs::path& path,
                  const Camera& camera,
                  const TriangleMesh& mesh) {
  cv::Mat1b mask;
  RenderCoverage(camera, mesh).convertTo(mask, CV_8U, 255);
  ASSERT_TRUE(cv::imwrite(path.string(), mask));
}

// A "person" that is a sphere of 0.50 m, fitted by one of 0.51 m; all joints of
// the fit are 10 mm too far left.
class EvaluateTest : public testing::Test {
 protected:
  EvaluateTest() {
    const TriangleMesh truth = Sphere(0.50);
    const TriangleMesh fit = Sphere(0.51);
    capture_.folder = scratch_.path() / "ball";
    result_ = scratch_.path() / "result";
    truth_ = capture_.folder / "truth" / "A";
    fs::create_directories(truth_ / "masks");
    fs::create_directories(result_ / "masks");
    capture_.holdout = {"c1"};
    CapturePose pose;
    pose.name = "A";
    for (int i = 0; i < 3; ++i) {
      CaptureCamera camera;
      camera.camera = LookAtMesh(truth, 50 * i, 10, 160, 160);
      camera.camera.id = "c" + std::to_string(i);
      SaveCoverage(
          truth_ / "masks" / (camera.camera.id + ".png"), camera.camera, truth);
      SaveCoverage(result_ / "masks" / ("A_" + camera.camera.id + ".png"),
                   camera.camera,
                   fit);
      capture_.cameras.push_back(camera);
    }
    capture_.poses = {pose};
    SavePly(truth, (truth_ / "surface.ply").string());
    SavePly(fit, (result_ / "mesh_A.ply").string());
    Json true_joints, fit_joints;
    for (int joint = 0; joint < kNumJoints; ++joint) {
      const std::string name(kJointNames[joint]);
      true_joints[name] = {0.1 * joint, 1.0, 0.01 * joint * joint};
      fit_joints[name] = {0.1 * joint + 0.01, 1.0, 0.01 * joint * joint};
    }
    WriteBytes(truth_ / "joints.json",
               Json({{"unit", "m"}, {"joints", true_joints}}).dump());
    Json joints;
    joints["unit"] = "m";
    joints["poses"]["A"] = fit_joints;
    WriteBytes(result_ / "joints.json", joints.dump());
    WriteReport({"c0", "c2"});
  }

  void WriteReport(const std::vector<std::string>& cameras) {
    Json report;
    report["cameras"] = cameras;
    WriteBytes(result_ / kReportFile, report.dump());
  }

  Evaluation Evaluate(bool truth) {
    EvaluateOptions options;
    options.truth = truth;
    options.surface_samples = 3000;
    return EvaluateResult(capture_, result_, options, nullptr);
  }

  std::string Error(bool truth) {
    try {
      Evaluate(truth);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }

  TemporaryFolder scratch_;
  Capture capture_;
  fs::path result_;
  fs::path truth_;
};

TEST_F(EvaluateTest, MeasuresWhatIsKnown) {
  const Evaluation evaluation = Evaluate(true);
  EXPECT_EQ(evaluation.capture, "ball");
  EXPECT_FALSE(evaluation.holdout_void);
  ASSERT_EQ(evaluation.poses.size(), 1u);
  const PoseScore& score = evaluation.poses[0];
  ASSERT_TRUE(score.joints && score.fit_to_truth && score.truth_to_fit);
  EXPECT_NEAR(score.joints->mpjpe, 0.010, 1e-9);
  EXPECT_NEAR(score.joints->pa_mpjpe, 0, 1e-9);
  EXPECT_NEAR(score.fit_to_truth->mean, 0.010, 0.0005);
  EXPECT_NEAR(score.fit_to_truth->signed_mean, 0.010, 0.0005);
  EXPECT_NEAR(score.truth_to_fit->signed_mean, -0.010, 0.0005);
  // Discs with radii in the ratio 0.50 : 0.51.
  for (const char* group : {"fit", "holdout"}) {
    const auto mean = MeanSilhouetteError(score, group);
    ASSERT_TRUE(mean);
    EXPECT_NEAR(mean->iou, std::pow(0.50 / 0.51, 2), 0.005);
    EXPECT_GT(mean->signed_mean, 0.5);
  }
  ASSERT_EQ(score.cameras.size(), 3u);
  EXPECT_EQ(score.cameras[0].group, "fit");
  EXPECT_EQ(score.cameras[1].group, "holdout");
  EXPECT_EQ(score.cameras[1].reference, "truth");
}

TEST_F(EvaluateTest, ComparesLandmarksWithTheJointsTheySpeakOf) {
  Json wrist;
  wrist["name"] = "l_wrist";
  wrist["joint"] = "l_wrist";
  const int joint = kLWrist;
  wrist["point"] = {0.1 * joint + 0.01, 1.0, 0.01 * joint * joint - 0.02};
  wrist["covariance"] = {1e-4, 0, 0, 0, 1e-4, 0, 0, 0, 4e-4};
  wrist["views"] = 5;
  wrist["source"] = "contour";
  Json crotch = wrist;
  crotch["name"] = "crotch";
  crotch["joint"] = nullptr;
  Json json;
  json["poses"]["A"]["landmarks"] = {wrist, crotch};
  WriteBytes(result_ / "landmarks.json", json.dump());
  const Evaluation evaluation = Evaluate(true);
  const auto& landmarks = evaluation.poses[0].landmarks;
  ASSERT_EQ(landmarks.size(), 1u);
  EXPECT_NEAR(landmarks[0].error_in_world.norm(), std::sqrt(5e-4), 1e-9);
  EXPECT_NEAR(landmarks[0].chi2_per_dof, 2.0 / 3, 1e-9);
  EXPECT_THAT(EvaluationTable(evaluation), HasSubstr("chi2/dof 0.67"));
  EXPECT_EQ(EvaluationToJson(evaluation)["poses"]["A"]["landmarks"].size(), 1u);
  EXPECT_TRUE(Evaluate(false).poses[0].landmarks.empty());

  wrist["covariance"] = {0, 0, 0, 0, 0, 0, 0, 0, 0};
  json["poses"]["A"]["landmarks"] = {wrist};
  WriteBytes(result_ / "landmarks.json", json.dump());
  EXPECT_THAT(Error(true), HasSubstr("not positive definite"));
  WriteBytes(result_ / "landmarks.json", "{}");
  EXPECT_THAT(Error(true), HasSubstr("landmarks.json"));
}

TEST_F(EvaluateTest, FallsBackToTheResultsOwnMasks) {
  fs::remove_all(truth_ / "masks");
  const PoseScore score = Evaluate(false).poses[0];
  EXPECT_FALSE(score.joints.has_value());
  ASSERT_EQ(score.cameras.size(), 3u);
  for (const CameraScore& camera : score.cameras) {
    EXPECT_EQ(camera.reference, "result");
    EXPECT_GT(camera.error.iou, 0.998);
  }
  // A camera without any silhouette or picture is left out.
  fs::remove(result_ / "masks" / "A_c1.png");
  EXPECT_EQ(Evaluate(false).poses[0].cameras.size(), 2u);
}

// Remembers what was warned of.
class Warnings : public Progress {
 public:
  void Stage(const std::string&, const std::string&) override {}
  void Warning(const std::string& text) override { said.push_back(text); }
  std::vector<std::string> said;
};

// A camera that the fit did not use, in a capture without true masks.
TEST_F(EvaluateTest, SegmentsCamerasThatTheFitDidNotUse) {
  fs::remove_all(truth_ / "masks");
  fs::remove(result_ / "masks" / "A_c1.png");
  CaptureCamera& entry = capture_.cameras[1];
  entry.camera.K.topLeftCorner<2, 2>() *= 0.5;  // a ball that fills no picture
  cv::Mat3b picture(160, 160, cv::Vec3b(200, 200, 200));
  ASSERT_TRUE(cv::imwrite((capture_.folder / "plate.png").string(), picture));
  entry.background = {"plate.png"};
  picture.setTo(cv::Vec3b(40, 60, 160),
                RenderCoverage(entry.camera, Sphere(0.50)) > 0.5);
  ASSERT_TRUE(cv::imwrite((capture_.folder / "seen.png").string(), picture));
  capture_.poses[0].images["c1"] = "seen.png";
  Warnings warnings;
  const auto evaluate = [&] {
    return EvaluateResult(capture_, result_, {}, &warnings).poses[0].cameras;
  };
  std::vector<CameraScore> cameras = evaluate();
  ASSERT_EQ(cameras.size(), 3u);
  EXPECT_EQ(cameras[1].reference, "segmented");
  EXPECT_NEAR(cameras[1].error.iou, std::pow(0.50 / 0.51, 2), 0.02);
  EXPECT_THAT(warnings.said, IsEmpty());

  // Nobody is seen: the camera is no measure of the fit.
  capture_.poses[0].images["c1"] = "plate.png";
  cameras = evaluate();
  ASSERT_EQ(cameras.size(), 2u);
  ASSERT_EQ(warnings.said.size(), 1u);
  EXPECT_THAT(warnings.said[0], HasSubstr("camera c1 is left out"));
}

TEST_F(EvaluateTest, SaysWhenHoldoutCamerasWereUsed) {
  WriteReport({"c0", "c1"});
  const Evaluation evaluation = Evaluate(false);
  EXPECT_TRUE(evaluation.holdout_void);
  EXPECT_THAT(EvaluationTable(evaluation), HasSubstr("void"));
  EXPECT_TRUE(EvaluationToJson(evaluation)["holdout_scores_void"]);
}

// Only the capture's list is held out: what else a fit did without differs from
// fit to fit.
TEST_F(EvaluateTest, TellsUnusedCamerasFromHoldout) {
  WriteReport({"c0"});
  const Evaluation evaluation = Evaluate(false);
  EXPECT_EQ(evaluation.poses[0].cameras[1].group, "holdout");
  EXPECT_EQ(evaluation.poses[0].cameras[2].group, "unused");
  EXPECT_THAT(EvaluationTable(evaluation), HasSubstr("unused cameras"));
  const Json pose = EvaluationToJson(evaluation)["poses"]["A"];
  EXPECT_EQ(pose["silhouette"].size(), 3u);
  EXPECT_TRUE(pose["silhouette"].contains("unused"));
}

TEST_F(EvaluateTest, WritesTableAndJson) {
  const Evaluation evaluation = Evaluate(true);
  const std::string table = EvaluationTable(evaluation);
  EXPECT_THAT(table, HasSubstr("MPJPE 10.0"));
  EXPECT_THAT(table, HasSubstr("holdout cameras"));
  const Json json = EvaluationToJson(evaluation);
  EXPECT_NEAR(json["poses"]["A"]["joints"]["mpjpe"].get<double>(), 0.01, 1e-9);
  EXPECT_EQ(json["poses"]["A"]["cameras"]["c1"]["group"], "holdout");
}

TEST_F(EvaluateTest, BadInputIsNamed) {
  // Points of a scanner are no surface.
  SavePly({Sphere(0.50).vertices, {}}, (truth_ / "surface.ply").string());
  EXPECT_THAT(Error(true), HasSubstr("surface.ply: has no faces"));
  fs::remove_all(truth_);
  EXPECT_THAT(Error(true), HasSubstr("no ground truth"));
  WriteBytes(result_ / "joints.json", "{");
  WriteReport({});
  EXPECT_EQ(Error(false), "no error");  // joints are not needed without truth
  fs::remove(result_ / "mesh_A.ply");
  EXPECT_THAT(Error(false), HasSubstr("mesh_<pose>.ply"));
  WriteBytes(result_ / kReportFile, "[");
  EXPECT_THAT(Error(false), HasSubstr(kReportFile));
  fs::remove(result_ / kReportFile);
  EXPECT_THAT(Error(false), HasSubstr("no result folder"));
}

}  // namespace
}  // namespace sweepfit
