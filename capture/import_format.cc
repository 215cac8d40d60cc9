// SPDX-License-Identifier: Apache-2.0
#include "capture/import_format.h"

#include <array>
#include <set>

#include "model/input_error.h"

namespace sweepfit {
namespace {

constexpr std::array<CalibrationFormat, 6> kFormats = {{
    {"colmap", "folder with cameras and images, .txt or .bin", &ReadColmap},
    {"opencv",
     "folder of cv::FileStorage files (.yml, .xml, .json), one per camera",
     &ReadOpenCv},
    {"easymocap", "folder with intri.yml and extri.yml", &ReadEasyMocap},
    {"pose2sim", "Calib.toml", &ReadPose2Sim},
    {"middlebury", "NAME_par.txt", &ReadMiddlebury},
    {"nerfstudio",
     "transforms.json (nerfstudio, instant-ngp)",
     &ReadNerfstudio},
}};

}  // namespace

std::span<const CalibrationFormat> CalibrationFormats() { return kFormats; }

ImportedCalibration ReadCalibration(const std::string& format,
                                    const std::filesystem::path& source) {
  const CalibrationFormat* found = nullptr;
  std::string names;
  for (const CalibrationFormat& candidate : kFormats) {
    if (candidate.name == format) found = &candidate;
    names += " " + std::string(candidate.name);
  }
  if (found == nullptr) {
    throw InputError("no calibration format '" + format +
                     "'; there are:" + names);
  }
  std::error_code error;
  if (!std::filesystem::exists(source, error)) {
    throw InputError(source.string() + ": no such file or folder");
  }
  const ImportedCalibration calibration = found->read(source);
  if (calibration.cameras.size() < 2) {
    throw InputError(source.string() + ": holds " +
                     std::to_string(calibration.cameras.size()) +
                     " camera(s), at least two are needed");
  }
  std::set<std::string> ids;
  for (const ImportedCamera& camera : calibration.cameras) {
    if (!ids.insert(camera.camera.id).second) {
      throw InputError(source.string() + ": two cameras are named " +
                       camera.camera.id);
    }
  }
  return calibration;
}

}  // namespace sweepfit
