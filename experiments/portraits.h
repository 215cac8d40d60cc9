// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "model/body.h"

namespace sweepfit {

struct Portrait {
  std::string name;
  cv::Mat3b picture;
};

// Pictures of a body at rest by which its shape can be judged: the whole from
// all sides, and head, hand, foot, arm pit, crotch and knee from near. Grey,
// darker where the surface sees less of its surroundings. `height` is that of
// the pictures of the whole, in pixels; close-ups are squares of two thirds of
// it.
std::vector<Portrait> DrawPortraits(const Body& body, int height);

// Portraits side by side, `per_row` in a row, on white.
cv::Mat3b DrawPortraitSheet(const std::vector<Portrait>& portraits,
                            int per_row);

}  // namespace sweepfit
