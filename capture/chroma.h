// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "capture/plate.h"

namespace sweepfit {

// Chroma key. The screen's hue and chroma are the medians of the pixels along
// the picture's frame whose hue is that of the key ("green" or "blue"). A
// pixel's distance to the screen grows with its hue angle and with missing
// chroma: D^2 = threshold_high at 35 degrees or 0 chroma, 0 within 20 degrees
// and above half of what the screen has at this lightness. The background
// behind the person is filled in from the screen around.
BackgroundDifference ChromaDifference(const cv::Mat3b& picture,
                                      const std::string& key,
                                      const SegmentOptions& options);

}  // namespace sweepfit
