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

cv::Mat Square(int radius) {
  return cv::getStructuringElement(cv::MORPH_RECT,
                                   {2 * radius + 1, 2 * radius + 1});
}

// Length of the gradient, per pixel.
cv::Mat1f Slope(const cv::Mat1f& image) {
  constexpr double kSobelScale = 0.125;
  cv::Mat1f dx, dy, slope;
  cv::Sobel(image, dx, CV_32F, 1, 0, 3, kSobelScale, 0, cv::BORDER_REPLICATE);
  cv::Sobel(image, dy, CV_32F, 0, 1, 3, kSobelScale, 0, cv::BORDER_REPLICATE);
  cv::magnitude(dx, dy, slope);
  return slope;
}

// The pixels that shadow or highlight can explain and that are joined to plain
// background without crossing an edge: light changes softly across the plate,
// whereas a garment that is a darker shade of the wall has an outline. (The
// plate's own edges cancel in the ratio of picture and plate.) An edge is where
// ln light changes by more than `steepest` per pixel; gaps in it up to 2
// `closing` pixels wide are closed.
cv::Mat1b SoftlyLit(const cv::Mat1b& candidate,
                    const cv::Mat1b& plain,
                    const cv::Mat1f& slope,
                    float steepest,
                    int closing) {
  constexpr double kSmallestShare = 0.002;  // of the picture, plain pixels
  cv::Mat1f widened;
  cv::dilate(slope, widened, Square(closing));
  const cv::Mat1b smooth = widened < steepest;
  const cv::Mat1b passable = plain | (candidate & smooth);
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
  cv::dilate(reached, reached, Square(std::max(1, closing - 2)));
  return reached & candidate;
}

// Lightness of picture and plate, and what is left of the colour difference
// once the plate is shown in the picture's light.
bool IsShadowOrHighlight(float lightness, float plate, float chroma) {
  const float ratio = lightness / std::max(plate, 1.f);
  if (ratio > 1) return ratio <= 1.15f && chroma <= 4;
  return ratio >= 0.3f && chroma <= 3.0f + 0.06f * std::abs(lightness - plate);
}

// Noise of the difference of picture and plate, Lab units.
struct Noise {
  float sigma_l;
  float sigma_ab;
  double ratio;  // the larger of the two as measured, over the option's floor
};

// 1.4826 median |difference|: the person covers less than half of a picture.
Noise MeasureNoise(const cv::Mat3f& lab,
                   const cv::Mat3f& plate_lab,
                   const SegmentOptions& options) {
  constexpr int kStep = 3;
  constexpr double kSigmaPerMedian = 1.4826;
  std::vector<float> l, ab;
  for (int y = 0; y < lab.rows; y += kStep) {
    for (int x = 0; x < lab.cols; x += kStep) {
      const cv::Vec3f d = lab(y, x) - plate_lab(y, x);
      l.push_back(std::abs(d[0]));
      ab.push_back(std::abs(d[1]));
      ab.push_back(std::abs(d[2]));
    }
  }
  const double sigma_l = kSigmaPerMedian * Median(&l);
  const double sigma_ab = kSigmaPerMedian * Median(&ab);
  return {static_cast<float>(std::max(sigma_l, options.sigma_l)),
          static_cast<float>(std::max(sigma_ab, options.sigma_ab)),
          std::max(sigma_l / options.sigma_l, sigma_ab / options.sigma_ab)};
}

struct Variance {
  cv::Mat1f l, ab;
};

// Noise, and what the plate's own edges do when the camera shakes a little.
Variance PixelVariance(const cv::Mat3f& plate_lab, const Noise& noise) {
  constexpr float kShake = 0.25f;  // px
  std::vector<cv::Mat1f> channels;
  cv::split(plate_lab, channels);
  const cv::Mat1f l = kShake * Slope(channels[0]);
  const cv::Mat1f a = kShake * Slope(channels[1]);
  const cv::Mat1f b = kShake * Slope(channels[2]);
  Variance variance;
  variance.l = l.mul(l) + noise.sigma_l * noise.sigma_l;
  variance.ab = 0.5 * (a.mul(a) + b.mul(b)) + noise.sigma_ab * noise.sigma_ab;
  return variance;
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

  // A plate with a colour of its own (a key screen): the same hue and
  // saturation are proof enough of a shadow, outline or not.
  constexpr float kOwnColour = 20;
  constexpr float kSameColour = 0.2f;
  const Noise noise = MeasureNoise(lab, plate_lab, options);
  const Variance variance = PixelVariance(plate_lab, noise);
  const float weight_l = static_cast<float>(options.lightness_weight);
  result.squared_unexplained.create(picture.size());
  cv::Mat1f explained(picture.size()), log_light(picture.size());
  cv::Mat1b candidate(picture.size()), same_colour(picture.size());
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const cv::Vec3f& p = lab(y, x);
      const cv::Vec3f& q = plate_lab(y, x);
      const cv::Vec3f d = p - q;
      const float variance_ab = variance.ab(y, x);
      result.squared_unexplained(y, x) =
          weight_l * d[0] * d[0] / variance.l(y, x) +
          (d[1] * d[1] + d[2] * d[2]) / variance_ab;
      // L + 16 scales with the cube root of the light, and so do a and b.
      const float k = (p[0] + 16) / (q[0] + 16);
      const float da = p[1] - k * q[1];
      const float db = p[2] - k * q[2];
      const float chroma = std::hypot(da, db);
      explained(y, x) = chroma * chroma / variance_ab;
      log_light(y, x) = 3 * std::log(k);
      candidate(y, x) = IsShadowOrHighlight(p[0], q[0], chroma) ? 255 : 0;
      const float expected = k * std::hypot(q[1], q[2]);
      same_colour(y, x) = candidate(y, x) && expected > kOwnColour &&
                                  chroma < kSameColour * expected
                              ? 255
                              : 0;
    }
  }
  const cv::Mat1b plain = result.squared_unexplained < options.threshold_low;
  const cv::Mat1f slope = Slope(log_light);
  constexpr float kOutline = 0.07f, kOutlineAtFeet = 0.25f;
  const auto explain = [&](cv::Mat1b lit) {
    lit |= same_colour;
    cv::Mat1f squared = result.squared_unexplained.clone();
    cv::Mat1f(cv::min(squared, explained)).copyTo(squared, lit);
    return squared;
  };
  result.squared = explain(SoftlyLit(candidate, plain, slope, kOutline, 3));
  result.squared_at_feet =
      explain(SoftlyLit(candidate, plain, slope, kOutlineAtFeet, 1));
  result.noise_ratio = noise.ratio;
  return result;
}

}  // namespace sweepfit
