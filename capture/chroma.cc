// SPDX-License-Identifier: Apache-2.0
#include "capture/chroma.h"

#include <glog/logging.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace sweepfit {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Lab of the screen.
struct Screen {
  bool found = false;
  float lightness = 0;
  float a = 0, b = 0;
};

float Median(std::vector<float> values) {
  const auto middle = values.begin() + static_cast<long>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Hue angles (Lab) of saturated sRGB green and blue.
double NominalHue(const std::string& key) {
  CHECK(key == "green" || key == "blue") << key;
  return (key == "green" ? 136.0 : -54.0) * kPi / 180;
}

Screen FindScreen(const cv::Mat3f& lab, const std::string& key) {
  constexpr double kHueReach = 45 * kPi / 180;
  constexpr double kMinChroma = 12;
  constexpr std::size_t kFewest = 50;
  const double hue = NominalHue(key);
  const int frame = std::max(2, std::min(lab.rows, lab.cols) / 40);
  std::vector<float> l, a, b;
  for (int y = 0; y < lab.rows; ++y) {
    const bool whole_row = y < frame || y >= lab.rows - frame;
    for (int x = 0; x < lab.cols; ++x) {
      if (!whole_row && x == frame) x = std::max(x, lab.cols - frame);
      const cv::Vec3f& p = lab(y, x);
      const double turned =
          std::remainder(std::atan2(p[2], p[1]) - hue, 2 * kPi);
      if (std::hypot(p[1], p[2]) < kMinChroma || std::abs(turned) > kHueReach) {
        continue;
      }
      l.push_back(p[0]);
      a.push_back(p[1]);
      b.push_back(p[2]);
    }
  }
  if (l.size() < kFewest) return {};
  return {
      true, Median(std::move(l)), Median(std::move(a)), Median(std::move(b))};
}

// The screen's colour behind the person, from the screen around it: weighted
// means over ever larger windows, each with a tiny weight beside the smaller.
cv::Mat3f FillBehind(const cv::Mat3f& picture,
                     const cv::Mat1f& squared,
                     double threshold) {
  constexpr int kShrink = 8;
  constexpr int kKeepOff = 5;  // px from anything that is not screen
  cv::Mat1b screen = squared < threshold;
  cv::erode(screen,
            screen,
            cv::getStructuringElement(cv::MORPH_RECT,
                                      {2 * kKeepOff + 1, 2 * kKeepOff + 1}));
  cv::Mat1f weight;
  screen.convertTo(weight, CV_32F, 1.0 / 255);
  cv::Mat3f weights;
  cv::merge(std::vector<cv::Mat1f>{weight, weight, weight}, weights);
  const cv::Size small(std::max(1, picture.cols / kShrink),
                       std::max(1, picture.rows / kShrink));
  cv::Mat3f sum, norm;
  cv::resize(picture.mul(weights), sum, small, 0, 0, cv::INTER_AREA);
  cv::resize(weights, norm, small, 0, 0, cv::INTER_AREA);
  cv::Mat3f all_sum = sum.clone(), all_norm = norm.clone();
  double falling = 1;
  for (int window = 3; window < 4 * std::max(small.width, small.height);
       window = 2 * window + 1) {
    cv::Mat3f wide_sum, wide_norm;
    cv::boxFilter(sum, wide_sum, CV_32F, {window, window});
    cv::boxFilter(norm, wide_norm, CV_32F, {window, window});
    falling *= 0.01;
    all_sum += falling * wide_sum;
    all_norm += falling * wide_norm;
  }
  cv::Mat3f filled;
  cv::resize(all_sum / (all_norm + cv::Scalar::all(1e-25)),
             filled,
             picture.size(),
             0,
             0,
             cv::INTER_LINEAR);
  return filled;
}

}  // namespace

BackgroundDifference ChromaDifference(const cv::Mat3b& picture,
                                      const std::string& key,
                                      const SegmentOptions& options) {
  constexpr double kBlur = 0.7;  // px
  constexpr float kHalf = 0.5f;  // lost or strange share of the chroma
  constexpr float kChromaNoise = 4;
  const cv::Mat3f linear = ToLinear(picture);
  cv::Mat3f lab;
  cv::GaussianBlur(linear, lab, {}, kBlur, kBlur, cv::BORDER_REPLICATE);
  cv::cvtColor(lab, lab, cv::COLOR_LBGR2Lab);
  const Screen screen = FindScreen(lab, key);

  BackgroundDifference result;
  result.squared =
      cv::Mat1f(picture.size(), static_cast<float>(4 * options.threshold_high));
  if (screen.found) {
    const float chroma = std::hypot(screen.a, screen.b);
    const float cos_hue = screen.a / chroma;
    const float sin_hue = screen.b / chroma;
    const float high = static_cast<float>(options.threshold_high);
    for (int y = 0; y < lab.rows; ++y) {
      for (int x = 0; x < lab.cols; ++x) {
        const cv::Vec3f& p = lab(y, x);
        // In more or less light the screen's a and b scale with L + 16.
        const float expected =
            chroma * (p[0] + 16) / (screen.lightness + 16) + kChromaNoise;
        const float along = p[1] * cos_hue + p[2] * sin_hue + kChromaNoise;
        const float across = p[2] * cos_hue - p[1] * sin_hue;
        const float lost = std::max(0.f, 1 - along / expected) / kHalf;
        const float strange = across / (kHalf * expected);
        result.squared(y, x) = high * (lost * lost + strange * strange);
      }
    }
  }
  result.squared_at_feet = result.squared;
  result.squared_unexplained = result.squared;
  result.background_linear =
      FillBehind(linear, result.squared, options.threshold_low);
  cv::Mat1f flat = result.squared.clone().reshape(1, 1);
  std::vector<float> values(flat.begin(), flat.end());
  result.noise_ratio = std::sqrt(Median(std::move(values)));
  return result;
}

}  // namespace sweepfit
