// SPDX-License-Identifier: Apache-2.0
#include "capture/view_quality.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

namespace sweepfit {
namespace {

// 1 up to `good`, falling linearly to 0 at `bad`.
double Falling(double value, double good, double bad) {
  return std::clamp((bad - value) / (bad - good), 0.0, 1.0);
}

std::string Format(const char* format, double value) {
  char text[200];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

}  // namespace

ViewQuality JudgeView(const ViewEvidence& evidence) {
  ViewQuality quality;
  const auto judge = [&](double factor, const std::string& reason) {
    quality.value *= factor;
    if (factor < 0.9) quality.reasons.push_back(reason);
  };
  // A plate of another camera differs everywhere, by 4 and more in a furnished
  // room; sound ones stay near 1, with strong sensor noise near 3.
  judge(Falling(evidence.noise_ratio, 3.3, 4.3),
        Format("the background differs from its plate nearly everywhere (%.1f "
               "times the expected noise): is it the plate of this camera and "
               "this session?",
               evidence.noise_ratio));
  double gain = 0;
  for (int c = 0; c < 3; ++c) {
    gain = std::max(gain, std::abs(std::log(evidence.gain[c])));
  }
  judge(Falling(gain, 0.15, 1.2),
        Format("the exposure differs from the plate's by %.0f %%",
               100 * (std::exp(gain) - 1)));
  judge(Falling(evidence.plate_shift, 0.5, 12),
        Format("the camera moved by %.1f px between plate and picture",
               evidence.plate_shift));
  judge(Falling(1 - evidence.outline_contrast, 0.15, 1.1),
        Format("%.0f %% of the outline hardly differs from the background",
               100 * (1 - evidence.outline_contrast)));
  judge(Falling(evidence.stray, 0.1, 2),
        Format("other things changed too (%.0f %% of the person's area): "
               "flicker, moved furniture or a second person",
               100 * evidence.stray));
  judge(Falling(evidence.covered, 0.45, 0.65),
        "the silhouette covers most of the picture");
  judge(evidence.covered < 1e-4 ? 0 : 1, "nobody is seen in the picture");
  judge(Falling(evidence.on_frame, 0.05, 0.5),
        Format("the picture's frame cuts the person (%.0f %% of the frame)",
               100 * evidence.on_frame));
  return quality;
}

double OutlineContrast(const cv::Mat1b& mask,
                       const cv::Mat3f& change,
                       double sigma) {
  constexpr int kReach = 3;     // px
  constexpr double kClear = 4;  // sigma
  cv::Mat1f length(mask.size());
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      length(y, x) =
          mask(y, x) ? static_cast<float>(cv::norm(change(y, x))) : 0;
    }
  }
  cv::dilate(length,
             length,
             cv::getStructuringElement(cv::MORPH_RECT,
                                       {2 * kReach + 1, 2 * kReach + 1}));
  cv::Mat1b inner;
  cv::erode(mask, inner, cv::Mat(), {-1, -1}, 1, cv::BORDER_CONSTANT, 255);
  const cv::Mat1b outline = mask & ~inner;
  int clear = 0, all = 0;
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (!outline(y, x)) continue;
      ++all;
      clear += length(y, x) > kClear * sigma;
    }
  }
  return all > 0 ? static_cast<double>(clear) / all : 0;
}

}  // namespace sweepfit
