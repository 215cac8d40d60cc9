// SPDX-License-Identifier: Apache-2.0
#include "capture/keypoints.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <tuple>
#include <utility>

#include "model/file_io.h"
#include "model/input_error.h"
#include "model/skeleton.h"

namespace sweepfit {
namespace {

using Json = nlohmann::json;

// Detectors say how sure they are; below this they guess.
constexpr double kMinConfidence = 0.2;
// Square root of the area that a person covers over the person's extent.
constexpr double kScaleOfExtent = 0.4;

// A point as detectors name it and as we do, with the spread of annotators as a
// share of the person's scale (COCO's evaluation, COCO-WholeBody for the feet;
// what they do not define has the value of its neighbour).
struct KnownPoint {
  std::string_view theirs;
  std::string_view ours;
  double spread;
};
constexpr KnownPoint kKnownPoints[] = {
    {"nose", "nose", 0.026},
    {"left_eye", "l_eye", 0.025},
    {"right_eye", "r_eye", 0.025},
    {"left_ear", "l_ear", 0.035},
    {"right_ear", "r_ear", 0.035},
    {"left_shoulder", "l_shoulder", 0.079},
    {"right_shoulder", "r_shoulder", 0.079},
    {"left_elbow", "l_elbow", 0.072},
    {"right_elbow", "r_elbow", 0.072},
    {"left_wrist", "l_wrist", 0.062},
    {"right_wrist", "r_wrist", 0.062},
    {"left_hip", "l_hip", 0.107},
    {"right_hip", "r_hip", 0.107},
    {"left_knee", "l_knee", 0.087},
    {"right_knee", "r_knee", 0.087},
    {"left_ankle", "l_ankle", 0.089},
    {"right_ankle", "r_ankle", 0.089},
    {"left_big_toe", "l_foot_end", 0.068},
    {"right_big_toe", "r_foot_end", 0.068},
    {"left_small_toe", "l_small_toe", 0.066},
    {"right_small_toe", "r_small_toe", 0.066},
    {"left_heel", "l_heel", 0.066},
    {"right_heel", "r_heel", 0.066},
    {"neck", "mid_shoulder", 0.079},
    {"mid_hip", "root", 0.107}};

constexpr std::string_view kCoco[] = {"nose",
                                      "left_eye",
                                      "right_eye",
                                      "left_ear",
                                      "right_ear",
                                      "left_shoulder",
                                      "right_shoulder",
                                      "left_elbow",
                                      "right_elbow",
                                      "left_wrist",
                                      "right_wrist",
                                      "left_hip",
                                      "right_hip",
                                      "left_knee",
                                      "right_knee",
                                      "left_ankle",
                                      "right_ankle"};
constexpr std::string_view kOpenPose25[] = {
    "nose",           "neck",          "right_shoulder", "right_elbow",
    "right_wrist",    "left_shoulder", "left_elbow",     "left_wrist",
    "mid_hip",        "right_hip",     "right_knee",     "right_ankle",
    "left_hip",       "left_knee",     "left_ankle",     "right_eye",
    "left_eye",       "right_ear",     "left_ear",       "left_big_toe",
    "left_small_toe", "left_heel",     "right_big_toe",  "right_small_toe",
    "right_heel"};
constexpr std::string_view kOpenPose18[] = {"nose",
                                            "neck",
                                            "right_shoulder",
                                            "right_elbow",
                                            "right_wrist",
                                            "left_shoulder",
                                            "left_elbow",
                                            "left_wrist",
                                            "right_hip",
                                            "right_knee",
                                            "right_ankle",
                                            "left_hip",
                                            "left_knee",
                                            "left_ankle",
                                            "right_eye",
                                            "left_eye",
                                            "right_ear",
                                            "left_ear"};

const KnownPoint* FindKnownPoint(std::string_view theirs) {
  for (const KnownPoint& point : kKnownPoints) {
    if (point.theirs == theirs) return &point;
  }
  return nullptr;
}

// One person as a detector sees it.
struct Detection {
  struct Point {
    const KnownPoint* point;
    Eigen::Vector2d pixel;
    double confidence;
  };
  std::vector<Point> points;
  double Sum() const {
    double sum = 0;
    for (const Point& point : points) sum += point.confidence;
    return sum;
  }
};

// One JSON file read strictly; every error names it and the place in it.
class File {
 public:
  explicit File(std::filesystem::path path) : path_(std::move(path)) {
    try {
      root_ = Json::parse(ReadWholeFile(path_.string()));
    } catch (const Json::exception& error) {
      // "[json.exception.parse_error.101] parse error at line 3, column 5: ..."
      std::string text = error.what();
      const auto end = text.find("] ");
      if (end != std::string::npos) text.erase(0, end + 2);
      throw InputError(path_.string() + ": " + text);
    }
  }

  const Json& root() const { return root_; }

  [[noreturn]] void Fail(const std::string& where,
                         const std::string& what) const {
    throw InputError(path_.string() + ": " +
                     (where.empty() ? what : where + ": " + what));
  }

  const Json& Get(const Json& object,
                  const std::string& where,
                  const char* key) const {
    if (!object.is_object()) Fail(where, "must be an object");
    const auto it = object.find(key);
    if (it == object.end()) Fail(where, std::string("no '") + key + "'");
    return *it;
  }
  const Json& List(const Json& object,
                   const std::string& where,
                   const char* key) const {
    const Json& list = Get(object, where, key);
    if (!list.is_array()) {
      Fail(where, std::string("'") + key + "' must be a list");
    }
    return list;
  }
  double Number(const Json& value,
                const std::string& where,
                const std::string& key) const {
    if (!value.is_number() || !std::isfinite(value.get<double>())) {
      Fail(where, "'" + key + "' must be a number");
    }
    return value.get<double>();
  }
  std::string Text(const Json& object,
                   const std::string& where,
                   const char* key) const {
    const Json& value = Get(object, where, key);
    if (!value.is_string()) {
      Fail(where, std::string("'") + key + "' must be a text");
    }
    return value.get<std::string>();
  }
  // COCO's ids: whole numbers, in some tools texts.
  std::string Id(const Json& object,
                 const std::string& where,
                 const char* key) const {
    const Json& value = Get(object, where, key);
    if (value.is_string()) return value.get<std::string>();
    if (!value.is_number_integer()) {
      Fail(where, std::string("'") + key + "' must be a whole number");
    }
    return value.dump();
  }

 private:
  std::filesystem::path path_;
  Json root_;
};

std::string Entry(const std::string& list, std::size_t index) {
  return list + "[" + std::to_string(index) + "]";
}

// x, y, confidence per name.
Detection ReadDetection(const File& file,
                        const std::string& where,
                        const Json& values,
                        std::span<const std::string_view> names,
                        bool coco_visibility) {
  if (!values.is_array() || values.size() != 3 * names.size()) {
    file.Fail(where,
              "must hold x, y and confidence of " +
                  std::to_string(names.size()) + " points");
  }
  Detection detection;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double x = file.Number(values[3 * i], where, "x");
    const double y = file.Number(values[3 * i + 1], where, "y");
    double confidence = file.Number(values[3 * i + 2], where, "confidence");
    if (confidence < 0) file.Fail(where, "a confidence is negative");
    // Annotators write 0 not there, 1 hidden, 2 seen.
    if (coco_visibility) confidence *= 0.5;
    const KnownPoint* point = FindKnownPoint(names[i]);
    if (point == nullptr || confidence < kMinConfidence) continue;
    detection.points.push_back({point, {x, y}, std::min(confidence, 1.0)});
  }
  return detection;
}

// The points of category `id`, COCO's person without categories.
std::vector<std::string> CategoryNames(const File& file,
                                       const Json& annotation,
                                       const std::string& where) {
  std::vector<std::string> names(std::begin(kCoco), std::end(kCoco));
  const Json& root = file.root();
  if (!root.is_object() || !root.contains("categories")) return names;
  const std::string id = file.Id(annotation, where, "category_id");
  const Json& categories = file.List(root, "", "categories");
  for (std::size_t i = 0; i < categories.size(); ++i) {
    const std::string entry = Entry("categories", i);
    if (file.Id(categories[i], entry, "id") != id) continue;
    if (!categories[i].contains("keypoints")) return names;
    names.clear();
    const Json& list = file.List(categories[i], entry, "keypoints");
    for (const Json& name : list) {
      if (!name.is_string()) file.Fail(entry, "'keypoints' must hold names");
      names.push_back(name.get<std::string>());
    }
    return names;
  }
  file.Fail(where, "'category_id' " + id + " is not among the categories");
}

Detection ReadCocoPerson(const File& file,
                         const std::string& where,
                         const Json& annotation) {
  const Json& values = file.List(annotation, where, "keypoints");
  const std::vector<std::string> names = CategoryNames(file, annotation, where);
  const std::vector<std::string_view> views(names.begin(), names.end());
  // Detections carry a score, annotations do not.
  const bool annotated = !annotation.contains("score");
  return ReadDetection(file, where + ": 'keypoints'", values, views, annotated);
}

const Detection* MostConfident(const std::vector<Detection>& people) {
  const auto best = std::max_element(
      people.begin(), people.end(), [](const auto& a, const auto& b) {
        return a.Sum() < b.Sum();
      });
  return best == people.end() ? nullptr : &*best;
}

void Append(const std::vector<Detection>& people,
            const std::string& pose,
            const Camera& camera,
            std::vector<Keypoint2>* keypoints) {
  const Detection* person = MostConfident(people);
  if (person == nullptr || person->points.empty()) return;
  Eigen::Vector2d low = person->points.front().pixel;
  Eigen::Vector2d high = low;
  for (const Detection::Point& p : person->points) {
    low = low.cwiseMin(p.pixel);
    high = high.cwiseMax(p.pixel);
  }
  const double scale = kScaleOfExtent * std::max(1.0, (high - low).maxCoeff());
  for (const Detection::Point& p : person->points) {
    if (!(p.pixel.x() >= -0.5 && p.pixel.y() >= -0.5 &&
          p.pixel.x() <= camera.width - 0.5 &&
          p.pixel.y() <= camera.height - 0.5)) {
      continue;
    }
    keypoints->push_back({camera.id,
                          pose,
                          std::string(p.point->ours),
                          p.pixel,
                          scale * p.point->spread / p.confidence});
  }
}

// All people in the file of one picture, OpenPose or COCO.
std::vector<Detection> ReadPeople(const File& file) {
  const Json& root = file.root();
  std::vector<Detection> people;
  if (root.is_object() && root.contains("people")) {
    const Json& list = file.List(root, "", "people");
    for (std::size_t i = 0; i < list.size(); ++i) {
      const std::string where = Entry("people", i);
      const Json& values = file.List(list[i], where, "pose_keypoints_2d");
      const bool is_coco = values.size() == 3 * std::size(kOpenPose18);
      people.push_back(ReadDetection(
          file,
          where + ": 'pose_keypoints_2d'",
          values,
          is_coco ? std::span<const std::string_view>(kOpenPose18)
                  : std::span<const std::string_view>(kOpenPose25),
          false));
    }
    return people;
  }
  const bool is_list = root.is_array();
  if (!is_list && !(root.is_object() && root.contains("annotations"))) {
    file.Fail("", "neither OpenPose ('people') nor COCO ('annotations')");
  }
  const Json& list = is_list ? root : file.List(root, "", "annotations");
  for (std::size_t i = 0; i < list.size(); ++i) {
    people.push_back(ReadCocoPerson(file, Entry("annotations", i), list[i]));
  }
  return people;
}

std::vector<Keypoint2> ReadFolder(const std::filesystem::path& folder,
                                  const Capture& capture) {
  std::set<std::filesystem::path> files;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".json") files.insert(entry.path());
  }
  if (files.empty()) {
    throw InputError(folder.string() + ": holds no .json file");
  }
  std::vector<Keypoint2> keypoints;
  for (const CapturePose& pose : capture.poses) {
    for (const CaptureCamera& entry : capture.cameras) {
      const Camera& camera = entry.camera;
      if (pose.images.count(camera.id) == 0) continue;
      std::optional<std::filesystem::path> found;
      for (const std::string& name :
           {pose.name + "/" + camera.id, pose.name + "_" + camera.id}) {
        for (const char* ending : {".json", "_keypoints.json"}) {
          const std::filesystem::path path = folder / (name + ending);
          if (files.erase(path) == 0) continue;
          if (found) {
            throw InputError(path.string() + ": the same picture as " +
                             found->string());
          }
          found = path;
        }
      }
      if (found) {
        Append(ReadPeople(File(*found)), pose.name, camera, &keypoints);
      }
    }
  }
  if (!files.empty()) {
    throw InputError(files.begin()->string() +
                     ": no picture of the capture has this name; expected "
                     "POSE/CAMERA.json or POSE_CAMERA.json");
  }
  return keypoints;
}

// True when the path ends with the parts of the other one.
bool EndsWith(const std::filesystem::path& path,
              const std::filesystem::path& end) {
  const std::vector<std::filesystem::path> a(path.begin(), path.end());
  const std::vector<std::filesystem::path> b(end.begin(), end.end());
  return b.size() <= a.size() && std::equal(b.rbegin(), b.rend(), a.rbegin());
}

// A data set: its images are found among the capture's by their paths.
std::vector<Keypoint2> ReadCoco(const File& file, const Capture& capture) {
  std::map<std::string, std::vector<Detection>> people;  // by image id
  const Json& annotations = file.List(file.root(), "", "annotations");
  for (std::size_t i = 0; i < annotations.size(); ++i) {
    const std::string where = Entry("annotations", i);
    people[file.Id(annotations[i], where, "image_id")].push_back(
        ReadCocoPerson(file, where, annotations[i]));
  }
  // Pose and camera (positions in the capture) -> image id.
  std::map<std::pair<std::size_t, std::size_t>, std::string> images;
  std::set<std::string> known;
  const Json& list = file.List(file.root(), "", "images");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string where = Entry("images", i);
    const std::string id = file.Id(list[i], where, "id");
    const std::filesystem::path name = file.Text(list[i], where, "file_name");
    if (!known.insert(id).second) file.Fail(where, "'id' is used twice");
    std::vector<std::pair<std::size_t, std::size_t>> matches;
    for (std::size_t p = 0; p < capture.poses.size(); ++p) {
      for (std::size_t c = 0; c < capture.cameras.size(); ++c) {
        const auto& of_pose = capture.poses[p].images;
        const auto it = of_pose.find(capture.cameras[c].camera.id);
        if (it == of_pose.end()) continue;
        if (EndsWith(name, it->second) || EndsWith(it->second, name)) {
          matches.emplace_back(p, c);
        }
      }
    }
    if (matches.size() != 1) {
      file.Fail(where,
                "'file_name' " + name.string() +
                    (matches.empty() ? " is no picture of the capture"
                                     : " may be several pictures of the "
                                       "capture: give more of its path"));
    }
    if (!images.emplace(matches[0], id).second) {
      file.Fail(where, "this picture is listed twice");
    }
  }
  for (const auto& [id, unused] : people) {
    if (known.count(id) == 0) {
      file.Fail("annotations", "'image_id' " + id + " is not among the images");
    }
  }
  std::vector<Keypoint2> keypoints;
  for (const auto& [picture, id] : images) {
    Append(people[id],
           capture.poses[picture.first].name,
           capture.cameras[picture.second].camera,
           &keypoints);
  }
  return keypoints;
}

bool IsKnownName(const std::string& name) {
  return FindJoint(name) >= 0 ||
         std::find(std::begin(kKeypointLandmarks),
                   std::end(kKeypointLandmarks),
                   name) != std::end(kKeypointLandmarks);
}

Keypoint2 ReadKeypoint(const File& file,
                       const std::string& where,
                       const Json& entry,
                       const Capture& capture) {
  Keypoint2 point;
  point.camera_id = file.Text(entry, where, "camera");
  point.pose = file.Text(entry, where, "pose");
  point.name = file.Text(entry, where, "name");
  for (const auto& item : entry.items()) {
    static const std::set<std::string> kKeys = {
        "camera", "pose", "name", "u", "v", "sigma"};
    if (kKeys.count(item.key()) == 0) {
      file.Fail(where, "unknown key '" + item.key() + "'");
    }
  }
  const auto number = [&](const char* key) {
    return file.Number(file.Get(entry, where, key), where, key);
  };
  point.pixel = {number("u"), number("v")};
  point.sigma = number("sigma");
  if (!(point.sigma > 0)) file.Fail(where, "'sigma' must be positive");
  if (!IsKnownName(point.name)) {
    file.Fail(where, "'name' is neither a joint nor a landmark: " + point.name);
  }
  const auto camera = std::find_if(
      capture.cameras.begin(), capture.cameras.end(), [&](const auto& c) {
        return c.camera.id == point.camera_id;
      });
  if (camera == capture.cameras.end()) {
    file.Fail(where, "the capture has no camera " + point.camera_id);
  }
  const auto pose = std::find_if(
      capture.poses.begin(), capture.poses.end(), [&](const auto& p) {
        return p.name == point.pose;
      });
  if (pose == capture.poses.end()) {
    file.Fail(where, "the capture has no pose " + point.pose);
  }
  if (pose->images.count(point.camera_id) == 0) {
    file.Fail(
        where,
        "camera " + point.camera_id + " has no picture of pose " + point.pose);
  }
  const Camera& c = camera->camera;
  if (!(point.pixel.x() >= -0.5 && point.pixel.y() >= -0.5 &&
        point.pixel.x() <= c.width - 0.5 &&
        point.pixel.y() <= c.height - 0.5)) {
    file.Fail(where, "the point lies outside the picture");
  }
  return point;
}

std::vector<Keypoint2> ReadOurs(const File& file, const Capture& capture) {
  const Json& root = file.root();
  for (const auto& item : root.items()) {
    if (item.key() != "version" && item.key() != "keypoints") {
      file.Fail("", "unknown key '" + item.key() + "'");
    }
  }
  if (file.Get(root, "", "version") != 1) file.Fail("", "'version' must be 1");
  const Json& list = file.List(root, "", "keypoints");
  std::vector<Keypoint2> keypoints;
  std::set<std::tuple<std::string, std::string, std::string>> seen;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string where = Entry("keypoints", i);
    const Keypoint2 point = ReadKeypoint(file, where, list[i], capture);
    if (!seen.emplace(point.pose, point.camera_id, point.name).second) {
      file.Fail(where,
                point.name + " of pose " + point.pose + ", camera " +
                    point.camera_id + " is given twice");
    }
    keypoints.push_back(point);
  }
  std::map<std::string, std::size_t> pose_rank, camera_rank;
  for (const CapturePose& pose : capture.poses) {
    pose_rank.emplace(pose.name, pose_rank.size());
  }
  for (const CaptureCamera& camera : capture.cameras) {
    camera_rank.emplace(camera.camera.id, camera_rank.size());
  }
  std::stable_sort(
      keypoints.begin(),
      keypoints.end(),
      [&](const Keypoint2& a, const Keypoint2& b) {
        return std::pair(pose_rank.at(a.pose), camera_rank.at(a.camera_id)) <
               std::pair(pose_rank.at(b.pose), camera_rank.at(b.camera_id));
      });
  return keypoints;
}

std::vector<Keypoint2> ReadFile(const std::filesystem::path& path,
                                const Capture& capture) {
  const File file(path);
  const Json& root = file.root();
  if (root.is_object() && root.contains("annotations")) {
    return ReadCoco(file, capture);
  }
  if (root.is_object() && root.contains("people")) {
    file.Fail("",
              "an OpenPose file does not say of which picture it is: give a "
              "folder with POSE/CAMERA.json");
  }
  if (root.is_array()) {
    file.Fail("",
              "a list of detections does not say which pictures they are of: "
              "give a COCO data set with images, or a folder");
  }
  if (!root.is_object()) file.Fail("", "must be an object");
  return ReadOurs(file, capture);
}

}  // namespace

std::vector<Keypoint2> LoadKeypoints(const std::filesystem::path& path,
                                     const Capture& capture) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    throw InputError(path.string() + ": no such file or folder");
  }
  std::vector<Keypoint2> keypoints = std::filesystem::is_directory(path, error)
                                         ? ReadFolder(path, capture)
                                         : ReadFile(path, capture);
  if (keypoints.empty()) {
    throw InputError(path.string() + ": holds no keypoint of this capture");
  }
  return keypoints;
}

}  // namespace sweepfit
