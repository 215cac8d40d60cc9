// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

namespace sweepfit {

// ln of a density that is even over all colours, per CIELAB unit cubed: what
// can be said of the colour of a person nobody has seen.
inline constexpr float kLogEvenDensity = -13.8f;  // 1 / 100^3

// How well the background explains every pixel of a (part of a) picture.
struct BackgroundEvidence {
  // ln of the density of the pixel's colour, per CIELAB unit cubed, if the
  // background is seen there, in whatever light.
  cv::Mat1f log_density;
  // The picture, CIELAB, and what it differs by from the background in the
  // plate's light.
  cv::Mat3f lab;
  cv::Mat3f change;
  // What the picture would show without the person, linear light, BGR 0..1.
  cv::Mat3f background_linear;
  // Noise of a pixel's lightness, L units.
  float sigma_l = 1;
};

}  // namespace sweepfit
