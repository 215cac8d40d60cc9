// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

#include "capture/silhouette.h"

namespace sweepfit {

// How unlike the background every pixel of a picture is.
struct BackgroundDifference {
  // Squared Mahalanobis distance to the background, shadows and highlights
  // explained; comparable with SegmentOptions::threshold_*.
  cv::Mat1f squared;
  // The same for pixels near the feet, where shadows are darker and their
  // edges steeper than an outline may be elsewhere.
  cv::Mat1f squared_at_feet;
  // The same with nothing explained away.
  cv::Mat1f squared_unexplained;
  // What the picture would show without the person, linear light, BGR 0..1.
  cv::Mat3f background_linear;
  // Typical difference of the background to itself in units of the assumed
  // noise; far above 1 when the plate does not belong to the picture.
  double noise_ratio = 0;
};

// Linear light (sRGB decoded), BGR 0..1.
cv::Mat3f ToLinear(const cv::Mat3b& picture);

// Factors by which a picture is brighter than the plate, per channel (BGR), in
// sRGB code values, from the pixels that agree best (at least half must show
// the background).
cv::Vec3d ExposureGain(const cv::Mat3b& picture, const cv::Mat3b& plate);

// Plate subtraction in CIELAB with
//   D^2 = w (dL / sigma_L)^2 + (da / sigma_ab)^2 + (db / sigma_ab)^2
// after the exposure is matched. A shadow scales the linear colour by s, so L +
// 16, a and b by s^(1/3): what differs from the plate by such a factor alone
// without an outline is background.
BackgroundDifference PlateDifference(const cv::Mat3b& picture,
                                     const cv::Mat3b& plate,
                                     const SegmentOptions& options);

}  // namespace sweepfit
