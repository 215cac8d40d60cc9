// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "capture/render.h"

namespace sweepfit {

// How far it is from every vertex against its normal through the body to its
// other side, metres; kMostThickness where nothing comes earlier.
inline constexpr double kMostThickness = 0.3;
std::vector<double> SurfaceThickness(
    const RayScene& scene,
    const std::vector<Eigen::Vector3d>& vertices,
    const std::vector<Eigen::Vector3d>& unit_normals);

}  // namespace sweepfit
