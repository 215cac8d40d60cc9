// SPDX-License-Identifier: Apache-2.0
#include "capture/import_camera.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "model/input_error.h"

namespace sweepfit {

void FailImport(const std::string& where, const std::string& what) {
  throw InputError(where + ": " + what);
}

void SetIntrinsics(const Eigen::Matrix3d& K,
                   const std::string& where,
                   Camera* camera) {
  if (!K.allFinite()) FailImport(where, "K holds a number that is not finite");
  if (K(2, 0) != 0 || K(2, 1) != 0 || !(K(2, 2) > 0)) {
    FailImport(where, "K must end with the row 0, 0, 1");
  }
  if (!(K(0, 0) > 0) || !(K(1, 1) > 0)) {
    FailImport(where, "the focal lengths must be positive");
  }
  // Less than what a picture of 30000 pixels would show.
  constexpr double kMaxSkew = 1e-12;
  if (std::abs(K(0, 1)) > kMaxSkew * K(0, 0) || K(1, 0) != 0) {
    FailImport(where,
               "K has skew, which cannot be expressed: undistort the pictures");
  }
  camera->K = K / K(2, 2);
  camera->K(0, 1) = 0;
}

void SetDistortion(const std::vector<double>& k,
                   const std::string& where,
                   Camera* camera) {
  constexpr size_t kMaxCount = 14;  // OpenCV's longest model
  if (k.size() > kMaxCount || (k.size() > 0 && k.size() < 4)) {
    FailImport(where,
               "distortion must have 4, 5, 8, 12 or 14 numbers, not " +
                   std::to_string(k.size()));
  }
  camera->distortion.fill(0);
  for (size_t i = 0; i < k.size(); ++i) {
    if (!std::isfinite(k[i])) {
      FailImport(where, "distortion holds a number that is not finite");
    }
    if (i < camera->distortion.size()) {
      camera->distortion[i] = k[i];
    } else if (k[i] != 0) {
      FailImport(where,
                 "distortion beyond k1 k2 p1 p2 k3 cannot be expressed: "
                 "undistort the pictures");
    }
  }
}

void SetPose(const Eigen::Matrix3d& R,
             const Eigen::Vector3d& t,
             const std::string& where,
             Camera* camera) {
  if (!R.allFinite() || !t.allFinite()) {
    FailImport(where, "the pose holds a number that is not finite");
  }
  camera->camera_from_world = R;
  if (const auto error = MakeRotation(&camera->camera_from_world)) {
    FailImport(where, "R " + *error);
  }
  camera->world_in_camera = t;
}

void SetSize(double width,
             double height,
             const std::string& where,
             Camera* camera) {
  for (const double side : {width, height}) {
    if (!(side >= 16 && side <= 32768) || side != std::floor(side)) {
      FailImport(where, "width and height must be 16 to 32768 pixels");
    }
  }
  camera->width = static_cast<int>(width);
  camera->height = static_cast<int>(height);
}

bool ParseDouble(const std::string& text, double* value) {
  // from_chars knows no leading plus.
  const char* first = text.data() + (text.starts_with('+') ? 1 : 0);
  const char* last = text.data() + text.size();
  const auto [end, error] = std::from_chars(first, last, *value);
  return error == std::errc() && end == last && std::isfinite(*value);
}

}  // namespace sweepfit
