// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "capture/background.h"
#include "capture/silhouette.h"

namespace sweepfit {

// What a camera sees when nobody is there.
struct PlateModel {
  cv::Mat3b picture;  // sRGB; of several frames the middle, pixel by pixel
  // Variance from frame to frame of L and of (a + b) / 2, CIELAB units squared,
  // of the pixels around; empty when there is only one frame.
  cv::Mat2f variance;

  PlateModel operator()(const cv::Rect& part) const;
};

// From one or more frames of one size. Their exposures are matched to the
// first; what passes through a minority of three or more frames is left out.
PlateModel BuildPlateModel(const std::vector<cv::Mat3b>& frames);

// Factors by which a picture is brighter than the plate, per channel (BGR), in
// sRGB code values, from the pixels that agree best (at least half must show
// the background).
cv::Vec3d ExposureGain(const cv::Mat3b& picture, const cv::Mat3b& plate);

// Noise of the difference of picture and plate, CIELAB units.
struct PlateNoise {
  float sigma_l = 1;
  float sigma_ab = 1;
};
// 1.4826 median |difference| over the pixels (non-zero) that show the
// background, but not less than the options say.
PlateNoise MeasurePlateNoise(const cv::Mat3f& change,
                             const cv::Mat1b& is_background,
                             const SegmentOptions& options);

// Plate subtraction in CIELAB. The background is seen as it is,
//   D^2 = w (dL / sigma_L)^2 + (da / sigma_ab)^2 + (db / sigma_ab)^2,
// or in other light: a shadow scales linear colour by s, so L + 16, a and b by
// s^(1/3); the remaining colour is normal with a sigma that grows with the
// change (light that the person reflects has the person's colour), ln s has an
// exponential prior of scale options.shadow_depth, and changes softly from
// pixel to pixel, whereas a garment that is a darker shade of the wall has
// outlines and folds. `is_background` (non-zero) marks pixels that are certain
// to show it; noise is measured there. `at_feet`, 0..1 per row: how near to
// where the person may touch the floor; shadows there are likelier, darker and
// sharper.
BackgroundEvidence PlateEvidence(const cv::Mat3f& picture_linear,
                                 const PlateModel& plate,
                                 const cv::Vec3d& gain,
                                 const cv::Mat1b& is_background,
                                 const std::vector<float>& at_feet,
                                 const SegmentOptions& options);

}  // namespace sweepfit
