// SPDX-License-Identifier: Apache-2.0
//
// Files that programs write with cv::FileStorage. There is no fixed set of
// keys; these are the ones of OpenCV's own samples and what people make of
// them.
#include <algorithm>
#include <set>

#include "capture/import_camera.h"
#include "capture/import_format.h"
#include "capture/import_storage.h"
#include "model/rigid_motion.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// The first key that is there; an error that lists them when none is.
std::string Require(const StorageFile& file,
                    const std::string& where,
                    std::initializer_list<const char*> keys) {
  const std::string key = file.FirstOf(keys);
  if (key.empty()) {
    std::string names;
    for (const char* name : keys) names += " " + std::string(name);
    FailImport(where, "none of the keys" + names);
  }
  return key;
}

void ReadImageSize(const StorageFile& file, Camera* camera) {
  if (file.Has("image_size")) {
    const auto size = file.Numbers("image_size", 2);
    SetSize(size[0], size[1], file.Where("image_size"), camera);
    return;
  }
  const auto width = file.Number("image_width");
  const auto height = file.Number("image_height");
  if (width && height) {
    SetSize(*width, *height, file.Where("image_width"), camera);
  }
}

ImportedCamera ReadCamera(const fs::path& path) {
  const StorageFile file(path);
  const std::string name = path.string();
  ImportedCamera result;
  Camera& camera = result.camera;
  camera.id = path.stem().string();
  ReadImageSize(file, &camera);
  const std::string K = Require(
      file, name, {"camera_matrix", "Camera_Matrix", "cameraMatrix", "K", "M"});
  SetIntrinsics(Eigen::Map<const RowMajor>(file.Numbers(K, 9).data()),
                file.Where(K),
                &camera);
  const std::string distortion = file.FirstOf({"distortion_coefficients",
                                               "Distortion_Coefficients",
                                               "distCoeffs",
                                               "dist_coeffs",
                                               "D"});
  if (!distortion.empty()) {
    SetDistortion(file.Numbers(distortion), file.Where(distortion), &camera);
  }
  const std::string R =
      Require(file, name, {"R", "rotation_matrix", "rotation_vector", "rvec"});
  const std::string t =
      Require(file, name, {"T", "t", "translation_vector", "tvec"});
  const auto rotation = file.Numbers(R);
  if (rotation.size() != 9 && rotation.size() != 3) {
    FailImport(file.Where(R),
               "'" + R + "' must be a 3 x 3 matrix or an axis-angle vector");
  }
  const auto translation = file.Numbers(t, 3);
  SetPose(rotation.size() == 9
              ? Eigen::Matrix3d(Eigen::Map<const RowMajor>(rotation.data()))
              : RotationOf(Eigen::Map<const Eigen::Vector3d>(rotation.data())),
          Eigen::Map<const Eigen::Vector3d>(translation.data()),
          file.Where(R),
          &camera);
  return result;
}

}  // namespace

ImportedCalibration ReadOpenCv(const fs::path& source) {
  if (!fs::is_directory(source)) {
    FailImport(source.string(), "must be a folder with one file per camera");
  }
  static const std::set<std::string> kExtensions = {
      ".yml", ".yaml", ".xml", ".json"};
  std::set<fs::path> files;
  for (const auto& entry : fs::directory_iterator(source)) {
    if (kExtensions.count(entry.path().extension().string()) > 0) {
      files.insert(entry.path());
    }
  }
  ImportedCalibration calibration;
  calibration.axes_are_chosen = true;
  calibration.folder = source;
  for (const fs::path& file : files) {
    calibration.cameras.push_back(ReadCamera(file));
  }
  return calibration;
}

}  // namespace sweepfit
