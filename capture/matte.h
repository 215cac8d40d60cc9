// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

namespace sweepfit {

// The share of every pixel that the person covers, from a yes-or-no mask
// (non-zero: person) that is right to a few pixels. Near the mask's boundary
// the colour is a mixture
//   I = alpha F + (1 - alpha) B        (linear light)
// of the person's colour F close by and the background B, which is the given
// one times the local change of illumination (shadows, spill) seen beside the
// person; where F and B cannot be told apart the mask decides.
cv::Mat1f BoundaryCoverage(const cv::Mat3f& picture_linear,
                           const cv::Mat3f& background_linear,
                           const cv::Mat1b& mask);

}  // namespace sweepfit
