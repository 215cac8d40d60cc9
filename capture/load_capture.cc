// SPDX-License-Identifier: Apache-2.0
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <map>
#include <set>
#include <string_view>

#include "capture/capture.h"
#include "capture/up_axis.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

// Reads values of one capture.yaml strictly; every error names file and line,
// and `where` says which part of the file was being read ("camera cam00").
class Reader {
 public:
  explicit Reader(std::filesystem::path file) : file_(std::move(file)) {}

  const std::filesystem::path& file() const { return file_; }

  [[noreturn]] void Fail(const YAML::Node& node,
                         const std::string& where,
                         const std::string& what) const {
    std::string text = file_.string();
    if (node.IsDefined() && node.Mark().line >= 0) {
      text += ":" + std::to_string(node.Mark().line + 1);
    }
    text += ": ";
    if (!where.empty()) text += where + ": ";
    throw InputError(text + what);
  }

  // Node must be a map with no key twice and, unless `known` is empty, no key
  // outside `known`.
  void CheckMap(const YAML::Node& node,
                const std::string& where,
                std::initializer_list<std::string_view> known) const {
    if (!node.IsMap()) Fail(node, where, "must be a map of keys to values");
    std::set<std::string> seen;
    for (const auto& entry : node) {
      if (!entry.first.IsScalar()) Fail(entry.first, where, "bad key");
      const std::string& key = entry.first.Scalar();
      if (!seen.insert(key).second) {
        Fail(entry.first, where, "key '" + key + "' is given twice");
      }
      if (known.size() == 0) continue;
      if (std::find(known.begin(), known.end(), key) == known.end()) {
        Fail(entry.first, where, "unknown key '" + key + "'");
      }
    }
  }

  YAML::Node Required(const YAML::Node& map,
                      const std::string& where,
                      const char* key) const {
    const YAML::Node node = map[key];
    if (!node.IsDefined() || node.IsNull()) {
      Fail(node.IsDefined() ? node : map,
           where,
           std::string("'") + key + "' is missing");
    }
    return node;
  }

  std::string Text(const YAML::Node& node,
                   const std::string& where,
                   const std::string& key) const {
    if (!node.IsScalar() || node.Scalar().empty()) {
      Fail(node, where, "'" + key + "' must be a text");
    }
    return node.Scalar();
  }

  int Integer(const YAML::Node& node,
              const std::string& where,
              const std::string& key) const {
    int value = 0;
    if (!node.IsScalar() || !YAML::convert<int>::decode(node, value)) {
      Fail(node, where, "'" + key + "' must be an integer");
    }
    return value;
  }

  double Number(const YAML::Node& node,
                const std::string& where,
                const std::string& key) const {
    double value = 0;
    if (!node.IsScalar() || !YAML::convert<double>::decode(node, value)) {
      Fail(node, where, "'" + key + "' must hold numbers only");
    }
    if (!std::isfinite(value)) {
      Fail(node, where, "'" + key + "' holds a number that is not finite");
    }
    return value;
  }

  std::vector<double> Numbers(const YAML::Node& node,
                              const std::string& where,
                              const std::string& key) const {
    if (!node.IsSequence()) {
      Fail(node, where, "'" + key + "' must be a list of numbers");
    }
    std::vector<double> values;
    for (const YAML::Node& item : node) {
      values.push_back(Number(item, where, key));
    }
    return values;
  }

  std::vector<double> Numbers(const YAML::Node& node,
                              const std::string& where,
                              const std::string& key,
                              std::size_t size) const {
    std::vector<double> values = Numbers(node, where, key);
    if (values.size() != size) {
      Fail(node,
           where,
           "'" + key + "' must have " + std::to_string(size) +
               " numbers, not " + std::to_string(values.size()));
    }
    return values;
  }

  Eigen::Matrix3d Matrix(const YAML::Node& node,
                         const std::string& where,
                         const std::string& key) const {
    const std::vector<double> values = Numbers(node, where, key, 9);
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
        values.data());
  }

  // A name that becomes part of file names.
  std::string Name(const YAML::Node& node,
                   const std::string& where,
                   const std::string& key) const {
    const std::string name = Text(node, where, key);
    const auto is_safe = [](unsigned char c) {
      return std::isalnum(c) || c == '_' || c == '-' || c == '.';
    };
    if (name.size() > 64 || name[0] == '.' || name[0] == '-' ||
        !std::all_of(name.begin(), name.end(), is_safe)) {
      Fail(node,
           where,
           "'" + key +
               "' must be a plain name (letters, digits, _ - .), not '" + name +
               "'");
    }
    return name;
  }

  // The relative path of a picture that exists.
  std::string File(const YAML::Node& node,
                   const std::string& where,
                   const std::string& key) const {
    const std::string path = Text(node, where, key);
    const std::filesystem::path full = file_.parent_path() / path;
    std::error_code error;
    if (!std::filesystem::exists(full, error)) {
      Fail(node, where, "'" + key + "': no file " + full.string());
    }
    if (!std::filesystem::is_regular_file(full, error)) {
      Fail(node, where, "'" + key + "': not a file: " + full.string());
    }
    return path;
  }

 private:
  std::filesystem::path file_;
};

// What the file says about the world; the program wants metres and +Y up.
struct World {
  double metres_per_unit = 1;
  Eigen::Matrix3d ours_from_file = Eigen::Matrix3d::Identity();
};

World ReadWorld(const Reader& reader, const YAML::Node& root) {
  World world;
  const YAML::Node units = reader.Required(root, "", "units");
  const std::string unit = reader.Text(units, "", "units");
  if (unit == "cm") {
    world.metres_per_unit = 0.01;
  } else if (unit == "mm") {
    world.metres_per_unit = 0.001;
  } else if (unit != "m") {
    reader.Fail(units, "", "'units' must be m, cm or mm, not '" + unit + "'");
  }
  const YAML::Node up_node = reader.Required(root, "", "up");
  const std::string up = reader.Text(up_node, "", "up");
  const std::map<std::string, Eigen::Vector3d> axes = {
      {"y", Eigen::Vector3d::UnitY()},
      {"z", Eigen::Vector3d::UnitZ()},
      {"-y", -Eigen::Vector3d::UnitY()},
      {"-z", -Eigen::Vector3d::UnitZ()}};
  const auto axis = axes.find(up);
  if (axis == axes.end()) {
    reader.Fail(up_node, "", "'up' must be y, z, -y or -z, not '" + up + "'");
  }
  world.ours_from_file = RotationToYUp(axis->second);
  return world;
}

int ReadSide(const Reader& reader,
             const YAML::Node& node,
             const std::string& where,
             const char* key) {
  constexpr int kMinSide = 16;
  constexpr int kMaxSide = 32768;
  const YAML::Node value = reader.Required(node, where, key);
  const int side = reader.Integer(value, where, key);
  if (side < kMinSide || side > kMaxSide) {
    reader.Fail(value,
                where,
                std::string("'") + key + "' must be " +
                    std::to_string(kMinSide) + " to " +
                    std::to_string(kMaxSide) + " pixels");
  }
  return side;
}

Eigen::Matrix3d ReadIntrinsics(const Reader& reader,
                               const YAML::Node& node,
                               const std::string& where) {
  const Eigen::Matrix3d K = reader.Matrix(node, where, "K");
  if (K(2, 0) != 0 || K(2, 1) != 0 || K(2, 2) != 1) {
    reader.Fail(node, where, "'K' must end with the row 0, 0, 1");
  }
  if (K(0, 1) != 0 || K(1, 0) != 0) {
    reader.Fail(node, where, "'K' must have no skew (2nd and 4th number 0)");
  }
  if (K(0, 0) <= 0 || K(1, 1) <= 0) {
    reader.Fail(node, where, "'K' must have positive focal lengths");
  }
  return K;
}

Eigen::Matrix3d ReadRotation(const Reader& reader,
                             const YAML::Node& node,
                             const std::string& where) {
  Eigen::Matrix3d R = reader.Matrix(node, where, "R");
  if (const auto error = MakeRotation(&R)) {
    reader.Fail(node, where, "'R' " + *error);
  }
  return R;
}

// One picture of the empty scene, or a list of them.
std::vector<std::string> ReadBackground(const Reader& reader,
                                        const YAML::Node& node,
                                        const std::string& where) {
  if (!node.IsSequence()) return {reader.File(node, where, "background")};
  if (node.size() == 0) reader.Fail(node, where, "'background' is empty");
  std::vector<std::string> files;
  for (const YAML::Node& item : node) {
    files.push_back(reader.File(item, where, "background"));
    if (std::count(files.begin(), files.end(), files.back()) > 1) {
      reader.Fail(item, where, "'background' names " + files.back() + " twice");
    }
  }
  return files;
}

CaptureCamera ReadCamera(const Reader& reader,
                         const World& world,
                         const YAML::Node& node,
                         int index) {
  std::string where = "camera number " + std::to_string(index + 1);
  reader.CheckMap(node,
                  where,
                  {"id",
                   "width",
                   "height",
                   "K",
                   "distortion",
                   "R",
                   "t",
                   "background",
                   "chroma_key"});
  CaptureCamera result;
  Camera& camera = result.camera;
  camera.id = reader.Name(reader.Required(node, where, "id"), where, "id");
  where = "camera " + camera.id;
  camera.width = ReadSide(reader, node, where, "width");
  camera.height = ReadSide(reader, node, where, "height");
  camera.K = ReadIntrinsics(reader, reader.Required(node, where, "K"), where);
  if (const YAML::Node distortion = node["distortion"]) {
    const std::vector<double> k =
        reader.Numbers(distortion, where, "distortion");
    if (k.size() != 4 && k.size() != 5) {
      reader.Fail(distortion,
                  where,
                  "'distortion' must have 4 or 5 numbers, not " +
                      std::to_string(k.size()));
    }
    std::copy(k.begin(), k.end(), camera.distortion.begin());
    if (!camera.CanUndistort()) {
      reader.Fail(distortion,
                  where,
                  "'distortion' folds the picture over and cannot be undone: "
                  "it must be k1, k2, p1, p2[, k3] in this order, of no "
                  "fisheye lens, and fit K, width and height");
    }
  }
  const Eigen::Matrix3d camera_from_file =
      ReadRotation(reader, reader.Required(node, where, "R"), where);
  camera.camera_from_world =
      camera_from_file * world.ours_from_file.transpose();
  const std::vector<double> t =
      reader.Numbers(reader.Required(node, where, "t"), where, "t", 3);
  camera.world_in_camera =
      world.metres_per_unit * Eigen::Vector3d(t[0], t[1], t[2]);
  if (const YAML::Node background = node["background"]) {
    result.background = ReadBackground(reader, background, where);
  }
  if (const YAML::Node key = node["chroma_key"]) {
    result.chroma_key = reader.Text(key, where, "chroma_key");
    if (result.chroma_key != "green" && result.chroma_key != "blue" &&
        result.chroma_key != "auto") {
      reader.Fail(key, where, "'chroma_key' must be green, blue or auto");
    }
  }
  return result;
}

std::map<std::string, std::string> ReadFiles(const Reader& reader,
                                             const YAML::Node& node,
                                             const std::string& where,
                                             const std::string& key,
                                             const std::set<std::string>& ids) {
  reader.CheckMap(node, where + ": '" + key + "'", {});
  std::map<std::string, std::string> files;
  for (const auto& entry : node) {
    const std::string id = entry.first.Scalar();
    if (ids.count(id) == 0) {
      reader.Fail(entry.first, where, "'" + key + "' of unknown camera " + id);
    }
    files[id] = reader.File(entry.second, where, key + "/" + id);
  }
  return files;
}

CapturePose ReadPose(const Reader& reader,
                     const YAML::Node& node,
                     int index,
                     const std::set<std::string>& ids) {
  std::string where = "pose number " + std::to_string(index + 1);
  reader.CheckMap(node, where, {"name", "images", "masks"});
  CapturePose pose;
  pose.name = reader.Name(reader.Required(node, where, "name"), where, "name");
  where = "pose " + pose.name;
  const YAML::Node images = reader.Required(node, where, "images");
  pose.images = ReadFiles(reader, images, where, "images", ids);
  if (pose.images.empty()) {
    reader.Fail(images, where, "'images' names no picture");
  }
  if (const YAML::Node masks = node["masks"]) {
    pose.masks = ReadFiles(reader, masks, where, "masks", ids);
    for (const auto& [id, path] : pose.masks) {
      if (pose.images.count(id) == 0) {
        reader.Fail(masks, where, "camera " + id + " has a mask but no image");
      }
    }
  }
  return pose;
}

YAML::Node ReadSequence(const Reader& reader,
                        const YAML::Node& root,
                        const char* key) {
  const YAML::Node node = reader.Required(root, "", key);
  if (!node.IsSequence() || node.size() == 0) {
    reader.Fail(node, "", std::string("'") + key + "' must be a list");
  }
  return node;
}

YAML::Node ParseFile(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    throw InputError(path.string() + ": no such file");
  }
  if (!std::filesystem::is_regular_file(path, error)) {
    throw InputError(path.string() + ": not a file");
  }
  try {
    return YAML::LoadFile(path.string());
  } catch (const YAML::ParserException& e) {
    throw InputError(path.string() + ":" + std::to_string(e.mark.line + 1) +
                     ": not well-formed YAML: " + e.msg);
  } catch (const YAML::Exception& e) {
    throw InputError(path.string() + ": cannot be read: " + e.msg);
  }
}

void ReadCameras(const Reader& reader,
                 const YAML::Node& root,
                 Capture* capture,
                 std::set<std::string>* ids) {
  const World world = ReadWorld(reader, root);
  const YAML::Node cameras = ReadSequence(reader, root, "cameras");
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    capture->cameras.push_back(
        ReadCamera(reader, world, cameras[i], static_cast<int>(i)));
    const std::string& id = capture->cameras.back().camera.id;
    if (!ids->insert(id).second) {
      reader.Fail(cameras[i], "camera " + id, "this id is used twice");
    }
  }
  if (capture->cameras.size() < 2) {
    reader.Fail(cameras, "", "'cameras' must list at least two cameras");
  }
}

void ReadHoldout(const Reader& reader,
                 const YAML::Node& root,
                 const std::set<std::string>& ids,
                 Capture* capture) {
  const YAML::Node holdout = root["holdout"];
  if (!holdout || holdout.IsNull()) return;
  if (!holdout.IsSequence()) {
    reader.Fail(holdout, "", "'holdout' must be a list of camera ids");
  }
  for (const YAML::Node& item : holdout) {
    const std::string id = reader.Text(item, "", "holdout");
    if (ids.count(id) == 0) {
      reader.Fail(item, "", "'holdout' names unknown camera " + id);
    }
    if (capture->IsHoldout(id)) {
      reader.Fail(item, "", "'holdout' names camera " + id + " twice");
    }
    capture->holdout.push_back(id);
  }
}

Capture ReadCapture(const Reader& reader, const YAML::Node& root) {
  reader.CheckMap(
      root, "", {"version", "units", "up", "cameras", "holdout", "poses"});
  const YAML::Node version = reader.Required(root, "", "version");
  if (reader.Integer(version, "", "version") != 1) {
    reader.Fail(version, "", "'version' must be 1");
  }
  Capture capture;
  capture.folder = reader.file().parent_path();
  std::set<std::string> ids;
  ReadCameras(reader, root, &capture, &ids);
  ReadHoldout(reader, root, ids, &capture);
  const YAML::Node poses = ReadSequence(reader, root, "poses");
  std::set<std::string> names;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    capture.poses.push_back(
        ReadPose(reader, poses[i], static_cast<int>(i), ids));
    const std::string& name = capture.poses.back().name;
    if (!names.insert(name).second) {
      reader.Fail(poses[i], "pose " + name, "this name is used twice");
    }
  }
  return capture;
}

}  // namespace

Capture LoadCapture(const std::filesystem::path& folder) {
  const Reader reader(folder / "capture.yaml");
  const YAML::Node root = ParseFile(reader.file());
  try {
    return ReadCapture(reader, root);
  } catch (const YAML::Exception& e) {
    throw InputError(reader.file().string() + ":" +
                     std::to_string(e.mark.line + 1) + ": " + e.msg);
  }
}

}  // namespace sweepfit
