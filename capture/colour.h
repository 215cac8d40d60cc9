// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>

namespace sweepfit {

// Linear light 0..1 of every sRGB code.
const std::array<float, 256>& LinearOfCode();

// Linear light (sRGB decoded, times `gain` per channel in sRGB code values and
// clipped as a camera would), BGR 0..1.
cv::Mat3f ToLinear(const cv::Mat3b& picture, const cv::Vec3d& gain = {1, 1, 1});

// A blur against pixel noise (Gaussian, 0.7 px).
cv::Mat3f Smooth(const cv::Mat3f& linear);

// CIELAB of linear light.
cv::Mat3f ToLab(const cv::Mat3f& linear);
inline cv::Mat3f ToSmoothLab(const cv::Mat3f& linear) {
  return ToLab(Smooth(linear));
}

// CIELAB of a picture in sRGB.
cv::Mat3f PictureToLab(const cv::Mat3b& picture);

// The colour by which linear light changes from `from` to `to` when only the
// light on a surface changes: L + 16, a and b scale alike. Returns that factor
// and what is left, L, a, b units.
struct LightChange {
  float factor;  // of L + 16: the cube root of the light's
  float da, db;  // left once the factor is applied
};
inline LightChange ExplainByLight(const cv::Vec3f& to, const cv::Vec3f& from) {
  const float factor = (to[0] + 16) / (from[0] + 16);
  return {factor, to[1] - factor * from[1], to[2] - factor * from[2]};
}

// ln(L + 16): exposure adds to it, a third of its own logarithm.
inline double LogLightness(double lightness) {
  return std::log(std::max(lightness, 0.0) + 16);
}

}  // namespace sweepfit
