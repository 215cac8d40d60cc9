// SPDX-License-Identifier: Apache-2.0
//
// COLMAP's sparse models (doc/format.rst, src/colmap/scene and sensor/models.h
// of COLMAP).
#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <set>
#include <sstream>
#include <string_view>

#include "capture/import_camera.h"
#include "capture/import_format.h"
#include "model/file_io.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

// COLMAP's camera models by number. The roles of the parameters: f both focal
// lengths, x y one of them, c d principal point, k l r s t u radial k1..k6, p q
// tangential; empty: a model that our camera cannot express.
struct Model {
  std::string_view name;
  int num_params;
  std::string_view roles;
};
constexpr Model kModels[] = {{"SIMPLE_PINHOLE", 3, "fcd"},
                             {"PINHOLE", 4, "xycd"},
                             {"SIMPLE_RADIAL", 4, "fcdk"},
                             {"RADIAL", 5, "fcdkl"},
                             {"OPENCV", 8, "xycdklpq"},
                             {"OPENCV_FISHEYE", 8, ""},
                             {"FULL_OPENCV", 12, "xycdklpqrstu"},
                             {"FOV", 5, ""},
                             {"SIMPLE_RADIAL_FISHEYE", 4, ""},
                             {"RADIAL_FISHEYE", 5, ""},
                             {"THIN_PRISM_FISHEYE", 12, ""}};

Camera MakeCamera(const Model& model,
                  double width,
                  double height,
                  const std::vector<double>& params,
                  const std::string& where) {
  if (model.roles.empty()) {
    FailImport(where,
               "camera model " + std::string(model.name) +
                   " cannot be expressed: export undistorted pictures "
                   "(colmap image_undistorter)");
  }
  std::map<char, double> value;
  for (size_t i = 0; i < model.roles.size(); ++i) {
    value[model.roles[i]] = params[i];
  }
  const double fx = value.count('f') > 0 ? value['f'] : value['x'];
  const double fy = value.count('f') > 0 ? value['f'] : value['y'];
  Camera camera;
  Eigen::Matrix3d K;
  // The corner of the top left pixel is (0, 0) there.
  K << fx, 0, value['c'] - 0.5, 0, fy, value['d'] - 0.5, 0, 0, 1;
  SetSize(width, height, where, &camera);
  SetIntrinsics(K, where, &camera);
  SetDistortion({value['k'],
                 value['l'],
                 value['p'],
                 value['q'],
                 value['r'],
                 value['s'],
                 value['t'],
                 value['u']},
                where,
                &camera);
  return camera;
}

// qvec: w first, any length but zero.
void SetColmapPose(const Eigen::Vector4d& qvec,
                   const Eigen::Vector3d& t,
                   const std::string& where,
                   Camera* camera) {
  if (!qvec.allFinite() || !(qvec.norm() > 1e-6)) {
    FailImport(where, "the quaternion is no rotation");
  }
  const Eigen::Quaterniond rotation(qvec[0], qvec[1], qvec[2], qvec[3]);
  SetPose(rotation.normalized().toRotationMatrix(), t, where, camera);
}

using CameraById = std::map<std::uint32_t, Camera>;

void AddImage(const CameraById& cameras,
              std::uint32_t camera_id,
              const std::string& name,
              const Eigen::Vector4d& qvec,
              const Eigen::Vector3d& t,
              const std::string& where,
              ImportedCalibration* calibration) {
  const auto intrinsics = cameras.find(camera_id);
  if (intrinsics == cameras.end()) {
    FailImport(where, "there is no camera " + std::to_string(camera_id));
  }
  if (name.empty()) FailImport(where, "the image has no name");
  ImportedCamera& camera = calibration->cameras.emplace_back();
  camera.camera = intrinsics->second;
  camera.image = name;
  SetColmapPose(qvec, t, where, &camera.camera);
}

// --- text ---

// The lines of a file that say something.
class Lines {
 public:
  explicit Lines(const fs::path& path)
      : path_(path), stream_(ReadWholeFile(path.string())) {}

  // The next line that is neither comment nor (unless wanted) empty.
  bool Next(bool empty_too, std::string* line) {
    while (std::getline(stream_, *line)) {
      ++number_;
      if (!line->empty() && line->back() == '\r') line->pop_back();
      if (line->starts_with('#')) continue;
      if (empty_too || line->find_first_not_of(" \t") != std::string::npos) {
        return true;
      }
    }
    return false;
  }
  std::string Where() const {
    return path_.string() + ":" + std::to_string(number_);
  }

 private:
  fs::path path_;
  std::istringstream stream_;
  int number_ = 0;
};

double NextNumber(std::istringstream* words,
                  const std::string& where,
                  const char* what) {
  std::string word;
  double value = 0;
  if (!(*words >> word) || !ParseDouble(word, &value)) {
    FailImport(where, std::string("expected a number for ") + what);
  }
  return value;
}

std::uint32_t NextId(std::istringstream* words,
                     const std::string& where,
                     const char* what) {
  const double value = NextNumber(words, where, what);
  if (!(value >= 0 && value <= 4294967295.0) || value != std::floor(value)) {
    FailImport(where, std::string(what) + " must be a whole number");
  }
  return static_cast<std::uint32_t>(value);
}

CameraById ReadTextCameras(const fs::path& path) {
  CameraById cameras;
  Lines lines(path);
  for (std::string line; lines.Next(false, &line);) {
    const std::string where = lines.Where();
    std::istringstream words(line);
    const std::uint32_t id = NextId(&words, where, "CAMERA_ID");
    std::string name;
    words >> name;
    const Model* model = nullptr;
    for (const Model& candidate : kModels) {
      if (candidate.name == name) model = &candidate;
    }
    if (model == nullptr) FailImport(where, "unknown camera model " + name);
    const double width = NextNumber(&words, where, "WIDTH");
    const double height = NextNumber(&words, where, "HEIGHT");
    std::vector<double> params;
    for (int i = 0; i < model->num_params; ++i) {
      params.push_back(NextNumber(&words, where, "PARAMS"));
    }
    std::string rest;
    if (words >> rest) {
      FailImport(where,
                 name + " has " + std::to_string(model->num_params) +
                     " parameters, and here are more");
    }
    if (!cameras.emplace(id, MakeCamera(*model, width, height, params, where))
             .second) {
      FailImport(where, "camera " + std::to_string(id) + " is given twice");
    }
  }
  return cameras;
}

void ReadTextImages(const fs::path& path,
                    const CameraById& cameras,
                    ImportedCalibration* calibration) {
  Lines lines(path);
  for (std::string line; lines.Next(false, &line);) {
    const std::string where = lines.Where();
    std::istringstream words(line);
    NextId(&words, where, "IMAGE_ID");
    Eigen::Vector4d qvec;
    Eigen::Vector3d t;
    for (double& q : qvec) q = NextNumber(&words, where, "QW QX QY QZ");
    for (double& x : t) x = NextNumber(&words, where, "TX TY TZ");
    const std::uint32_t camera_id = NextId(&words, where, "CAMERA_ID");
    std::string name;
    std::getline(words >> std::ws, name);  // may hold spaces
    AddImage(cameras, camera_id, name, qvec, t, where, calibration);
    // Its points, or an empty line where there are none.
    std::string points;
    if (!lines.Next(true, &points)) break;
    std::istringstream fields(points);
    int count = 0;
    for (std::string field; fields >> field; ++count) {
      double ignored = 0;
      if (!ParseDouble(field, &ignored)) count = -4;
      if (count < 0) break;
    }
    if (count % 3 != 0 || count < 0) {
      FailImport(lines.Where(),
                 "expected the points of the image above, X Y POINT3D_ID each "
                 "(an empty line when there are none)");
    }
  }
}

// --- binary, little endian ---

class Bytes {
 public:
  explicit Bytes(const fs::path& path)
      : path_(path), bytes_(ReadWholeFile(path.string())) {}

  std::string Where() const {
    return path_.string() + ": byte " + std::to_string(at_);
  }
  size_t remaining() const { return bytes_.size() - at_; }

  template <typename T>
  T Read(const char* what) {
    static_assert(std::endian::native == std::endian::little);
    if (remaining() < sizeof(T)) Truncated(what);
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  // A count of records of at least `size` bytes each: no more than can follow.
  std::uint64_t ReadCount(const char* what, size_t size) {
    const std::string where = Where();
    const auto count = Read<std::uint64_t>(what);
    if (count > remaining() / size) {
      FailImport(where,
                 std::string(what) + " is " + std::to_string(count) +
                     ", more than the rest of the file can hold");
    }
    return count;
  }
  std::string ReadName() {
    const size_t end = bytes_.find('\0', at_);
    if (end == std::string::npos) Truncated("an image name");
    std::string name = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return name;
  }
  void Skip(size_t count, const char* what) {
    if (remaining() < count) Truncated(what);
    at_ += count;
  }

 private:
  [[noreturn]] void Truncated(const char* what) const {
    FailImport(Where(), std::string("the file ends within ") + what);
  }

  fs::path path_;
  std::string bytes_;
  size_t at_ = 0;
};

CameraById ReadBinaryCameras(const fs::path& path) {
  CameraById cameras;
  Bytes bytes(path);
  const std::uint64_t count = bytes.ReadCount("the number of cameras", 48);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string where = bytes.Where();
    const auto id = bytes.Read<std::uint32_t>("a camera");
    const auto number = bytes.Read<std::int32_t>("a camera");
    if (number < 0 || number >= static_cast<int>(std::size(kModels))) {
      FailImport(where, "unknown camera model " + std::to_string(number));
    }
    const Model& model = kModels[number];
    const auto width = bytes.Read<std::uint64_t>("a camera");
    const auto height = bytes.Read<std::uint64_t>("a camera");
    std::vector<double> params;
    for (int k = 0; k < model.num_params; ++k) {
      params.push_back(bytes.Read<double>("a camera"));
    }
    const std::string named = where + ": camera " + std::to_string(id);
    if (!cameras
             .emplace(id,
                      MakeCamera(model,
                                 static_cast<double>(width),
                                 static_cast<double>(height),
                                 params,
                                 named))
             .second) {
      FailImport(named, "is given twice");
    }
  }
  if (bytes.remaining() > 0) {
    FailImport(bytes.Where(), "there is more than the cameras announced");
  }
  return cameras;
}

void ReadBinaryImages(const fs::path& path,
                      const CameraById& cameras,
                      ImportedCalibration* calibration) {
  constexpr size_t kPointSize = 24;
  Bytes bytes(path);
  const std::uint64_t count = bytes.ReadCount("the number of images", 73);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string where = bytes.Where();
    bytes.Read<std::uint32_t>("an image");
    Eigen::Vector4d qvec;
    Eigen::Vector3d t;
    for (double& q : qvec) q = bytes.Read<double>("an image");
    for (double& x : t) x = bytes.Read<double>("an image");
    const auto camera_id = bytes.Read<std::uint32_t>("an image");
    const std::string name = bytes.ReadName();
    AddImage(cameras,
             camera_id,
             name,
             qvec,
             t,
             where + ": image " + name,
             calibration);
    const std::uint64_t num_points =
        bytes.ReadCount("the number of an image's points", kPointSize);
    bytes.Skip(num_points * kPointSize, "an image's points");
  }
  if (bytes.remaining() > 0) {
    FailImport(bytes.Where(), "there is more than the images announced");
  }
}

// Names cameras after their pictures: cam00.jpg, or where that is not unique
// (cam00/shot.jpg) by the whole path.
void NameCameras(ImportedCalibration* calibration) {
  std::set<std::string> stems;
  for (const ImportedCamera& camera : calibration->cameras) {
    stems.insert(fs::path(camera.image).stem().string());
  }
  const bool unique = stems.size() == calibration->cameras.size();
  for (ImportedCamera& camera : calibration->cameras) {
    fs::path path = camera.image;
    std::string id = path.stem().string();
    if (!unique) {
      id = path.replace_extension().generic_string();
      std::replace(id.begin(), id.end(), '/', '_');
    }
    camera.camera.id = id;
  }
  // COLMAP stores images in the order of its work.
  std::sort(
      calibration->cameras.begin(),
      calibration->cameras.end(),
      [](const auto& a, const auto& b) { return a.camera.id < b.camera.id; });
}

}  // namespace

ImportedCalibration ReadColmap(const fs::path& source) {
  const auto has = [&](const char* name) {
    std::error_code error;
    return fs::is_regular_file(source / name, error);
  };
  ImportedCalibration calibration;
  calibration.folder = source;
  if (has("cameras.bin") && has("images.bin")) {
    ReadBinaryImages(source / "images.bin",
                     ReadBinaryCameras(source / "cameras.bin"),
                     &calibration);
  } else if (has("cameras.txt") && has("images.txt")) {
    ReadTextImages(source / "images.txt",
                   ReadTextCameras(source / "cameras.txt"),
                   &calibration);
  } else {
    FailImport(source.string(),
               "is no folder with cameras and images, both .bin or both .txt");
  }
  NameCameras(&calibration);
  return calibration;
}

}  // namespace sweepfit
