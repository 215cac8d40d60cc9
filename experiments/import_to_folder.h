// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "capture/capture.h"
#include "model/progress.h"

namespace sweepfit {

struct ImportOptions {
  std::string format;  // one of CalibrationFormats()
  std::filesystem::path source;
  // Patterns (FindPictures). Empty images or masks: those that the calibration
  // names. masks "alpha": the pictures' alpha channel.
  std::string images;
  std::string background;
  std::string masks;
  std::string chroma_key;  // of every camera: "green", "blue" or ""
  // Names of the poses: where the pattern of the images has {pose} those to
  // take (empty: all), else the one name (empty: A).
  std::vector<std::string> poses;
  std::vector<std::string> holdout;
  // Metres per length unit of the calibration, or how tall the person stands,
  // metres, with hair and shoes; 0: not given, the format must know.
  double scale = 0;
  double stature = 0;
  // World axis that points away from the floor: y, z, x, -y, ..., three numbers
  // "0.1,-0.9,0", "cameras" (estimated, EstimateUp) or "" (what the format
  // says, else estimated).
  std::string up;
  bool link = false;  // symbolic links instead of copies
  std::optional<std::string> Check() const;
};

// What was made of a calibration.
struct ImportReport {
  Capture capture;
  double metres_per_unit = 1;
  Eigen::Vector3d up_in_source = Eigen::Vector3d::UnitY();
  std::vector<std::string> notes;  // what a person should know
};

// Makes a capture folder of a foreign calibration and pictures: metres, +y up,
// every picture decoded and its size checked. The folder appears whole or not
// at all and says in import.json how it was made. InputError names the file,
// camera or option; FitError when the stature cannot be measured.
ImportReport ImportToFolder(const ImportOptions& options,
                            const std::filesystem::path& folder,
                            Progress* progress);

}  // namespace sweepfit
