// SPDX-License-Identifier: Apache-2.0
#include "capture/matte.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "capture/silhouette.h"

namespace sweepfit {
namespace {

// The boundary lies this near to that of the mask, px.
constexpr int kBand = 3;

cv::Mat Disc(int radius) {
  return cv::getStructuringElement(cv::MORPH_ELLIPSE,
                                   {2 * radius + 1, 2 * radius + 1});
}

// Weighted means over windows; the weights fall to tiny ones where nothing
// better is near, so that thin limbs still have a colour.
class LocalMeans {
 public:
  explicit LocalMeans(const cv::Mat1f& weight) : weight_(weight) {
    cv::boxFilter(weight, norm_, CV_32F, kWindow);
  }

  // The sums of an image that At divides.
  cv::Mat3f Sums(const cv::Mat3f& image) const {
    cv::Mat3f weighted(image.size());
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        weighted(y, x) = weight_(y, x) * image(y, x);
      }
    }
    cv::Mat3f sums;
    cv::boxFilter(weighted, sums, CV_32F, kWindow);
    return sums;
  }

  cv::Vec3f At(const cv::Mat3f& sums, int y, int x) const {
    const float norm = norm_(y, x) + 1e-12f;
    const cv::Vec3f& sum = sums(y, x);
    return {sum[0] / norm, sum[1] / norm, sum[2] / norm};
  }

 private:
  static inline const cv::Size kWindow{9, 9};

  cv::Mat1f weight_;
  cv::Mat1f norm_;
};

// 1 well inside the mask, falling to tiny values towards its boundary and 0
// beyond it.
cv::Mat1f CoreWeight(const cv::Mat1b& mask) {
  cv::Mat1b core, inner;
  cv::erode(mask, core, Disc(2));
  cv::erode(mask, inner, Disc(1));
  cv::Mat1f weight(mask.size());
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      weight(y, x) = core(y, x)    ? 1.f
                     : inner(y, x) ? 1e-2f
                     : mask(y, x)  ? 1e-4f
                                   : 0.f;
    }
  }
  return weight;
}

// Half coverage lies nearly a pixel inside a mask that begins with the first
// trace of a person: the lens spreads it. This is the mask less a pixel (255)
// and some of that pixel.
cv::Mat1b HalfCovered(const cv::Mat1b& mask, cv::Mat1b* inner) {
  constexpr double kOuterShare = 0.2;
  cv::erode(mask, *inner, Disc(1), {-1, -1}, 1, cv::BORDER_CONSTANT, 255);
  cv::Mat1b covered;
  cv::addWeighted(*inner, 1 - kOuterShare, mask, kOuterShare, 0, covered);
  return covered;
}

// The mixing ratio in the band around the mask's boundary.
cv::Mat1f Mix(const cv::Mat3f& picture,
              const cv::Mat3f& background,
              const cv::Mat1b& mask) {
  constexpr float kDarkestRatio = 0.3f, kBrightestRatio = 1.3f;
  // The rim turns away from the light: it differs more than its surroundings.
  constexpr float kAtRim = 10;
  const cv::Mat1b outside = mask == 0;
  const LocalMeans inside_means(CoreWeight(mask));
  const cv::Mat3f person_sums = inside_means.Sums(picture);
  const cv::Mat3f person_square_sums = inside_means.Sums(picture.mul(picture));
  const LocalMeans outside_means(CoreWeight(outside));
  const cv::Mat3f picture_sums = outside_means.Sums(picture);
  const cv::Mat3f background_sums = outside_means.Sums(background);
  cv::Mat1b inner, grown, shrunk;
  cv::Mat1f prior;
  HalfCovered(mask, &inner).convertTo(prior, CV_32F, 1.0 / 255);
  cv::dilate(inner, grown, Disc(kBand));
  cv::erode(inner, shrunk, Disc(kBand));
  cv::GaussianBlur(prior, prior, {}, 0.8, 0.8, cv::BORDER_REPLICATE);

  cv::Mat1f alpha(mask.size());
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (shrunk(y, x) || !grown(y, x)) {
        alpha(y, x) = shrunk(y, x) ? 1.f : 0.f;
        continue;
      }
      const cv::Vec3f person = inside_means.At(person_sums, y, x);
      const cv::Vec3f person_square = inside_means.At(person_square_sums, y, x);
      const cv::Vec3f picture_outside = outside_means.At(picture_sums, y, x);
      const cv::Vec3f background_outside =
          outside_means.At(background_sums, y, x);
      float along = 0, contrast = 0, brightness = 0;
      cv::Vec3f direction;
      for (int c = 0; c < 3; ++c) {
        const float ratio = std::clamp(
            (picture_outside[c] + 1e-3f) / (background_outside[c] + 1e-3f),
            kDarkestRatio,
            kBrightestRatio);
        const float b = background(y, x)[c] * ratio;
        const float f = person[c];
        direction[c] = f - b;
        along += (picture(y, x)[c] - b) * (f - b);
        contrast += (f - b) * (f - b);
        brightness += 0.5f * (f + b) / 3;
      }
      // Noise, and shading and texture of the person along the mixture.
      float spread = 0;
      for (int c = 0; c < 3; ++c) {
        const float f = person[c];
        const float variance = std::max(0.f, person_square[c] - f * f);
        spread += std::abs(direction[c]) * std::sqrt(variance);
      }
      const float sigma = 0.004f + 0.15f * brightness;
      const float trust =
          sigma * sigma + kAtRim * spread * spread / std::max(contrast, 1e-9f);
      alpha(y, x) = std::clamp(
          (along + trust * prior(y, x)) / (contrast + trust), 0.f, 1.f);
    }
  }
  return alpha;
}

// The lens, the sharpening in the camera and compression spread a boundary over
// more than the pixels it crosses. The share of each pixel inside the 0.5 level
// of the (bilinear) mixing ratio is what is covered.
cv::Mat1f Sharpen(const cv::Mat1f& alpha) {
  constexpr int kSamples = 8;  // along each axis
  cv::Mat1f low, high;
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {3, 3});
  cv::erode(alpha, low, square);
  cv::dilate(alpha, high, square);
  cv::Mat1f covered(alpha.size());
  for (int y = 0; y < alpha.rows; ++y) {
    for (int x = 0; x < alpha.cols; ++x) {
      if (low(y, x) > 0.5f || high(y, x) <= 0.5f) {
        covered(y, x) = low(y, x) > 0.5f ? 1.f : 0.f;
        continue;
      }
      int count = 0;
      for (int j = 0; j < kSamples; ++j) {
        for (int i = 0; i < kSamples; ++i) {
          const Eigen::Vector2d p(x + (i + 0.5) / kSamples - 0.5,
                                  y + (j + 0.5) / kSamples - 0.5);
          count += SampleBilinear(alpha, p).value > 0.5;
        }
      }
      covered(y, x) = static_cast<float>(count) / (kSamples * kSamples);
    }
  }
  return covered;
}

}  // namespace

cv::Mat1f BoundaryCoverage(const cv::Mat3f& picture_linear,
                           const cv::Mat3f& background_linear,
                           const cv::Mat1b& mask) {
  constexpr int kMargin = 16;
  cv::Mat1f coverage(mask.size(), 0.f);
  const cv::Rect crop = BoxAround(mask, kMargin);
  if (crop.empty()) return coverage;
  Sharpen(Mix(picture_linear(crop), background_linear(crop), mask(crop)))
      .copyTo(coverage(crop));
  return coverage;
}

}  // namespace sweepfit
