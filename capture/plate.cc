// SPDX-License-Identifier: Apache-2.0
#include "capture/plate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace sweepfit {
namespace {

std::array<float, 256> LinearTable() {
  std::array<float, 256> table{};
  for (int i = 0; i < 256; ++i) {
    const double v = i / 255.0;
    table[i] = static_cast<float>(
        v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
  }
  return table;
}

cv::Mat3f ToLab(const cv::Mat3f& linear) {
  cv::Mat3f lab;
  cv::cvtColor(linear, lab, cv::COLOR_LBGR2Lab);
  return lab;
}

double Median(std::vector<float>* values) {
  if (values->empty()) return 0;
  const auto middle = values->begin() + static_cast<long>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

// Mean of the values within `reach` of the median, twice recentred: finer than
// the steps of 8-bit data.
double TrimmedMean(std::vector<float>* values, double reach) {
  double centre = Median(values);
  for (int pass = 0; pass < 2; ++pass) {
    double sum = 0;
    int count = 0;
    for (const float v : *values) {
      if (std::abs(v - centre) > reach) continue;
      sum += v;
      ++count;
    }
    if (count > 0) centre = sum / count;
  }
  return centre;
}

// The plate as this exposure would have taken it, sRGB codes; a table per
// channel.
cv::Mat3b ApplyGain(const cv::Mat3b& plate, const cv::Vec3d& gain) {
  cv::Mat3b table(1, 256);
  for (int i = 0; i < 256; ++i) {
    for (int c = 0; c < 3; ++c) {
      table(0, i)[c] = cv::saturate_cast<std::uint8_t>(gain[c] * i);
    }
  }
  cv::Mat3b result;
  cv::LUT(plate, table, result);
  return result;
}

// Local correlation of picture and plate lightness over 5 x 5 pixels; 1 where
// the plate has no texture to speak of, so that nothing can be said.
cv::Mat1f TextureAgreement(const cv::Mat1f& a, const cv::Mat1f& b) {
  constexpr int kWindow = 5;
  constexpr float kMinDeviation = 2.0f;  // of the plate's L
  const auto mean = [](const cv::Mat1f& image) {
    cv::Mat1f result;
    cv::boxFilter(image, result, CV_32F, {kWindow, kWindow});
    return result;
  };
  const cv::Mat1f mean_a = mean(a);
  const cv::Mat1f mean_b = mean(b);
  const cv::Mat1f mean_aa = mean(a.mul(a));
  const cv::Mat1f mean_bb = mean(b.mul(b));
  const cv::Mat1f mean_ab = mean(a.mul(b));
  cv::Mat1f agreement(a.size());
  for (int y = 0; y < a.rows; ++y) {
    for (int x = 0; x < a.cols; ++x) {
      const float ma = mean_a(y, x), mb = mean_b(y, x);
      const float var_a = mean_aa(y, x) - ma * ma;
      const float var_b = mean_bb(y, x) - mb * mb;
      const float cov = mean_ab(y, x) - ma * mb;
      agreement(y, x) = var_b < kMinDeviation * kMinDeviation
                            ? 1.f
                            : cov / std::sqrt(std::max(var_a, 0.01f) * var_b);
    }
  }
  return agreement;
}

struct Lightness {
  cv::Mat1f picture;
  cv::Mat1f plate;
};

Lightness ExtractLightness(const cv::Mat3f& picture, const cv::Mat3f& plate) {
  Lightness result;
  cv::extractChannel(picture, result.picture, 0);
  cv::extractChannel(plate, result.plate, 0);
  return result;
}

// Median of |D| over the background half of the picture against what noise of
// the assumed size gives.
double NoiseRatio(const cv::Mat1f& squared) {
  constexpr int kStep = 4;
  std::vector<float> values;
  for (int y = 0; y < squared.rows; y += kStep) {
    for (int x = 0; x < squared.cols; x += kStep) {
      values.push_back(squared(y, x));
    }
  }
  return std::sqrt(Median(&values));
}

}  // namespace

cv::Mat3f ToLinear(const cv::Mat3b& picture) {
  static const std::array<float, 256> kTable = LinearTable();
  cv::Mat3f linear;
  cv::LUT(
      picture, cv::Mat1f(1, 256, const_cast<float*>(kTable.data())), linear);
  return linear;
}

cv::Vec3d ExposureGain(const cv::Mat3b& picture, const cv::Mat3b& plate) {
  constexpr int kStep = 3;
  constexpr int kDarkest = 24;  // noise makes ratios of darker values useless
  constexpr int kBrightest = 240;
  constexpr std::size_t kFewest = 100;
  constexpr double kReach = 0.06;
  cv::Vec3d gain(1, 1, 1);
  for (int c = 0; c < 3; ++c) {
    std::vector<float> log_ratio;
    for (int y = 0; y < plate.rows; y += kStep) {
      for (int x = 0; x < plate.cols; x += kStep) {
        const int a = picture(y, x)[c];
        const int b = plate(y, x)[c];
        if (std::min(a, b) < kDarkest || std::max(a, b) > kBrightest) continue;
        log_ratio.push_back(
            std::log(static_cast<float>(a) / static_cast<float>(b)));
      }
    }
    if (log_ratio.size() >= kFewest) {
      gain[c] = std::exp(TrimmedMean(&log_ratio, kReach));
    }
  }
  return gain;
}

BackgroundDifference PlateDifference(const cv::Mat3b& picture,
                                     const cv::Mat3b& plate,
                                     const SegmentOptions& options) {
  constexpr double kPlateBlur = 0.7;    // px: one plate has noise of its own
  constexpr double kPictureBlur = 0.7;  // px
  BackgroundDifference result;
  result.background_linear =
      ToLinear(ApplyGain(plate, ExposureGain(picture, plate)));
  cv::GaussianBlur(result.background_linear,
                   result.background_linear,
                   {},
                   kPlateBlur,
                   kPlateBlur,
                   cv::BORDER_REPLICATE);
  cv::Mat3f smooth;
  cv::GaussianBlur(ToLinear(picture),
                   smooth,
                   {},
                   kPictureBlur,
                   kPictureBlur,
                   cv::BORDER_REPLICATE);
  const cv::Mat3f lab = ToLab(smooth);
  const cv::Mat3f plate_lab = ToLab(result.background_linear);
  const Lightness lightness = ExtractLightness(lab, plate_lab);
  const cv::Mat1f texture =
      TextureAgreement(lightness.picture, lightness.plate);

  const float per_l = static_cast<float>(options.lightness_weight /
                                         (options.sigma_l * options.sigma_l));
  const float per_ab =
      static_cast<float>(1 / (options.sigma_ab * options.sigma_ab));
  result.squared.create(picture.size());
  result.squared_unexplained.create(picture.size());
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const cv::Vec3f& p = lab(y, x);
      const cv::Vec3f& q = plate_lab(y, x);
      const cv::Vec3f d = p - q;
      const float full =
          per_l * d[0] * d[0] + per_ab * (d[1] * d[1] + d[2] * d[2]);
      result.squared_unexplained(y, x) = full;
      result.squared(y, x) = full;
      // (L + 16) scales with the cube root of the light, and so do a and b.
      const float k = (p[0] + 16) / (q[0] + 16);
      const float ratio = p[0] / std::max(q[0], 1.f);
      const float da = p[1] - k * q[1];
      const float db = p[2] - k * q[2];
      const float chroma = std::sqrt(da * da + db * db);
      const bool is_shadow = ratio >= 0.45f && ratio <= 1 &&
                             chroma <= 3.0f + 0.06f * std::abs(d[0]) &&
                             texture(y, x) > 0.7f;
      const bool is_highlight = ratio > 1 && ratio <= 1.15f && chroma <= 4;
      if (is_shadow || is_highlight) {
        result.squared(y, x) = std::min(full, per_ab * chroma * chroma);
      }
    }
  }
  result.noise_ratio = NoiseRatio(result.squared_unexplained);
  return result;
}

}  // namespace sweepfit
