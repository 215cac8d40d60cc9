// SPDX-License-Identifier: Apache-2.0
#include "capture/plate.h"

#include <glog/logging.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "capture/colour.h"
#include "capture/other_light.h"
#include "model/median.h"

namespace sweepfit {
namespace {

constexpr double kSigmaPerMedian = 1.4826;  // of a normal |deviation|

// Mean of the values within `reach` of the median, twice recentred: finer than
// the steps of 8-bit data.
double TrimmedMean(std::vector<float>* values, double reach) {
  double centre = MedianInPlace(values);
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

// The plate as this exposure would have taken it, sRGB codes.
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

// The middle value of every pixel and channel.
cv::Mat3b MiddleFrame(const std::vector<cv::Mat3b>& frames) {
  const int channels = 3 * frames[0].cols;
  cv::Mat3b middle(frames[0].size());
  std::vector<std::uint8_t> values(frames.size());
  for (int y = 0; y < middle.rows; ++y) {
    for (int x = 0; x < channels; ++x) {
      for (std::size_t i = 0; i < frames.size(); ++i) {
        values[i] = frames[i].ptr(y)[x];
      }
      std::sort(values.begin(), values.end());
      const std::size_t low = (values.size() - 1) / 2, high = values.size() / 2;
      middle.ptr(y)[x] =
          static_cast<std::uint8_t>((values[low] + values[high] + 1) / 2);
    }
  }
  return middle;
}

cv::Mat2f FrameVariance(const std::vector<cv::Mat3b>& frames,
                        const cv::Mat3b& middle) {
  constexpr float kLargest = 36;  // what passes through one frame counts little
  constexpr int kWindow = 5;
  const cv::Mat3f middle_lab = ToSmoothLab(ToLinear(middle));
  cv::Mat2f sum(middle.size(), cv::Vec2f(0, 0));
  for (const cv::Mat3b& frame : frames) {
    const cv::Mat3f lab = ToSmoothLab(ToLinear(frame));
    for (int y = 0; y < sum.rows; ++y) {
      for (int x = 0; x < sum.cols; ++x) {
        const cv::Vec3f d = lab(y, x) - middle_lab(y, x);
        sum(y, x) +=
            cv::Vec2f(std::min(d[0] * d[0], kLargest),
                      std::min(0.5f * (d[1] * d[1] + d[2] * d[2]), kLargest));
      }
    }
  }
  cv::blur(sum, sum, {kWindow, kWindow}, {-1, -1}, cv::BORDER_REPLICATE);
  return sum / static_cast<double>(frames.size() - 1);
}

// Variance of L and of (a + b) / 2: noise, what the plate's own edges do when
// the camera shakes a little, and what changed from frame to frame.
cv::Mat2f PixelVariance(const PlateModel& plate,
                        const cv::Mat3f& plate_lab,
                        const PlateNoise& noise) {
  constexpr float kShake = 0.25f;  // px
  std::array<cv::Mat1f, 3> channels;
  cv::split(plate_lab, channels.data());
  const cv::Mat1f l = Slope(channels[0]);
  const cv::Mat1f a = Slope(channels[1]);
  const cv::Mat1f b = Slope(channels[2]);
  const float noise_l = noise.sigma_l * noise.sigma_l;
  const float noise_ab = noise.sigma_ab * noise.sigma_ab;
  cv::Mat2f variance(plate_lab.size());
  for (int y = 0; y < variance.rows; ++y) {
    for (int x = 0; x < variance.cols; ++x) {
      const float da = a(y, x), db = b(y, x), dl = l(y, x);
      cv::Vec2f own(noise_l, noise_ab);
      if (!plate.variance.empty()) {
        const cv::Vec2f& v = plate.variance(y, x);
        own = {std::max(own[0], v[0]), std::max(own[1], v[1])};
      }
      variance(y, x) = own + kShake * kShake *
                                 cv::Vec2f(dl * dl, 0.5f * (da * da + db * db));
    }
  }
  return variance;
}

// A pixel where the background may be seen.
struct Pixel {
  cv::Vec3f colour;    // of the picture, CIELAB
  cv::Vec3f plate;     // of the plate
  cv::Vec2f variance;  // of L and (a + b) / 2
  LightChange change;  // from plate to picture
  float log_light;     // ln of the change of light
  float light_slope;   // of that, per pixel
};

float SquaredDistance(const Pixel& pixel, const SegmentOptions& options) {
  const cv::Vec3f d = pixel.colour - pixel.plate;
  return static_cast<float>(options.lightness_weight) * d[0] * d[0] /
             pixel.variance[0] +
         (d[1] * d[1] + d[2] * d[2]) / pixel.variance[1];
}

// Squared, of the colour that a change of light leaves unexplained.
float VarianceLeft(const Pixel& pixel, const OtherLight& light) {
  const float reflected = light.reflected * (pixel.colour[0] - pixel.plate[0]);
  return pixel.variance[1] + reflected * reflected;
}
float SquaredLeft(const Pixel& pixel) {
  return pixel.change.da * pixel.change.da + pixel.change.db * pixel.change.db;
}

// Whether another light could be all that changed.
bool IsShadowOrHighlight(const Pixel& pixel, const OtherLight& light) {
  constexpr float kDarkest = -3, kBrightest = 0.35f;  // ln
  constexpr float kMostLeft = 20;                     // squared, of its scale
  return pixel.log_light > kDarkest && pixel.log_light < kBrightest &&
         SquaredLeft(pixel) < kMostLeft * VarianceLeft(pixel, light);
}

// A coloured floor (a key screen, a carpet) in a sharp shadow, as under a
// chair, keeps its hue and saturation. Clothes of the plate's hue do as well,
// so that this holds below the thighs only.
bool KeepsFloorsColour(const Pixel& pixel, float at_feet) {
  constexpr float kBelowThighs = 0.1f;
  constexpr float kOwnColour = 20, kSameColour = 0.2f;
  const float expected =
      pixel.change.factor * std::hypot(pixel.plate[1], pixel.plate[2]);
  return at_feet > kBelowThighs && expected > kOwnColour &&
         SquaredLeft(pixel) < kSameColour * kSameColour * expected * expected;
}

// ln of the density of a pixel's colour if it shows the background. `is_soft`:
// its light passes softly into that of plain background, so that it is no
// surprise, however dark.
float LogDensity(const Pixel& pixel,
                 const OtherLight& light,
                 bool is_soft,
                 const SegmentOptions& options) {
  constexpr float kLog2Pi = 1.8378771f;
  constexpr float kLogStrange = -6.9f;  // 1/1000 is nothing that we know
  constexpr float kLogSoft = -0.5f;
  const float variance_l = pixel.variance[0], variance_ab = pixel.variance[1];
  const float as_it_is = -0.5f * (SquaredDistance(pixel, options) +
                                  3 * kLog2Pi + std::log(variance_l)) -
                         std::log(variance_ab);
  // Two degrees of freedom: most of it is grey, some is strongly coloured.
  const float variance_left = VarianceLeft(pixel, light);
  const float log_left =
      -kLog2Pi - std::log(variance_left) -
      2 * std::log(1 + 0.5f * SquaredLeft(pixel) / variance_left);
  const float per_l = 3 / (pixel.colour[0] + 16);  // ln light per L
  float in_other_light = log_left + std::log(per_l);
  if (is_soft) {
    in_other_light += kLogSoft;
  } else {
    in_other_light += LogDensityOfLight(pixel.log_light,
                                        pixel.light_slope,
                                        per_l * std::sqrt(variance_l),
                                        light,
                                        options.shadow_depth);
  }
  return std::max({as_it_is, in_other_light, kLogStrange + kLogEvenDensity});
}

// ln of the density of every pixel's colour if it shows the background.
cv::Mat1f LogDensities(const cv::Mat3f& lab,
                       const cv::Mat3f& plate_lab,
                       const cv::Mat2f& variance,
                       const std::vector<float>& at_feet,
                       const SegmentOptions& options) {
  constexpr float kPlain = 9;  // squared distance
  const auto pixel_at = [&](int x, int y) {
    Pixel pixel{lab(y, x), plate_lab(y, x), variance(y, x), {}, 0, 0};
    pixel.change = ExplainByLight(pixel.colour, pixel.plate);
    return pixel;
  };
  cv::Mat1f log_light(lab.size());
  cv::Mat1b candidate(lab.size()), plain(lab.size());
  for (int y = 0; y < lab.rows; ++y) {
    const OtherLight light = ExpectedLight(at_feet[y]);
    for (int x = 0; x < lab.cols; ++x) {
      Pixel pixel = pixel_at(x, y);
      pixel.log_light = log_light(y, x) = 3 * std::log(pixel.change.factor);
      candidate(y, x) = IsShadowOrHighlight(pixel, light) ? 255 : 0;
      plain(y, x) = SquaredDistance(pixel, options) < kPlain ? 255 : 0;
    }
  }
  const cv::Mat1f slope = Slope(log_light);
  const cv::Mat1b soft = SoftlyLit(candidate, plain, slope, at_feet);
  cv::Mat1f log_density(lab.size());
  for (int y = 0; y < lab.rows; ++y) {
    const OtherLight light = ExpectedLight(at_feet[y]);
    for (int x = 0; x < lab.cols; ++x) {
      Pixel pixel = pixel_at(x, y);
      pixel.log_light = log_light(y, x);
      pixel.light_slope = slope(y, x);
      const bool is_soft =
          soft(y, x) != 0 || KeepsFloorsColour(pixel, at_feet[y]);
      log_density(y, x) = LogDensity(pixel, light, is_soft, options);
    }
  }
  return log_density;
}

}  // namespace

PlateModel PlateModel::operator()(const cv::Rect& part) const {
  return {picture(part), variance.empty() ? variance : variance(part)};
}

PlateModel BuildPlateModel(const std::vector<cv::Mat3b>& frames) {
  CHECK(!frames.empty());
  if (frames.size() == 1) return {frames[0], {}};
  std::vector<cv::Mat3b> matched = {frames[0]};
  for (std::size_t i = 1; i < frames.size(); ++i) {
    CHECK(frames[i].size() == frames[0].size());
    matched.push_back(ApplyGain(frames[i], ExposureGain(frames[0], frames[i])));
  }
  const cv::Mat3b middle = MiddleFrame(matched);
  return {middle, FrameVariance(matched, middle)};
}

cv::Vec3d ExposureGain(const cv::Mat3b& picture, const cv::Mat3b& plate) {
  constexpr int kMostSamples = 100000;
  constexpr int kDarkest = 24;  // noise makes ratios of darker values useless
  constexpr int kBrightest = 240;
  constexpr std::size_t kFewest = 100;
  constexpr double kReach = 0.06;
  std::array<float, 256> log_of{};
  for (int i = 1; i < 256; ++i) log_of[i] = std::log(static_cast<float>(i));
  const int step =
      1 + static_cast<int>(std::sqrt(plate.total() / double{kMostSamples}));
  cv::Vec3d gain(1, 1, 1);
  std::vector<float> log_ratio;
  for (int c = 0; c < 3; ++c) {
    log_ratio.clear();
    for (int y = 0; y < plate.rows; y += step) {
      for (int x = 0; x < plate.cols; x += step) {
        const int a = picture(y, x)[c];
        const int b = plate(y, x)[c];
        if (std::min(a, b) < kDarkest || std::max(a, b) > kBrightest) continue;
        log_ratio.push_back(log_of[a] - log_of[b]);
      }
    }
    if (log_ratio.size() >= kFewest) {
      gain[c] = std::exp(TrimmedMean(&log_ratio, kReach));
    }
  }
  return gain;
}

PlateNoise MeasurePlateNoise(const cv::Mat3f& change,
                             const cv::Mat1b& is_background,
                             const SegmentOptions& options) {
  constexpr int kMostSamples = 40000;
  const int step =
      1 + static_cast<int>(std::sqrt(change.total() / double{kMostSamples}));
  std::vector<float> l, ab;
  for (int y = 0; y < change.rows; y += step) {
    for (int x = 0; x < change.cols; x += step) {
      if (!is_background(y, x)) continue;
      const cv::Vec3f& d = change(y, x);
      l.push_back(std::abs(d[0]));
      ab.push_back(std::abs(d[1]));
      ab.push_back(std::abs(d[2]));
    }
  }
  return {static_cast<float>(
              std::max(kSigmaPerMedian * MedianInPlace(&l), options.sigma_l)),
          static_cast<float>(std::max(kSigmaPerMedian * MedianInPlace(&ab),
                                      options.sigma_ab))};
}

BackgroundEvidence PlateEvidence(const cv::Mat3f& picture_linear,
                                 const PlateModel& plate,
                                 const cv::Vec3d& gain,
                                 const cv::Mat1b& is_background,
                                 const std::vector<float>& at_feet,
                                 const SegmentOptions& options) {
  CHECK_EQ(at_feet.size(), static_cast<std::size_t>(picture_linear.rows));
  BackgroundEvidence result;
  // A single plate has noise of its own.
  result.background_linear = Smooth(ToLinear(plate.picture, gain));
  const cv::Mat3f plate_lab = ToLab(result.background_linear);
  result.lab = ToSmoothLab(picture_linear);
  result.change = result.lab - plate_lab;
  const PlateNoise noise =
      MeasurePlateNoise(result.change, is_background, options);
  result.sigma_l = noise.sigma_l;
  const cv::Mat2f variance = PixelVariance(plate, plate_lab, noise);
  result.log_density =
      LogDensities(result.lab, plate_lab, variance, at_feet, options);
  return result;
}

}  // namespace sweepfit
