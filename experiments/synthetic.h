// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "capture/capture.h"
#include "model/progress.h"

namespace sweepfit {

struct SyntheticOptions {
  unsigned seed = 1;     // the person: shape, colours, exact posture
  int num_cameras = 16;  // on a ring, alternately high and low; with 16
                         // or more every odd one is holdout
  int width = 800;
  int height = 800;
  std::vector<std::string> poses = {"A"};  // A, T, N
  double yaw_degrees = 10;  // turn of the person about the vertical
  // Where the person stands, metres; the cameras and the room go along.
  double shift_x = 0, shift_z = 0;
  double noise = 2;  // grey levels of sensor noise
  // true: a background plate per camera; false: given masks instead.
  bool background = true;
  std::optional<std::string> Check() const;
};
nlohmann::ordered_json SyntheticOptionsToJson(const SyntheticOptions& options);

// Writes a capture folder with pictures, plates and ground truth (joints,
// surface, masks) of a person that the template does not know: a smooth union
// of tapered limbs with seeded proportions and bumps, meshed from a level set
// and drawn by a z-buffer of its own, so that nothing the fit uses also made
// the data. InputError when an option is out of range or a file cannot be
// written. The same options give the same bytes with any number of threads.
Capture WriteSyntheticCapture(const std::filesystem::path& folder,
                              const SyntheticOptions& options,
                              Progress* progress);

}  // namespace sweepfit
