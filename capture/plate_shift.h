// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

namespace sweepfit {

// How many pixels the background of a picture lies off that of its plate,
// because the camera moved in between: phase correlation, then Gauss-Newton on
// the pixels that agree. Translations up to about a twentieth of the picture.
// Zero where the plate has no edges.
cv::Point2d MeasurePlateShift(const cv::Mat3b& picture,
                              const cv::Mat3b& plate,
                              const cv::Vec3d& gain);

// The plate as seen after a shift; its border is repeated.
cv::Mat Shift(const cv::Mat& plate, const cv::Point2d& shift);

}  // namespace sweepfit
