// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "capture/camera.h"

namespace sweepfit {

// A camera as a foreign calibration describes it, already in our conventions:
// world to camera, x right, y down, z forward, pixel centres at integers.
struct ImportedCamera {
  Camera camera;      // id: the file's name for it; size 0 x 0 when not stated
  std::string image;  // picture that the file names, relative to its folder
  std::string mask;   // the same for a silhouette
};

struct ImportedCalibration {
  std::vector<ImportedCamera> cameras;
  // Length unit of the world, metres, where the format says so.
  std::optional<double> metres_per_unit;
  // The world axis that the format says points up: "y", "z", ... or "".
  std::string up;
  // True when people choose the world's axes (a board on the floor, say), false
  // when a reconstruction leaves them as they come.
  bool axes_are_chosen = false;
  // Pictures are looked for here.
  std::filesystem::path folder;
};

// A calibration format of another program: one reader in one file,
// import_<name>.cc. `source` is a file or a folder, as `meaning` says. All
// throw InputError naming the file and the line, byte, key or camera.
struct CalibrationFormat {
  std::string_view name;
  std::string_view meaning;
  ImportedCalibration (*read)(const std::filesystem::path& source);
};

std::span<const CalibrationFormat> CalibrationFormats();

// Reads with the format of this name and checks what all have in common: two
// cameras or more, names used once. InputError lists the names of the formats
// when there is none of this name.
ImportedCalibration ReadCalibration(const std::string& format,
                                    const std::filesystem::path& source);

// The readers. Distortion models that our camera cannot express (fisheye,
// rational, skew) are errors that ask for undistorted pictures.
//
// Folder with cameras.txt and images.txt or cameras.bin and images.bin (which
// COLMAP itself prefers). Every registered image is a camera, named after its
// file. The top left pixel is centred at 0.5 there: c - 0.5.
ImportedCalibration ReadColmap(const std::filesystem::path& source);
// Files of cv::FileStorage, one per camera in a folder, named after it.
ImportedCalibration ReadOpenCv(const std::filesystem::path& source);
// Folder with intri.yml and extri.yml.
ImportedCalibration ReadEasyMocap(const std::filesystem::path& source);
// Calib.toml.
ImportedCalibration ReadPose2Sim(const std::filesystem::path& source);
// *_par.txt of Middlebury's multi-view data sets.
ImportedCalibration ReadMiddlebury(const std::filesystem::path& source);
// transforms.json of nerfstudio and instant-ngp: camera to world, x right, y
// up, z back, the top left pixel centred at 0.5.
ImportedCalibration ReadNerfstudio(const std::filesystem::path& source);

}  // namespace sweepfit
