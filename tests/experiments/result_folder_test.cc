// SPDX-License-Identifier: Apache-2.0
#include "experiments/result_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <opencv2/imgcodecs.hpp>

#include "capture/render.h"
#include "experiments/report_html.h"
#include "model/body_io.h"
#include "model/template.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;
using ::testing::Not;

// A result whose silhouettes are those of the fitted body itself.
FitResult MakeResult() {
  static const Body body = BuildTemplate({});
  FitResult result;
  result.body = body;
  PoseResult& pose = result.poses.emplace_back();
  pose.name = "A";
  pose.pose.root_in_world = {0.3, 0.9, -0.2};
  pose.frames = ForwardKinematics(result.body.skeleton, pose.pose);
  pose.vertices_in_world = PoseVertices(result.body, pose.pose);
  pose.joints.pose = pose.pose;
  pose.joints.frames = pose.frames;
  pose.joints.covariance.fill(1e-4 * Eigen::Matrix3d::Identity());
  pose.joints.reliability.fill(0.75);
  pose.joints.evidence.fill({{"landmark", 0.9}, {"pose", 0.1}});
  Landmark3 crown;
  crown.name = "head_end";
  crown.joint = kHeadEnd;
  crown.point_in_world = {1, 2, 3};
  crown.covariance = Eigen::Matrix3d::Identity();
  crown.num_views = 2;
  crown.source = "volume";
  const auto seen = std::make_shared<Observation>();
  pose.seen = seen;
  seen->pose = pose.name;
  seen->landmarks.landmarks = {crown};
  seen->landmarks.facing_in_world = {0, 0, 1};
  seen->landmarks.unsafe_limbs = {"l_arm"};
  const TriangleMesh mesh = PosedMesh(result.body, pose.vertices_in_world);
  for (const double azimuth : {0.0, 90.0}) {
    View view;
    view.camera = LookAtMesh(mesh, azimuth, 10, 200, 240);
    view.camera.id = azimuth == 0 ? "front" : "side";
    view.image = RenderShaded(view.camera, mesh, {});
    view.coverage = RenderCoverage(view.camera, mesh);
    view.signed_distance = SignedDistance(view.camera, view.coverage);
    view.mode = "masks";
    seen->views.push_back(view);
    result.camera_ids.push_back(view.camera.id);
  }
  seen->volume = VolumeFromMesh(mesh, 0.02);
  StageSummary stage;
  stage.stage = "local";
  stage.status = "weak";
  stage.warnings = {"radius < 1 mm & worse"};
  stage.seconds = 1.5;
  result.stages = {stage};
  return result;
}

Capture MakeCapture() {
  Capture capture;
  capture.folder = "captures/anna";
  capture.holdout = {"side"};
  return capture;
}

std::map<std::string, std::string> AllFiles(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    files[fs::relative(entry.path(), folder).string()] =
        ReadBytes(entry.path());
  }
  return files;
}

TEST(ResultFolder, HoldsEveryFileOfACompleteFit) {
  TemporaryFolder scratch;
  FitResult result = MakeResult();
  result.texture = Texture{cv::Mat3b(64, 64, cv::Vec3b(40, 80, 120)),
                           cv::Mat1f(64, 64, 1.0f)};
  result.skin = FitSkinWeights(result.body, 4, 1);
  const FitConfig config;
  const Capture capture = MakeCapture();
  const Json report =
      WriteResult({capture, config, result, 2.0}, scratch.path(), nullptr);

  const auto files = AllFiles(scratch.path());
  for (const char* name : {"model.glb",
                           "body.json",
                           "mesh_A.ply",
                           "joints.json",
                           "poses.bvh",
                           "volume_A.vdb",
                           "volume_A.ply",
                           "masks/A_front.png",
                           "masks/A_side.png",
                           "landmarks.json",
                           "texture.png",
                           "overlays/A_front.png",
                           "overlays/A_side.png",
                           "silhouettes.png",
                           "renders/A_front.png",
                           "renders/A_back_textured.png",
                           "report.json",
                           "report.html",
                           "fit.yaml"}) {
    ASSERT_TRUE(files.contains(name)) << name;
    EXPECT_FALSE(files.at(name).empty()) << name;
  }
  EXPECT_EQ(files.at("model.glb").substr(0, 4), "glTF");
  EXPECT_EQ(Json::parse(files.at("report.json")), report);
  EXPECT_EQ(LoadBody((scratch.path() / "body.json").string()).num_vertices(),
            result.body.num_vertices());

  // The mesh was the source of its own silhouettes.
  const Json& scores = report["poses"]["A"]["silhouette"]["cameras"];
  EXPECT_GT(scores["front"]["iou"].get<double>(), 0.999);
  EXPECT_GT(scores["side"]["iou"].get<double>(), 0.999);
  EXPECT_EQ(report["capture"], "anna");
  EXPECT_EQ(report["cameras"], Json({"front", "side"}));
  EXPECT_EQ(report["holdout_used"], Json({"side"}));
  EXPECT_TRUE(report["holdout_scores_void"]);
  EXPECT_EQ(report["times"]["stages"][0]["seconds"], 1.5);
  EXPECT_FALSE(report["stages"][0].contains("seconds"));

  FitConfig again;
  LoadFitConfig((scratch.path() / "fit.yaml").string(), &again);
  EXPECT_EQ(FitConfigToYaml(again), FitConfigToYaml(config));

  const std::string& page = files.at("report.html");
  EXPECT_THAT(page, HasSubstr("not safe: <b>l_arm</b>"));
  EXPECT_THAT(page, HasSubstr("radius &lt; 1 mm &amp; worse"));
  EXPECT_THAT(page, HasSubstr("are void"));
  // Every picture that the page shows is there, by a relative path.
  size_t at = 0, pictures = 0;
  while ((at = page.find("src=\"", at)) != std::string::npos) {
    at += 5;
    const std::string path = page.substr(at, page.find('"', at) - at);
    EXPECT_TRUE(files.contains(path)) << path;
    ++pictures;
  }
  EXPECT_GE(pictures, 8u);
}

TEST(ResultFolder, MasksAndJointsAreWhatWasFound) {
  TemporaryFolder scratch;
  const FitResult result = MakeResult();
  const Capture capture = MakeCapture();
  const FitConfig config;
  WriteResult({capture, config, result, 0}, scratch.path(), nullptr);

  const cv::Mat1b mask = cv::imread(
      (scratch.path() / "masks/A_front.png").string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(mask.size(), result.poses[0].seen->views[0].coverage.size());
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      ASSERT_NEAR(mask(y, x) / 255.0,
                  result.poses[0].seen->views[0].coverage(y, x),
                  0.5 / 255 + 1e-6);
    }
  }
  const Json joints = Json::parse(ReadBytes(scratch.path() / "joints.json"));
  EXPECT_EQ(joints["unit"], "m");
  EXPECT_EQ(joints["poses"]["A"].size(), static_cast<size_t>(kNumJoints));
  EXPECT_EQ(joints["poses"]["A"]["root"], Json({0.3, 0.9, -0.2}));
  EXPECT_NEAR(
      joints["detail"]["A"]["l_wrist"]["sigma"].get<double>(), 0.01, 1e-12);
  EXPECT_EQ(joints["detail"]["A"]["l_wrist"]["reliability"], 0.75);
  EXPECT_EQ(joints["detail"]["A"]["l_wrist"]["evidence"]["landmark"], 0.9);
  const Json landmarks =
      Json::parse(ReadBytes(scratch.path() / "landmarks.json"));
  EXPECT_EQ(landmarks["poses"]["A"]["landmarks"][0]["joint"], "head_end");
  EXPECT_EQ(landmarks["poses"]["A"]["landmarks"][0]["point"],
            Json({1., 2., 3.}));
}

TEST(ResultFolder, StopsWhereTheFitStopped) {
  TemporaryFolder scratch;
  const FitResult result = MakeResult();
  const Capture capture = MakeCapture();
  FitConfig config;
  config.options.until = "volume";
  WriteResult({capture, config, result, 0}, scratch.path(), nullptr);
  EXPECT_TRUE(fs::exists(scratch.path() / "volume_A.vdb"));
  EXPECT_TRUE(fs::exists(scratch.path() / "masks/A_front.png"));
  EXPECT_TRUE(fs::exists(scratch.path() / "report.html"));
  for (const char* name : {"landmarks.json",
                           "joints.json",
                           "poses.bvh",
                           "mesh_A.ply",
                           "body.json",
                           "model.glb",
                           "texture.png"}) {
    EXPECT_FALSE(fs::exists(scratch.path() / name)) << name;
  }
}

TEST(ResultFolder, SameResultSameBytesButTimes) {
  TemporaryFolder scratch;
  const Capture capture = MakeCapture();
  const FitConfig config;
  std::vector<std::map<std::string, std::string>> runs;
  for (const double seconds : {1.0, 2.0}) {
    const FitResult result = MakeResult();
    const fs::path folder = scratch.path() / std::to_string(seconds);
    fs::create_directory(folder);
    WriteResult({capture, config, result, seconds}, folder, nullptr);
    runs.push_back(AllFiles(folder));
    Json report = Json::parse(runs.back()["report.json"]);
    EXPECT_EQ(report["times"]["fit"], seconds);
    report.erase("times");
    runs.back()["report.json"] = report.dump();
    runs.back().erase("report.html");
  }
  ASSERT_EQ(runs[0].size(), runs[1].size());
  for (const auto& [name, bytes] : runs[0]) {
    EXPECT_TRUE(runs[1][name] == bytes) << name;
  }
}

TEST(ReportHtml, SaysByWhatSectionsAreKnown) {
  Json report = {{"capture", "c"},
                 {"version", "v"},
                 {"cameras", {"a"}},
                 {"options", {{"until", "refine"}}},
                 {"holdout_scores_void", false},
                 {"poses", Json::object()},
                 {"times", {{"stages", {{{"seconds", 1}}}}, {"total", 1}}}};
  const Json arm = {{"u", {0.5, 1.25}},
                    {"radius", {0.05, 0.04}},
                    {"sigma", {0.0004, 0.0002}},
                    {"silhouette", {0.25, 0.5}},
                    {"photo", {0.75, 0.5}}};
  report["stages"] = {{{"stage", "local"},
                       {"status", "ok"},
                       {"warnings", Json::array()},
                       {"figures", {{"sections", {{"l_arm", arm}}}}}}};
  const std::string html = ReportHtml(report, Json::object(), {});
  EXPECT_THAT(html,
              HasSubstr("u 1.25: radius 40.0 mm, sigma 0.20 mm, silhouette 50 "
                        "%, photo 50 %"));
  EXPECT_THAT(html, HasSubstr("<figcaption>l_arm</figcaption>"));
  // Three quarters of a bar of 60.
  EXPECT_THAT(html, HasSubstr("height=\"45.0\""));
}

TEST(ReportHtml, EscapesWhatCouldBeMarkup) {
  EXPECT_EQ(EscapeHtml("<a href=\"x\">'&'"),
            "&lt;a href=&quot;x&quot;&gt;&#39;&amp;&#39;");
}

}  // namespace
}  // namespace sweepfit
