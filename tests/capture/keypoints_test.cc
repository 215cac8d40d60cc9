// SPDX-License-Identifier: Apache-2.0
#include "capture/keypoints.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

Capture TwoPoses() {
  Capture capture;
  for (const char* id : {"left", "right"}) {
    CaptureCamera camera;
    camera.camera.id = id;
    camera.camera.width = 640;
    camera.camera.height = 480;
    capture.cameras.push_back(camera);
  }
  for (const std::string pose : {"T", "A"}) {
    capture.poses.push_back({pose,
                             {{"left", "images/" + pose + "/left.jpg"},
                              {"right", "images/" + pose + "/right.jpg"}},
                             {}});
  }
  capture.poses[1].images.erase("right");
  return capture;
}

class KeypointsTest : public ::testing::Test {
 protected:
  std::filesystem::path Write(const std::string& name,
                              const std::string& text) {
    const auto path = folder_.path() / name;
    std::filesystem::create_directories(path.parent_path());
    WriteBytes(path, text);
    return path;
  }
  std::vector<Keypoint2> Load(const std::string& text) {
    return LoadKeypoints(Write("keypoints.json", text), TwoPoses());
  }
  std::string Error(const std::filesystem::path& path) {
    try {
      LoadKeypoints(path, TwoPoses());
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }
  std::string ErrorOf(const std::string& text) {
    return Error(Write("keypoints.json", text));
  }

  TemporaryFolder folder_;
};

// x, y, confidence of `count` points on a diagonal.
Json Diagonal(int count, double confidence, double shift = 0) {
  Json values = Json::array();
  for (int i = 0; i < count; ++i) {
    values.push_back(shift + 10 * i);
    values.push_back(shift + 5 * i);
    values.push_back(confidence);
  }
  return values;
}

std::map<std::string, Keypoint2> ByName(const std::vector<Keypoint2>& list) {
  std::map<std::string, Keypoint2> map;
  for (const Keypoint2& point : list) map.emplace(point.name, point);
  EXPECT_EQ(map.size(), list.size());
  return map;
}

TEST_F(KeypointsTest, ReadsOurOwnFormatInTheOrderOfTheCapture) {
  const auto points = Load(R"({"version": 1, "keypoints": [
    {"camera": "left", "pose": "A", "name": "nose", "u": 1, "v": 2, "sigma": 3},
    {"camera": "right", "pose": "T", "name": "l_wrist", "u": 5.25, "v": -0.5,
     "sigma": 0.5},
    {"camera": "left", "pose": "T", "name": "crotch", "u": 639, "v": 479,
     "sigma": 4}]})");
  ASSERT_EQ(points.size(), 3u);
  EXPECT_EQ(points[0].name, "crotch");
  EXPECT_EQ(points[1].camera_id, "right");
  EXPECT_EQ(points[1].pose, "T");
  EXPECT_EQ(points[1].name, "l_wrist");
  EXPECT_EQ(points[1].pixel, Eigen::Vector2d(5.25, -0.5));
  EXPECT_EQ(points[1].sigma, 0.5);
  EXPECT_EQ(points[2].pose, "A");
}

TEST_F(KeypointsTest, RejectsWhatIsNotOurFormat) {
  const std::string good =
      R"({"version": 1, "keypoints": [{"camera": "left", "pose": "T",)"
      R"( "name": "l_wrist", "u": 1, "v": 2, "sigma": 3}]})";
  EXPECT_EQ(Load(good).size(), 1u);
  struct Case {
    const char *from, *to, *message;
  };
  const Case cases[] = {
      {"{\"version\"", "{\n\n\"version\" 3", "line 3"},
      {"\"version\": 1", "\"version\": 2", "'version' must be 1"},
      {"\"version\": 1, ", "", "no 'version'"},
      {"\"keypoints\"", "\"points\"", "unknown key 'points'"},
      {"\"left\"", "\"top\"", "keypoints[0]: the capture has no camera top"},
      {"\"left\"", "7", "'camera' must be a text"},
      {"\"T\"", "\"N\"", "no pose N"},
      {"\"left\", \"pose\": \"T\"",
       "\"right\", \"pose\": \"A\"",
       "camera right has no picture of pose A"},
      {"l_wrist", "l_tail", "neither a joint nor a landmark: l_tail"},
      {"\"u\": 1", "\"u\": \"1\"", "'u' must be a number"},
      {"\"u\": 1", "\"u\": 640", "outside the picture"},
      {"\"u\": 1, ", "", "no 'u'"},
      {"\"u\": 1", "\"u\": 1e999", "number"},
      {"\"sigma\": 3", "\"sigma\": 0", "'sigma' must be positive"},
      {"\"sigma\": 3", "\"sigma\": 3, \"w\": 1", "unknown key 'w'"},
      {"}]}",
       "}, {\"camera\": \"left\", \"pose\": \"T\", \"name\": \"l_wrist\", "
       "\"u\": 1, \"v\": 2, \"sigma\": 3}]}",
       "keypoints[1]: l_wrist of pose T, camera left is given twice"},
      {good.c_str(), "{\"version\": 1, \"keypoints\": []}", "no keypoint"},
      {good.c_str(), "[1]", "does not say which pictures"},
      {good.c_str(), "3", "must be an object"},
      {good.c_str(), "{\"people\": []}", "give a folder"},
  };
  for (const Case& c : cases) {
    std::string text = good;
    text.replace(text.find(c.from), std::string(c.from).size(), c.to);
    const std::string message = ErrorOf(text);
    EXPECT_THAT(message, HasSubstr(c.message)) << c.to;
    EXPECT_THAT(message, HasSubstr("keypoints.json: ")) << c.to;
    EXPECT_EQ(message.find('\n'), std::string::npos) << c.to;
  }
  EXPECT_THAT(Error(folder_.path() / "none.json"), HasSubstr("no such file"));
}

TEST_F(KeypointsTest, ReadsOpenPoseFolders) {
  Json file;
  file["people"] = {{{"pose_keypoints_2d", Diagonal(25, 0.25)}},
                    {{"pose_keypoints_2d", Diagonal(25, 0.5, 40)}}};
  Write("detected/T/left_keypoints.json", file.dump());
  file["people"] = {{{"pose_keypoints_2d", Diagonal(18, 1)}}};
  Write("detected/T_right.json", file.dump());
  Write("detected/A/left.json", R"({"people": []})");
  const auto points = LoadKeypoints(folder_.path() / "detected", TwoPoses());
  ASSERT_EQ(points.size(), 25u + 18u);
  const auto left = ByName({points.begin(), points.begin() + 25});
  // The person seen more clearly, who stands 40 pixels further.
  EXPECT_EQ(left.at("nose").pixel, Eigen::Vector2d(40, 40));
  EXPECT_EQ(left.at("mid_shoulder").pixel, Eigen::Vector2d(50, 45));
  EXPECT_EQ(left.at("r_wrist").pixel, Eigen::Vector2d(80, 60));
  EXPECT_EQ(left.at("l_wrist").pixel, Eigen::Vector2d(110, 75));
  EXPECT_EQ(left.at("root").pixel, Eigen::Vector2d(120, 80));
  EXPECT_EQ(left.at("l_ankle").pixel, Eigen::Vector2d(180, 110));
  EXPECT_EQ(left.at("l_foot_end").pixel, Eigen::Vector2d(230, 135));
  EXPECT_EQ(left.at("r_heel").pixel, Eigen::Vector2d(280, 160));
  // Spread of a wrist, 0.062 of the scale, twice for confidence 0.5.
  EXPECT_NEAR(left.at("l_wrist").sigma, 0.062 * 0.4 * 240 / 0.5, 1e-9);
  const auto right = ByName({points.begin() + 25, points.end()});
  EXPECT_EQ(right.at("l_ankle").pixel, Eigen::Vector2d(130, 65));
  EXPECT_EQ(right.at("r_hip").pixel, Eigen::Vector2d(80, 40));
  EXPECT_EQ(right.at("l_ear").pixel, Eigen::Vector2d(170, 85));
  EXPECT_EQ(right.count("root"), 0u);
}

TEST_F(KeypointsTest, LeavesOutGuessesAndPointsBeyondTheFrame) {
  Json values = Diagonal(25, 0.9);
  values[3 * 4 + 2] = 0.1;   // right wrist: a guess
  values[3 * 7] = 900;       // left wrist: outside
  values[3 * 22 + 2] = 0.0;  // right big toe: not seen
  Json file;
  file["people"] = {{{"pose_keypoints_2d", values}}};
  Write("detected/T/left.json", file.dump());
  const auto points =
      ByName(LoadKeypoints(folder_.path() / "detected", TwoPoses()));
  EXPECT_EQ(points.size(), 22u);
  EXPECT_EQ(points.count("r_wrist"), 0u);
  EXPECT_EQ(points.count("l_wrist"), 0u);
  EXPECT_EQ(points.count("r_foot_end"), 0u);
}

TEST_F(KeypointsTest, ReadsCocoPerPictureAndAsOneDataSet) {
  // Detections with a score.
  Json list = Json::array();
  list.push_back(
      {{"category_id", 1}, {"score", 0.9}, {"keypoints", Diagonal(17, 0.8)}});
  Write("detected/T/left.json", list.dump());
  const auto detected =
      ByName(LoadKeypoints(folder_.path() / "detected", TwoPoses()));
  EXPECT_EQ(detected.at("l_shoulder").pixel, Eigen::Vector2d(50, 25));
  EXPECT_NEAR(detected.at("r_hip").sigma, 0.107 * 0.4 * 160 / 0.8, 1e-9);

  // Annotations: 2 is seen, 1 hidden, 0 not there; names from the category.
  Json set;
  set["images"] = {{{"id", 7}, {"file_name", "A/left.jpg"}},
                   {{"id", 3}, {"file_name", "/data/images/T/right.jpg"}}};
  set["categories"] = {
      {{"id", 2},
       {"name", "person"},
       {"keypoints", {"left_wrist", "tail", "left_heel", "nose"}}}};
  set["annotations"] = {{{"image_id", 7},
                         {"category_id", 2},
                         {"keypoints", {5, 6, 2, 7, 8, 2, 105, 9, 1, 0, 0, 0}}},
                        {{"image_id", 3},
                         {"category_id", 2},
                         {"keypoints", {1, 2, 0, 1, 2, 0, 1, 2, 0, 9, 9, 2}}}};
  const auto points = Load(set.dump());
  ASSERT_EQ(points.size(), 3u);
  EXPECT_EQ(points[0].pose, "T");
  EXPECT_EQ(points[0].camera_id, "right");
  EXPECT_EQ(points[0].name, "nose");
  EXPECT_EQ(points[1].pose, "A");
  EXPECT_EQ(points[1].name, "l_wrist");
  EXPECT_NEAR(points[1].sigma, 0.062 * 0.4 * 100, 1e-9);
  EXPECT_EQ(points[2].name, "l_heel");
  EXPECT_NEAR(points[2].sigma, 2 * 0.066 * 0.4 * 100, 1e-9);

  const auto error_with = [&](const char* list_name, const Json& change) {
    Json broken = set;
    broken[list_name][0].update(change);
    return ErrorOf(broken.dump());
  };
  EXPECT_THAT(error_with("images", {{"file_name", "A/top.jpg"}}),
              HasSubstr("images[0]: 'file_name' A/top.jpg is no picture"));
  EXPECT_THAT(error_with("images", {{"file_name", "left.jpg"}}),
              HasSubstr("give more of its path"));
  EXPECT_THAT(error_with("images", {{"file_name", "T/right.jpg"}}),
              HasSubstr("listed twice"));
  EXPECT_THAT(error_with("images", {{"id", 3}}), HasSubstr("used twice"));
  EXPECT_THAT(error_with("annotations", {{"image_id", 8}}),
              HasSubstr("'image_id' 8 is not among the images"));
  EXPECT_THAT(error_with("annotations", {{"category_id", 5}}),
              HasSubstr("annotations[0]: 'category_id' 5"));
  EXPECT_THAT(error_with("annotations", {{"keypoints", {1, 2}}}),
              HasSubstr("x, y and confidence of 4 points"));
}

TEST_F(KeypointsTest, RejectsFoldersThatDoNotFit) {
  const auto folder = folder_.path() / "detected";
  std::filesystem::create_directories(folder);
  EXPECT_THAT(Error(folder), HasSubstr("holds no .json file"));
  const std::string nobody = R"({"people": []})";
  Write("detected/T/left.json", nobody);
  EXPECT_THAT(Error(folder), HasSubstr("no keypoint of this capture"));
  Write("detected/T_left_keypoints.json", nobody);
  EXPECT_THAT(Error(folder), HasSubstr("the same picture as"));
  std::filesystem::remove(folder / "T_left_keypoints.json");
  Write("detected/T/top.json", nobody);
  EXPECT_THAT(Error(folder), HasSubstr("T/top.json: no picture"));
  std::filesystem::remove(folder / "T" / "top.json");
  Write("detected/T/left.json", R"({"people": [{"pose_keypoints_2d": [1]}]})");
  EXPECT_THAT(Error(folder), HasSubstr("left.json: people[0]"));
  Write("detected/T/left.json", "{}");
  EXPECT_THAT(Error(folder), HasSubstr("neither OpenPose"));
  Write("detected/T/left.json", "{");
  EXPECT_THAT(Error(folder), HasSubstr("parse error"));
}

}  // namespace
}  // namespace sweepfit
