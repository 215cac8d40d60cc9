// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "capture/silhouette.h"

namespace sweepfit {

struct PersonHeight {
  double height = 0;                    // of the visual hull, along y
  double floor = 0;                     // y of its lowest point
  Eigen::Vector2d center_xz{0.0, 0.0};  // middle of its box
};

// How tall the person stands, in the length unit of the cameras, which need not
// be metres: the extent along y (up) of the hull of the silhouettes. It
// includes hair and shoes and is a few millimetres long where no camera looks
// along the crown or the soles. FitError when the silhouettes have no common
// part.
PersonHeight MeasurePersonHeight(std::vector<View> views);

}  // namespace sweepfit
