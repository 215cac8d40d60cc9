// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace sweepfit {

// What a picture itself says about how far its silhouette can be trusted.
struct ViewEvidence {
  // Typical difference of the background to its plate, over the noise assumed.
  double noise_ratio = 1;
  cv::Vec3d gain = {1, 1, 1};  // exposure against the plate
  double plate_shift = 0;      // px that the plate had to be moved
  // Share of the outline where person and background differ clearly.
  double outline_contrast = 1;
  // Area outside the person that is no background either, over the person's.
  double stray = 0;
  // Share of the picture that is person, and of its frame.
  double covered = 0;
  double on_frame = 0;
};

// 1: nothing is wrong; 0: the silhouette cannot be that of a person. The
// product of a factor per figure; `reasons` name those that cost more than a
// tenth.
struct ViewQuality {
  double value = 1;
  std::vector<std::string> reasons;
};

ViewQuality JudgeView(const ViewEvidence& evidence);

// Share of the outline of a mask (non-zero: person) at which the picture
// differs by more than noise from the background within a few pixels inside.
// `change` is the CIELAB difference to the background, `sigma` its noise.
double OutlineContrast(const cv::Mat1b& mask,
                       const cv::Mat3f& change,
                       double sigma);

}  // namespace sweepfit
