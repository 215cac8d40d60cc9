// SPDX-License-Identifier: Apache-2.0
#include "experiments/import_to_folder.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <sstream>

#include "capture/import_format.h"
#include "capture/picture_pattern.h"
#include "capture/silhouette.h"
#include "capture/up_axis.h"
#include "experiments/output_folder.h"
#include "model/file_io.h"
#include "model/input_error.h"
#include "volume/person_height.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

constexpr char kMarker[] = "import.json";

std::string Format(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

double Degrees(double radians) { return radians * 180 / std::numbers::pi; }

// A name that a capture may use.
std::string PlainName(std::string name) {
  for (char& c : name) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                       c == '_' || c == '-' || c == '.';
    if (!plain) c = '_';
  }
  while (!name.empty() && (name[0] == '.' || name[0] == '-')) name.erase(0, 1);
  return name.substr(0, 64);
}

// The direction that an axis or three numbers name; nothing when neither.
std::optional<Eigen::Vector3d> ParseDirection(const std::string& text) {
  static const std::map<std::string, Eigen::Vector3d> kAxes = {
      {"x", {1, 0, 0}},
      {"y", {0, 1, 0}},
      {"z", {0, 0, 1}},
      {"-x", {-1, 0, 0}},
      {"-y", {0, -1, 0}},
      {"-z", {0, 0, -1}}};
  const auto axis = kAxes.find(text);
  if (axis != kAxes.end()) return axis->second;
  Eigen::Vector3d direction;
  std::istringstream stream(text);
  char comma = 0, comma2 = 0;
  std::string rest;
  if (!(stream >> direction[0] >> comma >> direction[1] >> comma2 >>
        direction[2]) ||
      stream >> rest || comma != ',' || comma2 != ',' ||
      !direction.allFinite() || !(direction.norm() > 1e-6)) {
    return std::nullopt;
  }
  return direction.normalized();
}

// One run of the import.
class Import {
 public:
  Import(const ImportOptions& options,
         const fs::path& folder,
         Progress* progress)
      : options_(options), folder_(folder), progress_(progress) {}

  ImportReport Run();

 private:
  // Pictures of one kind by camera id, for every pose.
  struct Pictures {
    FoundPictures images, masks;
    std::map<std::string, fs::path> background;
  };

  void Stage(const char* what) {
    if (progress_ != nullptr) progress_->Stage("import", what);
  }
  void Note(const std::string& text) {
    report_.notes.push_back(text);
    if (progress_ != nullptr) progress_->Warning(text);
  }

  std::vector<std::string> CameraIds() const;
  Pictures Find();
  FoundPictures FindImages();
  FoundPictures NamedByCalibration(std::string ImportedCamera::*member,
                                   const char* what) const;
  void SelectPoses(FoundPictures* images) const;
  void KeepCamerasWithPictures(const FoundPictures& images);
  void RequireAll(const std::map<std::string, fs::path>& files,
                  const std::set<std::string>& cameras,
                  const std::string& what) const;
  std::string Copy(const fs::path& file, const fs::path& to);
  std::string CopyAlpha(const fs::path& file, const fs::path& to) const;
  void AddPictures(const Pictures& pictures);
  void ReadMissingSizes();
  Eigen::Vector3d ChooseUp();
  void TurnUp();
  void Scale(double metres_per_unit);
  void ChooseScale();
  void MeasureScale();
  void CheckPictures();
  void WriteMarker() const;

  const ImportOptions& options_;
  fs::path folder_;
  Progress* progress_;
  ImportedCalibration calibration_;
  std::map<std::string, std::string> source_of_;  // by path in the capture
  ImportReport report_;
};

std::vector<std::string> Import::CameraIds() const {
  std::vector<std::string> ids;
  for (const ImportedCamera& camera : calibration_.cameras) {
    ids.push_back(camera.camera.id);
  }
  return ids;
}

// The pictures that the calibration names, beside it or in a folder images
// nearby.
FoundPictures Import::NamedByCalibration(std::string ImportedCamera::*member,
                                         const char* what) const {
  FoundPictures found;
  const std::string pose =
      options_.poses.empty() ? "A" : options_.poses.front();
  const fs::path& base = calibration_.folder;
  const std::vector<fs::path> places = {base,
                                        base / "images",
                                        base / ".." / "images",
                                        base / ".." / ".." / "images"};
  for (const ImportedCamera& camera : calibration_.cameras) {
    const std::string& name = camera.*member;
    if (name.empty()) continue;
    std::error_code error;
    const auto place =
        std::find_if(places.begin(), places.end(), [&](const fs::path& p) {
          return fs::is_regular_file(p / name, error);
        });
    if (place == places.end()) {
      throw InputError(options_.source.string() + ": camera " +
                       camera.camera.id + ": no picture " +
                       (base / name).string() + "; say where with --" + what);
    }
    found[pose][camera.camera.id] = *place / name;
  }
  return found;
}

FoundPictures Import::FindImages() {
  if (options_.images.empty()) {
    FoundPictures found = NamedByCalibration(&ImportedCamera::image, "images");
    if (found.empty()) {
      throw InputError(options_.source.string() +
                       ": names no pictures; say where with --images");
    }
    return found;
  }
  FoundPictures found = FindPictures(options_.images, CameraIds());
  if (const auto unnamed = found.extract(""); !unnamed.empty()) {
    found[options_.poses.empty() ? "A" : options_.poses.front()] =
        unnamed.mapped();
  } else {
    SelectPoses(&found);
  }
  return found;
}

void Import::SelectPoses(FoundPictures* images) const {
  if (options_.poses.empty()) return;
  FoundPictures chosen;
  for (const std::string& pose : options_.poses) {
    const auto it = images->find(pose);
    if (it == images->end()) {
      throw InputError(options_.images + ": no picture of pose " + pose);
    }
    chosen.insert(*it);
  }
  *images = std::move(chosen);
}

void Import::KeepCamerasWithPictures(const FoundPictures& images) {
  std::set<std::string> seen;
  for (const auto& [pose, files] : images) {
    for (const auto& [id, file] : files) seen.insert(id);
  }
  std::string lost;
  std::erase_if(calibration_.cameras, [&](const ImportedCamera& camera) {
    if (seen.count(camera.camera.id) > 0) return false;
    lost += " " + camera.camera.id;
    return true;
  });
  if (!lost.empty()) Note("left out, because there is no picture:" + lost);
  if (calibration_.cameras.size() < 2) {
    throw InputError(
        "pictures of fewer than two cameras were found; the "
        "calibration's names must appear in the files' paths");
  }
}

void Import::RequireAll(const std::map<std::string, fs::path>& files,
                        const std::set<std::string>& cameras,
                        const std::string& what) const {
  for (const std::string& id : cameras) {
    if (files.count(id) == 0) {
      throw InputError("camera " + id + ": no " + what + " was found");
    }
  }
}

Import::Pictures Import::Find() {
  Pictures pictures;
  pictures.images = FindImages();
  KeepCamerasWithPictures(pictures.images);
  std::set<std::string> cameras;
  for (const std::string& id : CameraIds()) cameras.insert(id);
  if (!options_.background.empty()) {
    const FoundPictures found = FindPictures(options_.background, CameraIds());
    if (found.size() > 1) {
      throw InputError("--background: a plate has no {pose}");
    }
    pictures.background = found.begin()->second;
    RequireAll(pictures.background, cameras, "background (--background)");
  }
  if (options_.masks == "alpha") return pictures;
  if (options_.masks.empty()) {
    pictures.masks = NamedByCalibration(&ImportedCamera::mask, "masks");
  } else {
    pictures.masks = FindPictures(options_.masks, CameraIds());
    if (auto unnamed = pictures.masks.extract(""); !unnamed.empty()) {
      if (pictures.images.size() > 1) {
        throw InputError("--masks: the pattern needs {pose}");
      }
      pictures.masks[pictures.images.begin()->first] = unnamed.mapped();
    }
  }
  if (!pictures.masks.empty()) {
    for (const auto& [pose, files] : pictures.images) {
      std::set<std::string> ids;
      for (const auto& [id, file] : files) ids.insert(id);
      RequireAll(pictures.masks[pose], ids, "mask of pose " + pose);
    }
  }
  return pictures;
}

std::string Import::Copy(const fs::path& file, const fs::path& to) {
  fs::path target = to;
  target += file.extension();
  std::error_code error;
  fs::create_directories((folder_ / target).parent_path(), error);
  if (options_.link) {
    fs::create_symlink(fs::absolute(file), folder_ / target, error);
  } else {
    fs::copy_file(file, folder_ / target, error);
  }
  if (error) {
    throw InputError(file.string() + ": cannot be copied: " + error.message());
  }
  source_of_[target.generic_string()] = file.string();
  return target.generic_string();
}

std::string Import::CopyAlpha(const fs::path& file, const fs::path& to) const {
  const cv::Mat picture = cv::imread(
      file.string(), cv::IMREAD_UNCHANGED | cv::IMREAD_IGNORE_ORIENTATION);
  if (picture.empty() || picture.channels() != 4) {
    throw InputError(file.string() + ": --masks alpha: has no alpha channel");
  }
  cv::Mat alpha;
  cv::extractChannel(picture, alpha, 3);
  fs::path target = to;
  target += ".png";
  std::error_code error;
  fs::create_directories((folder_ / target).parent_path(), error);
  if (error || !cv::imwrite((folder_ / target).string(), alpha)) {
    throw InputError((folder_ / target).string() + ": cannot be written");
  }
  return target.generic_string();
}

void Import::AddPictures(const Pictures& pictures) {
  std::map<std::string, std::string> plain;  // id in the calibration -> ours
  std::set<std::string> used;
  Capture& capture = report_.capture;
  capture.folder = folder_;
  for (const ImportedCamera& camera : calibration_.cameras) {
    const std::string id = PlainName(camera.camera.id);
    if (id.empty() || !used.insert(id).second) {
      throw InputError("camera " + camera.camera.id +
                       ": its name cannot be used in a capture");
    }
    plain[camera.camera.id] = id;
    CaptureCamera& entry = capture.cameras.emplace_back();
    entry.camera = camera.camera;
    entry.camera.id = id;
    if (!options_.chroma_key.empty()) entry.chroma_key = options_.chroma_key;
    const auto plate = pictures.background.find(camera.camera.id);
    if (plate != pictures.background.end()) {
      entry.background = {Copy(plate->second, fs::path("background") / id)};
    }
  }
  for (const std::string& id : options_.holdout) {
    capture.FindCamera(id);
    capture.holdout.push_back(id);
  }
  for (const auto& [name, files] : pictures.images) {
    CapturePose& pose = capture.poses.emplace_back();
    pose.name = PlainName(name);
    for (const auto& [id, file] : files) {
      const fs::path place = fs::path(pose.name) / plain.at(id);
      pose.images[plain.at(id)] = Copy(file, "images" / place);
      if (options_.masks == "alpha") {
        pose.masks[plain.at(id)] = CopyAlpha(file, "masks" / place);
      } else if (!pictures.masks.empty()) {
        pose.masks[plain.at(id)] =
            Copy(pictures.masks.at(name).at(id), "masks" / place);
      }
    }
  }
}

void Import::ReadMissingSizes() {
  for (CaptureCamera& entry : report_.capture.cameras) {
    Camera& camera = entry.camera;
    if (camera.width > 0) continue;
    for (const CapturePose& pose : report_.capture.poses) {
      const auto it = pose.images.find(camera.id);
      if (it == pose.images.end()) continue;
      const cv::Mat picture =
          cv::imread((folder_ / it->second).string(),
                     cv::IMREAD_UNCHANGED | cv::IMREAD_IGNORE_ORIENTATION);
      if (picture.empty()) {
        throw InputError(it->second + ": camera " + camera.id +
                         ": cannot be decoded as a picture");
      }
      camera.width = picture.cols;
      camera.height = picture.rows;
      break;
    }
  }
}

// What the user says, else the format, else the cameras.
Eigen::Vector3d Import::ChooseUp() {
  std::vector<Camera> cameras;
  for (const CaptureCamera& entry : report_.capture.cameras) {
    cameras.push_back(entry.camera);
  }
  const UpEstimate estimate = EstimateUp(cameras);
  const bool is_estimated = options_.up == "cameras" ||
                            (options_.up.empty() && calibration_.up.empty());
  if (!is_estimated) {
    const Eigen::Vector3d up =
        *ParseDirection(options_.up.empty() ? calibration_.up : options_.up);
    const double angle =
        std::acos(std::clamp(up.dot(estimate.up_in_world), -1.0, 1.0));
    constexpr double kDoubtful = 0.35;
    if (estimate.sound && angle > kDoubtful) {
      Note("the cameras stand level about a direction " +
           Format("%.0f degrees", Degrees(angle)) +
           " from the given up axis: check --up");
    }
    return up;
  }
  if (!estimate.sound) {
    throw InputError(options_.source.string() +
                     ": the cameras do not tell which way is up (they look the "
                     "same way or stand on their sides): give --up");
  }
  Eigen::Vector3d up = estimate.up_in_world;
  if (calibration_.axes_are_chosen) {
    // People put the world's axes along the room: take the nearest.
    constexpr double kNear = 0.17;
    int axis = 0;
    up.cwiseAbs().maxCoeff(&axis);
    Eigen::Vector3d nearest = Eigen::Vector3d::Zero();
    nearest[axis] = up[axis] > 0 ? 1 : -1;
    if (std::acos(std::min(1.0, nearest.dot(up))) < kNear) up = nearest;
  }
  char text[120];
  std::snprintf(text,
                sizeof(text),
                "up is %.3f,%.3f,%.3f, estimated from cameras that are level "
                "within %.1f degrees; --up says it otherwise",
                up.x(),
                up.y(),
                up.z(),
                Degrees(estimate.roll));
  Note(text);
  return up;
}

void Import::TurnUp() {
  report_.up_in_source = ChooseUp();
  const Eigen::Matrix3d ours_from_source = RotationToYUp(report_.up_in_source);
  for (CaptureCamera& entry : report_.capture.cameras) {
    entry.camera.camera_from_world *= ours_from_source.transpose();
  }
}

void Import::Scale(double metres_per_unit) {
  report_.metres_per_unit = metres_per_unit;
  for (CaptureCamera& entry : report_.capture.cameras) {
    entry.camera.world_in_camera *= metres_per_unit;
  }
}

void Import::ChooseScale() {
  if (options_.stature > 0) {
    MeasureScale();
  } else if (options_.scale > 0) {
    Scale(options_.scale);
  } else if (calibration_.metres_per_unit) {
    Scale(*calibration_.metres_per_unit);
  } else if (calibration_.axes_are_chosen) {
    Note(
        "the calibration's length unit is taken to be the metre; --scale or "
        "--stature says it otherwise");
    Scale(1);
  } else {
    throw InputError(options_.source.string() + ": format " + options_.format +
                     " has no metric scale: give --scale (metres per unit) or "
                     "--stature (how tall the person stands, metres)");
  }
}

// The hull of the first pose stands as tall as the person. The floor goes to y
// = 0 below the person, because a world without scale has no origin either.
void Import::MeasureScale() {
  Stage("measuring the person");
  const Capture& capture = report_.capture;
  std::vector<std::string> ids;
  for (const CaptureCamera& entry : capture.cameras) {
    ids.push_back(entry.camera.id);
  }
  StageSummary summary;
  const std::vector<View> views = Segment(capture,
                                          capture.poses.front(),
                                          ids,
                                          SegmentOptions(),
                                          progress_,
                                          &summary);
  const PersonHeight person = MeasurePersonHeight(views);
  if (!calibration_.axes_are_chosen) {
    const Eigen::Vector3d feet(
        person.center_xz.x(), person.floor, person.center_xz.y());
    for (CaptureCamera& entry : report_.capture.cameras) {
      entry.camera.world_in_camera += entry.camera.camera_from_world * feet;
    }
  }
  Scale(options_.stature / person.height);
  Note("one unit of the calibration is " +
       Format("%.6g m", report_.metres_per_unit) + ", from the stature");
}

// Decodes every picture that was taken, so that a wrong size is found now and
// named as the user knows it.
void Import::CheckPictures() {
  Stage("checking the pictures");
  Capture sources = report_.capture;
  sources.folder.clear();
  const auto source = [&](const std::string& path) {
    const auto it = source_of_.find(path);
    return it != source_of_.end() ? it->second : (folder_ / path).string();
  };
  for (const CaptureCamera& entry : sources.cameras) {
    const Camera& camera = entry.camera;
    for (const std::string& plate : entry.background) {
      LoadPicture(sources, source(plate), camera);
    }
    for (const CapturePose& pose : sources.poses) {
      const auto image = pose.images.find(camera.id);
      if (image != pose.images.end()) {
        LoadPicture(sources, source(image->second), camera);
      }
      const auto mask = pose.masks.find(camera.id);
      if (mask != pose.masks.end()) {
        LoadMask(sources, source(mask->second), camera);
      }
    }
  }
}

void Import::WriteMarker() const {
  const Eigen::Vector3d& up = report_.up_in_source;
  const nlohmann::ordered_json json = {
      {"format", options_.format},
      {"source", options_.source.filename().string()},
      {"metres_per_unit", report_.metres_per_unit},
      {"up", {up.x(), up.y(), up.z()}},
      {"notes", report_.notes}};
  WriteWholeFile(json.dump(1) + "\n", (folder_ / kMarker).string());
}

ImportReport Import::Run() {
  calibration_ = ReadCalibration(options_.format, options_.source);
  const Pictures pictures = Find();
  Stage("taking the pictures");
  AddPictures(pictures);
  ReadMissingSizes();
  CheckPictures();
  TurnUp();
  ChooseScale();
  SaveCapture(report_.capture);
  WriteMarker();
  LoadCapture(folder_);  // what was written can be read
  return std::move(report_);
}

}  // namespace

std::optional<std::string> ImportOptions::Check() const {
  if (!(scale >= 0)) return "--scale must be positive";
  if (scale > 0 && stature > 0) {
    return "--scale and --stature exclude each other";
  }
  if (stature != 0 && !(stature >= 0.5 && stature <= 2.5)) {
    return "--stature must be 0.5 to 2.5 metres";
  }
  if (!up.empty() && up != "cameras" && !ParseDirection(up)) {
    return "--up must be an axis (y, -z, ...), three numbers 0,-1,0 or cameras";
  }
  if (!chroma_key.empty() && chroma_key != "green" && chroma_key != "blue") {
    return "--chroma-key must be green or blue";
  }
  if (poses.size() > 1 && images.find("{pose}") == std::string::npos) {
    return "several poses need {pose} in --images";
  }
  if (stature > 0 && background.empty() && masks.empty() &&
      chroma_key.empty()) {
    return "--stature needs --background, --chroma-key or --masks to find the "
           "person in the pictures";
  }
  return std::nullopt;
}

ImportReport ImportToFolder(const ImportOptions& options,
                            const fs::path& folder,
                            Progress* progress) {
  if (const auto error = options.Check()) throw InputError("import: " + *error);
  OutputFolder output(folder, kMarker);
  Import import(options, output.temporary(), progress);
  ImportReport report = import.Run();
  output.Commit();
  report.capture.folder = folder;
  return report;
}

}  // namespace sweepfit
