// SPDX-License-Identifier: Apache-2.0
#include "capture/colour.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace sweepfit {
namespace {

double Decode(double code) {
  const double v = std::clamp(code / 255, 0.0, 1.0);
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

}  // namespace

const std::array<float, 256>& LinearOfCode() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values;
    for (int code = 0; code < 256; ++code) {
      values[code] = static_cast<float>(Decode(code));
    }
    return values;
  }();
  return table;
}

cv::Mat3f ToLinear(const cv::Mat3b& picture, const cv::Vec3d& gain) {
  cv::Mat3f table(1, 256);
  for (int i = 0; i < 256; ++i) {
    for (int c = 0; c < 3; ++c) {
      table(0, i)[c] = static_cast<float>(Decode(gain[c] * i));
    }
  }
  cv::Mat3f linear;
  cv::LUT(picture, table, linear);
  return linear;
}

cv::Mat3f Smooth(const cv::Mat3f& linear) {
  constexpr double kBlur = 0.7;  // px
  cv::Mat3f smooth;
  cv::GaussianBlur(linear, smooth, {5, 5}, kBlur, kBlur, cv::BORDER_REPLICATE);
  return smooth;
}

cv::Mat3f PictureToLab(const cv::Mat3b& picture) {
  cv::Mat3f bgr;
  picture.convertTo(bgr, CV_32F, 1.0 / 255);
  cv::Mat3f lab;
  cv::cvtColor(bgr, lab, cv::COLOR_BGR2Lab);
  return lab;
}

cv::Mat3f ToLab(const cv::Mat3f& linear) {
  cv::Mat3f lab;
  cv::cvtColor(linear, lab, cv::COLOR_LBGR2Lab);
  return lab;
}

}  // namespace sweepfit
