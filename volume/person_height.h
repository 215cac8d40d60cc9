// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "capture/silhouette.h"

namespace sweepfit {

struct PersonHeight {
  double height = 0;                    // of the visual hull above the floor
  double width = 0;                     // the longer side of its box
  double floor = 0;                     // y (FindFloor)
  Eigen::Vector2d center_xz{0.0, 0.0};  // middle of its box
};

// How tall the person stands, in the length unit of the cameras, which need not
// be metres: from the floor to the top of the hull of the silhouettes, along y
// (up). It includes hair and shoes and is a few millimetres long where no
// camera looks along the crown. FitError when the silhouettes have no common
// part.
PersonHeight MeasurePersonHeight(std::vector<View> views);

}  // namespace sweepfit
