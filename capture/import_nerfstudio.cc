// SPDX-License-Identifier: Apache-2.0
//
// transforms.json of nerfstudio (docs.nerf.studio, data conventions) and
// instant-ngp.
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "capture/import_camera.h"
#include "capture/import_format.h"
#include "model/file_io.h"

namespace sweepfit {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

// A number of the frame, or of the whole file when the frame says nothing.
std::optional<double> Number(const Json& root,
                             const Json& frame,
                             const char* key,
                             const std::string& where) {
  const Json* value = nullptr;
  for (const Json* object : {&root, &frame}) {
    if (object->contains(key)) value = &object->at(key);
  }
  if (value == nullptr) return std::nullopt;
  if (!value->is_number() || !std::isfinite(value->get<double>())) {
    FailImport(where, std::string("'") + key + "' must be a number");
  }
  return value->get<double>();
}

double NumberOr(const Json& root,
                const Json& frame,
                const char* key,
                double other,
                const std::string& where) {
  return Number(root, frame, key, where).value_or(other);
}

std::string Text(const Json& object,
                 const char* key,
                 const std::string& where) {
  if (!object.contains(key)) return "";
  if (!object.at(key).is_string()) {
    FailImport(where, std::string("'") + key + "' must be a text");
  }
  return object.at(key).get<std::string>();
}

void CheckModel(const Json& object, const std::string& where) {
  const std::string model = Text(object, "camera_model", where);
  if (!model.empty() && model != "OPENCV" && model != "PINHOLE" &&
      model != "SIMPLE_PINHOLE" && model != "PERSPECTIVE") {
    FailImport(where,
               "'camera_model' " + model +
                   " cannot be expressed: undistort the pictures");
  }
  for (const char* key : {"is_fisheye", "from_na"}) {
    if (object.contains(key) && object.at(key) != false) {
      FailImport(where, std::string("'") + key + "' is not supported");
    }
  }
}

// Names of pictures may lack the extension.
std::string FindImage(const fs::path& folder, const std::string& name) {
  std::error_code error;
  for (const char* extension : {"", ".png", ".jpg", ".jpeg"}) {
    if (fs::is_regular_file(folder / (name + extension), error)) {
      return name + extension;
    }
  }
  return name;
}

void ReadIntrinsics(const Json& root,
                    const Json& frame,
                    const fs::path& image,
                    const std::string& where,
                    Camera* camera) {
  auto width = Number(root, frame, "w", where);
  auto height = Number(root, frame, "h", where);
  if (!width || !height) {
    std::error_code error;
    cv::Mat picture;
    if (fs::is_regular_file(image, error)) {
      picture = cv::imread(
          image.string(), cv::IMREAD_UNCHANGED | cv::IMREAD_IGNORE_ORIENTATION);
    }
    if (picture.empty()) {
      FailImport(where,
                 "no 'w' and 'h', and no picture " + image.string() +
                     " to take them from");
    }
    width = picture.cols;
    height = picture.rows;
  }
  SetSize(*width, *height, where, camera);
  auto fx = Number(root, frame, "fl_x", where);
  auto fy = Number(root, frame, "fl_y", where);
  // instant-ngp: the field of view instead.
  const auto focal = [&](const char* key, double side) {
    const auto angle = Number(root, frame, key, where);
    return angle ? std::optional(side / (2 * std::tan(*angle / 2)))
                 : std::nullopt;
  };
  if (!fx) fx = focal("camera_angle_x", *width);
  if (!fy) fy = focal("camera_angle_y", *height);
  if (!fx && !fy) FailImport(where, "neither 'fl_x' nor 'camera_angle_x'");
  Eigen::Matrix3d K;
  // The top left pixel is centred at 0.5 there.
  K << fx.value_or(fy.value_or(0)), 0,
      NumberOr(root, frame, "cx", *width / 2, where) - 0.5, 0,
      fy.value_or(fx.value_or(0)),
      NumberOr(root, frame, "cy", *height / 2, where) - 0.5, 0, 0, 1;
  SetIntrinsics(K, where, camera);
  const auto k = [&](const char* key) {
    return NumberOr(root, frame, key, 0, where);
  };
  SetDistortion(
      {k("k1"), k("k2"), k("p1"), k("p2"), k("k3"), k("k4")}, where, camera);
}

void ReadPose(const Json& frame, const std::string& where, Camera* camera) {
  if (!frame.contains("transform_matrix")) {
    FailImport(where, "no 'transform_matrix'");
  }
  const Json& rows = frame.at("transform_matrix");
  Eigen::Matrix4d world_from_camera;
  bool sound = rows.is_array() && (rows.size() == 4 || rows.size() == 3);
  world_from_camera.row(3) << 0, 0, 0, 1;
  for (size_t r = 0; sound && r < rows.size(); ++r) {
    sound = rows[r].is_array() && rows[r].size() == 4;
    for (int c = 0; sound && c < 4; ++c) {
      sound = rows[r][c].is_number();
      if (sound) world_from_camera(r, c) = rows[r][c].get<double>();
    }
  }
  if (!sound || world_from_camera.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    FailImport(where,
               "'transform_matrix' must be 4 rows of 4 numbers, the last 0, 0, "
               "0, 1");
  }
  // y up and z back there.
  const Eigen::Matrix3d flip = Eigen::Vector3d(1, -1, -1).asDiagonal();
  const Eigen::Matrix3d camera_from_world =
      flip * world_from_camera.topLeftCorner<3, 3>().transpose();
  SetPose(camera_from_world, Eigen::Vector3d::Zero(), where, camera);
  camera->world_in_camera =
      -camera->camera_from_world * world_from_camera.topRightCorner<3, 1>();
  if (!camera->world_in_camera.allFinite()) {
    FailImport(where, "'transform_matrix' holds a number that is not finite");
  }
}

}  // namespace

ImportedCalibration ReadNerfstudio(const fs::path& source) {
  const fs::path file =
      fs::is_directory(source) ? source / "transforms.json" : source;
  Json root;
  try {
    root = Json::parse(ReadWholeFile(file.string()));
  } catch (const Json::exception& error) {
    // "[json.exception.parse_error.101] parse error at line 3, column 5: ..."
    std::string text = error.what();
    const auto end = text.find("] ");
    FailImport(file.string(),
               end == std::string::npos ? text : text.substr(end + 2));
  }
  if (!root.is_object() || !root.contains("frames") ||
      !root.at("frames").is_array()) {
    FailImport(file.string(), "no list 'frames'");
  }
  CheckModel(root, file.string());
  ImportedCalibration calibration;
  calibration.folder = file.parent_path();
  const Json& frames = root.at("frames");
  for (size_t i = 0; i < frames.size(); ++i) {
    std::string where = file.string() + ": frames[" + std::to_string(i) + "]";
    const Json& frame = frames[i];
    if (!frame.is_object()) FailImport(where, "must be an object");
    const std::string name = Text(frame, "file_path", where);
    if (name.empty()) FailImport(where, "no 'file_path'");
    where += " (" + name + ")";
    CheckModel(frame, where);
    ImportedCamera& camera = calibration.cameras.emplace_back();
    camera.image = FindImage(calibration.folder, name);
    camera.mask = Text(frame, "mask_path", where);
    camera.camera.id = fs::path(name).filename().stem().string();
    ReadIntrinsics(
        root, frame, calibration.folder / camera.image, where, &camera.camera);
    ReadPose(frame, where, &camera.camera);
  }
  return calibration;
}

}  // namespace sweepfit
