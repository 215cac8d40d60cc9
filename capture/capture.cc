// SPDX-License-Identifier: Apache-2.0
#include "capture/capture.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <system_error>

#include "model/input_error.h"

namespace sweepfit {
namespace {

// The shortest text that reads back as the same number.
std::string ExactText(double value) {
  std::array<char, 32> text;
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

template <typename Range>
void EmitNumbers(const char* key, const Range& values, YAML::Emitter* out) {
  *out << YAML::Key << key << YAML::Value << YAML::Flow << YAML::BeginSeq;
  for (const double value : values) *out << ExactText(value);
  *out << YAML::EndSeq;
}

void EmitMatrix(const char* key,
                const Eigen::Matrix3d& matrix,
                YAML::Emitter* out) {
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const RowMajor rows = matrix;
  EmitNumbers(key, rows.reshaped<Eigen::RowMajor>(), out);
}

void EmitCamera(const CaptureCamera& entry, YAML::Emitter* out) {
  const Camera& camera = entry.camera;
  *out << YAML::BeginMap;
  *out << YAML::Key << "id" << YAML::Value << camera.id;
  *out << YAML::Key << "width" << YAML::Value << camera.width;
  *out << YAML::Key << "height" << YAML::Value << camera.height;
  EmitMatrix("K", camera.K, out);
  if (camera.HasDistortion()) {
    EmitNumbers("distortion", camera.distortion, out);
  }
  EmitMatrix("R", camera.camera_from_world, out);
  EmitNumbers("t", camera.world_in_camera, out);
  if (entry.background.size() == 1) {
    *out << YAML::Key << "background" << YAML::Value << entry.background[0];
  } else if (!entry.background.empty()) {
    *out << YAML::Key << "background" << YAML::Value << YAML::Flow
         << entry.background;
  }
  if (entry.chroma_key) {
    *out << YAML::Key << "chroma_key" << YAML::Value << *entry.chroma_key;
  }
  *out << YAML::EndMap;
}

void EmitPose(const CapturePose& pose, YAML::Emitter* out) {
  *out << YAML::BeginMap;
  *out << YAML::Key << "name" << YAML::Value << pose.name;
  *out << YAML::Key << "images" << YAML::Value << pose.images;
  if (!pose.masks.empty()) {
    *out << YAML::Key << "masks" << YAML::Value << pose.masks;
  }
  *out << YAML::EndMap;
}

}  // namespace

const CaptureCamera& Capture::FindCamera(const std::string& id) const {
  const auto found =
      std::find_if(cameras.begin(), cameras.end(), [&](const auto& c) {
        return c.camera.id == id;
      });
  if (found != cameras.end()) return *found;
  std::string known;
  for (const CaptureCamera& c : cameras) known += " " + c.camera.id;
  throw InputError((folder / "capture.yaml").string() + ": no camera '" + id +
                   "'; there are:" + known);
}

const CapturePose& Capture::FindPose(const std::string& name) const {
  const auto found =
      std::find_if(poses.begin(), poses.end(), [&](const auto& p) {
        return p.name == name;
      });
  if (found != poses.end()) return *found;
  std::string known;
  for (const CapturePose& p : poses) known += " " + p.name;
  throw InputError((folder / "capture.yaml").string() + ": no pose '" + name +
                   "'; there are:" + known);
}

bool Capture::IsHoldout(const std::string& id) const {
  return std::find(holdout.begin(), holdout.end(), id) != holdout.end();
}

void SaveCapture(const Capture& capture) {
  YAML::Emitter out;
  out << YAML::BeginMap;
  out << YAML::Key << "version" << YAML::Value << 1;
  out << YAML::Key << "units" << YAML::Value << "m";
  out << YAML::Key << "up" << YAML::Value << "y";
  out << YAML::Key << "cameras" << YAML::Value << YAML::BeginSeq;
  for (const CaptureCamera& camera : capture.cameras) EmitCamera(camera, &out);
  out << YAML::EndSeq;
  if (!capture.holdout.empty()) {
    out << YAML::Key << "holdout" << YAML::Value << YAML::Flow
        << capture.holdout;
  }
  out << YAML::Key << "poses" << YAML::Value << YAML::BeginSeq;
  for (const CapturePose& pose : capture.poses) EmitPose(pose, &out);
  out << YAML::EndSeq << YAML::EndMap;

  // Under a temporary name first: a run that dies leaves no half file.
  const std::filesystem::path path = capture.folder / "capture.yaml";
  const std::filesystem::path partial = capture.folder / "capture.yaml.partial";
  std::ofstream file(partial, std::ios::binary);
  file << out.c_str() << '\n';
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(partial, path, error);
  if (!file || error) {
    std::filesystem::remove(partial, error);
    throw InputError(path.string() + ": cannot be written");
  }
}

}  // namespace sweepfit
