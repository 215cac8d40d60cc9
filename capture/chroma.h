// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "capture/background.h"
#include "capture/silhouette.h"

namespace sweepfit {

// The screen of a chroma key as a picture shows it.
struct KeyScreen {
  bool found = false;
  cv::Vec3f lab;            // its typical colour
  double border_share = 0;  // of the picture's border that it fills
};

// Looks for the screen along the border of a picture, which the person seldom
// fills. `key` is green, blue or auto: the saturated hue that most of the
// border has.
KeyScreen FindKeyScreen(const cv::Mat3b& picture, const std::string& key);

// The BGR channel in which it shines: 0 blue, 1 green; none for other hues.
std::optional<int> KeyChannel(const KeyScreen& screen);

// The screen's colour everywhere, also behind the person, from what is seen of
// it around. Works on the whole (small) picture; linear light.
cv::Mat3f FillScreen(const cv::Mat3b& picture, const KeyScreen& screen);

// Key subtraction: what lost three tenths of the screen's chroma in its own
// light, or has as much of another hue, is not the screen. Needs no plate;
// shadows on the screen are explained; spill keeps less of it. `screen_linear`
// is the screen's colour at every pixel, linear light; `at_feet` as for
// PlateEvidence.
BackgroundEvidence ChromaEvidence(const cv::Mat3f& picture_linear,
                                  const cv::Mat3f& screen_linear,
                                  const std::vector<float>& at_feet,
                                  const SegmentOptions& options);

}  // namespace sweepfit
