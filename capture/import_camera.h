// SPDX-License-Identifier: Apache-2.0
//
// What the readers of foreign calibrations share. `where` opens every message:
// the file, the line and the camera.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "capture/camera.h"

namespace sweepfit {

[[noreturn]] void FailImport(const std::string& where, const std::string& what);

// K without skew from a full matrix, row by row. Its last number scales it.
void SetIntrinsics(const Eigen::Matrix3d& K,
                   const std::string& where,
                   Camera* camera);

// OpenCV's k1 k2 p1 p2 [k3 [k4 k5 k6 ...]]: what lies beyond k3 must be zero.
void SetDistortion(const std::vector<double>& k,
                   const std::string& where,
                   Camera* camera);

// x_camera = R x_world + t. R may deviate from a rotation by 1e-3, as rounded
// text does, and is then replaced by the nearest one.
void SetPose(const Eigen::Matrix3d& R,
             const Eigen::Vector3d& t,
             const std::string& where,
             Camera* camera);

// The picture's size; 16 to 32768 pixels a side.
void SetSize(double width,
             double height,
             const std::string& where,
             Camera* camera);

// A finite number that is the whole of the text.
bool ParseDouble(const std::string& text, double* value);

}  // namespace sweepfit
