// SPDX-License-Identifier: Apache-2.0
//
// Calib.toml of Pose2Sim (Pose2Sim/calibration.py): one table per camera with
// name, size, matrix, distortions, rotation (axis-angle), translation (metres);
// the world has z up.
#include <toml++/toml.h>

#include <array>
#include <string_view>

#include "capture/import_camera.h"
#include "capture/import_format.h"
#include "model/file_io.h"
#include "model/rigid_motion.h"

namespace sweepfit {
namespace {

// Tables that are no cameras.
constexpr std::array<std::string_view, 4> kOtherTables = {
    "metadata", "capture_volume", "charuco", "checkerboard"};

class Reader {
 public:
  explicit Reader(std::filesystem::path file) : file_(std::move(file)) {}

  std::string Where(const toml::node& node, const std::string& camera) const {
    return file_.string() + ":" + std::to_string(node.source().begin.line) +
           ": camera " + camera;
  }
  const toml::node& Get(const toml::table& table,
                        const std::string& camera,
                        const char* key) const {
    const toml::node* node = table.get(key);
    if (node == nullptr) {
      FailImport(Where(table, camera), std::string("no '") + key + "'");
    }
    return *node;
  }
  // Numbers of a list, of lists of lists row by row.
  std::vector<double> Numbers(const toml::table& table,
                              const std::string& camera,
                              const char* key) const {
    const toml::node& node = Get(table, camera, key);
    std::vector<double> values;
    Append(node, camera, key, 0, &values);
    return values;
  }
  std::vector<double> Numbers(const toml::table& table,
                              const std::string& camera,
                              const char* key,
                              size_t count) const {
    std::vector<double> values = Numbers(table, camera, key);
    if (values.size() != count) {
      FailImport(Where(Get(table, camera, key), camera),
                 std::string("'") + key + "' must have " +
                     std::to_string(count) + " numbers, not " +
                     std::to_string(values.size()));
    }
    return values;
  }

 private:
  void Append(const toml::node& node,
              const std::string& camera,
              const char* key,
              int depth,
              std::vector<double>* values) const {
    const toml::array* list = node.as_array();
    if (list != nullptr && depth < 2) {
      for (const toml::node& item : *list) {
        Append(item, camera, key, depth + 1, values);
      }
      return;
    }
    const auto number = node.value<double>();
    if (!node.is_number() || !number || depth == 0) {
      FailImport(Where(node, camera),
                 std::string("'") + key + "' must hold numbers only");
    }
    values->push_back(*number);
  }

  std::filesystem::path file_;
};

ImportedCamera ReadCamera(const Reader& reader,
                          const toml::table& table,
                          const std::string& section) {
  ImportedCamera result;
  Camera& camera = result.camera;
  camera.id = section;
  if (const toml::node* name = table.get("name")) {
    const auto text = name->value<std::string>();
    if (!text || text->empty()) {
      FailImport(reader.Where(*name, section), "'name' must be a text");
    }
    camera.id = *text;
  }
  const std::string& id = camera.id;
  const auto where = [&](const char* key) {
    return reader.Where(reader.Get(table, id, key), id);
  };
  if (const toml::node* fisheye = table.get("fisheye")) {
    if (fisheye->value_or(true)) {
      FailImport(where("fisheye"),
                 "a fisheye cannot be expressed: undistort the pictures");
    }
  }
  const auto size = reader.Numbers(table, id, "size", 2);
  SetSize(size[0], size[1], where("size"), &camera);
  const auto K = reader.Numbers(table, id, "matrix", 9);
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  SetIntrinsics(Eigen::Map<const RowMajor>(K.data()), where("matrix"), &camera);
  SetDistortion(
      reader.Numbers(table, id, "distortions"), where("distortions"), &camera);
  const auto rotation = reader.Numbers(table, id, "rotation", 3);
  const auto translation = reader.Numbers(table, id, "translation", 3);
  SetPose(RotationOf(Eigen::Map<const Eigen::Vector3d>(rotation.data())),
          Eigen::Map<const Eigen::Vector3d>(translation.data()),
          where("rotation"),
          &camera);
  return result;
}

}  // namespace

ImportedCalibration ReadPose2Sim(const std::filesystem::path& source) {
  const Reader reader(source);
  toml::table root;
  try {
    root = toml::parse(ReadWholeFile(source.string()));
  } catch (const toml::parse_error& error) {
    FailImport(
        source.string() + ":" + std::to_string(error.source().begin.line),
        std::string(error.description()));
  }
  ImportedCalibration calibration;
  calibration.metres_per_unit = 1;
  calibration.up = "z";
  calibration.axes_are_chosen = true;
  calibration.folder = source.parent_path();
  // Tables are sorted by key in memory; cameras stay in the file's order.
  std::vector<std::pair<unsigned, ImportedCamera>> cameras;
  for (const auto& [key, node] : root) {
    const toml::table* table = node.as_table();
    const auto is_key = [&k = key](std::string_view other) {
      return k.str() == other;
    };
    if (std::any_of(kOtherTables.begin(), kOtherTables.end(), is_key)) continue;
    if (table == nullptr) {
      FailImport(
          source.string() + ":" + std::to_string(node.source().begin.line),
          "'" + std::string(key.str()) + "' is no table of a camera");
    }
    cameras.emplace_back(table->source().begin.line,
                         ReadCamera(reader, *table, std::string(key.str())));
  }
  std::stable_sort(
      cameras.begin(), cameras.end(), [](const auto& a, const auto& b) {
        return a.first < b.first;
      });
  for (auto& [line, camera] : cameras) {
    calibration.cameras.push_back(std::move(camera));
  }
  return calibration;
}

}  // namespace sweepfit
