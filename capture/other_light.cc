// SPDX-License-Identifier: Apache-2.0
#include "capture/other_light.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace sweepfit {
namespace {

cv::Mat Square(int radius) {
  return cv::getStructuringElement(cv::MORPH_RECT,
                                   {2 * radius + 1, 2 * radius + 1});
}

}  // namespace

OtherLight ExpectedLight(float at_feet) {
  constexpr OtherLight kInAir = {-6, 0.03f, 0.07f};
  constexpr OtherLight kOnFloor = {-4, 0.03f, 0.07f};
  constexpr OtherLight kAtFeet = {-3, 0.06f, 0.25f};
  const bool is_floor = at_feet > 0.5f;
  const OtherLight& a = is_floor ? kOnFloor : kInAir;
  const OtherLight& b = is_floor ? kAtFeet : kOnFloor;
  const float t = is_floor ? 2 * at_feet - 1 : 2 * at_feet;
  return {a.log_probability + t * (b.log_probability - a.log_probability),
          a.reflected + t * (b.reflected - a.reflected),
          a.sharpest + t * (b.sharpest - a.sharpest)};
}

float LogDensityOfLight(float log_light,
                        float slope,
                        float sigma,
                        const OtherLight& light,
                        double depth) {
  constexpr float kMostForSlope = 5;
  // Light seldom comes; it goes where somebody stands in it.
  const float scale = static_cast<float>(log_light > 0 ? 0.5 * depth : depth);
  // The noise of a slope is about half that of a pixel.
  const float variance =
      0.5f * light.sharpest * light.sharpest + 0.25f * sigma * sigma;
  return light.log_probability - std::abs(log_light) / scale -
         std::log(2 * scale) -
         std::min(0.5f * slope * slope / variance, kMostForSlope);
}

cv::Mat1f Slope(const cv::Mat1f& image) {
  constexpr double kSobelScale = 0.125;
  cv::Mat1f dx, dy, slope;
  cv::Sobel(image, dx, CV_32F, 1, 0, 3, kSobelScale, 0, cv::BORDER_REPLICATE);
  cv::Sobel(image, dy, CV_32F, 0, 1, 3, kSobelScale, 0, cv::BORDER_REPLICATE);
  cv::magnitude(dx, dy, slope);
  return slope;
}

cv::Mat1b SoftlyLit(const cv::Mat1b& candidate,
                    const cv::Mat1b& plain,
                    const cv::Mat1f& slope,
                    const std::vector<float>& at_feet) {
  constexpr double kSmallestShare = 0.002;  // of the picture, plain pixels
  constexpr int kClosing = 3, kClosingAtFeet = 1;
  cv::Mat1b edge(slope.size()), wide, narrow;
  for (int y = 0; y < slope.rows; ++y) {
    const float sharpest = ExpectedLight(at_feet[y]).sharpest;
    for (int x = 0; x < slope.cols; ++x) {
      edge(y, x) = slope(y, x) > sharpest ? 255 : 0;
    }
  }
  cv::dilate(edge, wide, Square(kClosing));
  cv::dilate(edge, narrow, Square(kClosingAtFeet));
  cv::Mat1b passable(slope.size());
  for (int y = 0; y < slope.rows; ++y) {
    const cv::Mat1b& closed = at_feet[y] > 0.75f ? narrow : wide;
    for (int x = 0; x < slope.cols; ++x) {
      passable(y, x) =
          plain(y, x) || (candidate(y, x) && !closed(y, x)) ? 255 : 0;
    }
  }
  cv::Mat1i label;
  const int count = cv::connectedComponents(passable, label, 4, CV_32S);
  std::vector<int> plain_area(count, 0);
  for (int y = 0; y < label.rows; ++y) {
    for (int x = 0; x < label.cols; ++x) {
      if (plain(y, x)) ++plain_area[label(y, x)];
    }
  }
  const double smallest = kSmallestShare * static_cast<double>(label.total());
  cv::Mat1b reached(label.size());
  for (int y = 0; y < label.rows; ++y) {
    for (int x = 0; x < label.cols; ++x) {
      const int i = label(y, x);
      reached(y, x) = i > 0 && plain_area[i] > smallest ? 255 : 0;
    }
  }
  // Back, but not into the outline itself.
  cv::dilate(reached, reached, Square(1));
  return reached & candidate;
}

}  // namespace sweepfit
