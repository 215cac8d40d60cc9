// SPDX-License-Identifier: Apache-2.0
#include "capture/chroma.h"

#include <glog/logging.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "capture/colour.h"
#include "capture/other_light.h"
#include "model/median.h"

namespace sweepfit {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr float kMinChroma = 12;  // of anything that may be a screen

float Chroma(const cv::Vec3f& lab) { return std::hypot(lab[1], lab[2]); }
float Hue(const cv::Vec3f& lab) { return std::atan2(lab[2], lab[1]); }

// Hue angles (Lab) of saturated sRGB green and blue, and how far from them a
// screen may be.
constexpr double kGreenHue = 136 * kPi / 180, kBlueHue = -54 * kPi / 180;
constexpr double kNamedReach = 45 * kPi / 180;

bool HasHue(const cv::Vec3f& lab, double hue, double reach) {
  return std::abs(std::remainder(Hue(lab) - hue, 2 * kPi)) <= reach;
}

std::vector<cv::Vec3f> BorderColours(const cv::Mat3f& lab) {
  const int frame = std::max(2, std::min(lab.rows, lab.cols) / 40);
  std::vector<cv::Vec3f> colours;
  for (int y = 0; y < lab.rows; ++y) {
    const bool whole_row = y < frame || y >= lab.rows - frame;
    for (int x = 0; x < lab.cols; ++x) {
      if (!whole_row && x == frame) x = std::max(x, lab.cols - frame);
      colours.push_back(lab(y, x));
    }
  }
  return colours;
}

// The most frequent hue (Lab angle) of saturated colours.
double FrequentHue(const std::vector<cv::Vec3f>& colours) {
  constexpr int kBins = 36;
  std::array<int, kBins> count{};
  for (const cv::Vec3f& colour : colours) {
    if (Chroma(colour) < kMinChroma) continue;
    const double turn = Hue(colour) / (2 * kPi) + 0.5;
    ++count[std::clamp(static_cast<int>(turn * kBins), 0, kBins - 1)];
  }
  int best = 0, best_count = -1;
  for (int i = 0; i < kBins; ++i) {
    const int around =
        count[i] + count[(i + 1) % kBins] + count[(i + kBins - 1) % kBins];
    if (around > best_count) {
      best = i;
      best_count = around;
    }
  }
  return ((best + 0.5) / kBins - 0.5) * 2 * kPi;
}

// Squared distance to the screen at this place: the shares of its chroma (in
// the light that falls on the pixel) that are lost and that are strange, 1
// where either is kMost.
float SquaredFromScreen(const cv::Vec3f& colour, const cv::Vec3f& screen) {
  constexpr float kMost = 0.3f;
  constexpr float kChromaNoise = 4;
  const float chroma = std::max(Chroma(screen), 1.f);
  const float cos_hue = screen[1] / chroma, sin_hue = screen[2] / chroma;
  // In more or less light the screen's a and b scale with L + 16.
  const float expected =
      chroma * (colour[0] + 16) / (screen[0] + 16) + kChromaNoise;
  const float along = colour[1] * cos_hue + colour[2] * sin_hue + kChromaNoise;
  const float across = colour[2] * cos_hue - colour[1] * sin_hue;
  const float lost = std::max(0.f, 1 - along / expected) / kMost;
  const float strange = across / (kMost * expected);
  return lost * lost + strange * strange;
}

}  // namespace

KeyScreen FindKeyScreen(const cv::Mat3b& picture, const std::string& key) {
  CHECK(key == "green" || key == "blue" || key == "auto") << key;
  constexpr double kFoundReach = 25 * kPi / 180;
  constexpr double kSmallestShare = 0.02, kSmallestFoundShare = 0.4;
  const std::vector<cv::Vec3f> border =
      BorderColours(ToSmoothLab(ToLinear(picture)));
  const bool is_named = key != "auto";
  const double hue = key == "green"  ? kGreenHue
                     : key == "blue" ? kBlueHue
                                     : FrequentHue(border);
  const double reach = is_named ? kNamedReach : kFoundReach;
  std::vector<float> l, a, b;
  for (const cv::Vec3f& colour : border) {
    if (Chroma(colour) < kMinChroma) continue;
    if (!HasHue(colour, hue, reach)) continue;
    l.push_back(colour[0]);
    a.push_back(colour[1]);
    b.push_back(colour[2]);
  }
  KeyScreen screen;
  screen.border_share =
      static_cast<double>(l.size()) / static_cast<double>(border.size());
  screen.found =
      screen.border_share >= (is_named ? kSmallestShare : kSmallestFoundShare);
  if (screen.found) {
    screen.lab = {
        Median(std::move(l)), Median(std::move(a)), Median(std::move(b))};
  }
  return screen;
}

std::optional<int> KeyChannel(const KeyScreen& screen) {
  if (!screen.found) return std::nullopt;
  if (HasHue(screen.lab, kBlueHue, kNamedReach)) return 0;
  if (HasHue(screen.lab, kGreenHue, kNamedReach)) return 1;
  return std::nullopt;
}

cv::Mat3f FillScreen(const cv::Mat3b& picture, const KeyScreen& screen) {
  constexpr float kSurelyScreen = 0.8f;
  constexpr int kKeepOff = 2;  // px from anything that is not screen
  const cv::Mat3f linear = ToLinear(picture);
  const cv::Mat3f lab = ToSmoothLab(linear);
  cv::Mat1b is_screen(picture.size());
  for (int y = 0; y < lab.rows; ++y) {
    for (int x = 0; x < lab.cols; ++x) {
      is_screen(y, x) =
          SquaredFromScreen(lab(y, x), screen.lab) < kSurelyScreen ? 255 : 0;
    }
  }
  cv::erode(is_screen,
            is_screen,
            cv::getStructuringElement(cv::MORPH_RECT,
                                      {2 * kKeepOff + 1, 2 * kKeepOff + 1}));
  // Weighted means over ever larger windows, each with a tiny weight beside
  // the smaller.
  cv::Mat1f norm;
  is_screen.convertTo(norm, CV_32F, 1.0 / 255);
  cv::Mat3f sum(linear.size());
  for (int y = 0; y < sum.rows; ++y) {
    for (int x = 0; x < sum.cols; ++x) sum(y, x) = linear(y, x) * norm(y, x);
  }
  cv::Mat3f all_sum = sum.clone();
  cv::Mat1f all_norm = norm.clone();
  double falling = 1;
  for (int window = 3; window < 4 * std::max(sum.cols, sum.rows);
       window = 2 * window + 1) {
    cv::Mat3f wide_sum;
    cv::Mat1f wide_norm;
    cv::boxFilter(sum, wide_sum, CV_32F, {window, window});
    cv::boxFilter(norm, wide_norm, CV_32F, {window, window});
    falling *= 0.01;
    all_sum += falling * wide_sum;
    all_norm += falling * wide_norm;
  }
  for (int y = 0; y < sum.rows; ++y) {
    for (int x = 0; x < sum.cols; ++x) {
      all_sum(y, x) *= 1 / (all_norm(y, x) + 1e-25f);
    }
  }
  return all_sum;
}

BackgroundEvidence ChromaEvidence(const cv::Mat3f& picture_linear,
                                  const cv::Mat3f& screen_linear,
                                  const std::vector<float>& at_feet,
                                  const SegmentOptions& options) {
  CHECK_EQ(at_feet.size(), static_cast<std::size_t>(picture_linear.rows));
  // ln units by which a screen's pixel is likelier to be screen than to have
  // any other colour.
  constexpr float kSure = 12;
  constexpr float kPlainLight = 0.1f;  // of ln
  constexpr float kSurelyScreen = 0.8f;
  BackgroundEvidence result;
  result.background_linear = screen_linear;
  result.lab = ToSmoothLab(picture_linear);
  const cv::Mat3f screen_lab = ToSmoothLab(screen_linear);
  result.change = result.lab - screen_lab;
  result.sigma_l = static_cast<float>(options.sigma_l);
  cv::Mat1f squared(result.lab.size()), log_light(result.lab.size());
  cv::Mat1b screen(result.lab.size()), plain(result.lab.size());
  for (int y = 0; y < squared.rows; ++y) {
    for (int x = 0; x < squared.cols; ++x) {
      const cv::Vec3f& colour = result.lab(y, x);
      squared(y, x) = SquaredFromScreen(colour, screen_lab(y, x));
      log_light(y, x) =
          3 * std::log(ExplainByLight(colour, screen_lab(y, x)).factor);
      screen(y, x) = squared(y, x) < kSurelyScreen ? 255 : 0;
      plain(y, x) =
          screen(y, x) && std::abs(log_light(y, x)) < kPlainLight ? 255 : 0;
    }
  }
  // Half a pixel of somebody dark is the screen's hue in half its light: what
  // is darker must be so softly.
  const cv::Mat1f slope = Slope(log_light);
  const cv::Mat1b soft = SoftlyLit(screen, plain, slope, at_feet);
  result.log_density.create(squared.size());
  for (int y = 0; y < squared.rows; ++y) {
    const OtherLight light = ExpectedLight(at_feet[y]);
    for (int x = 0; x < squared.cols; ++x) {
      float log_density =
          kLogEvenDensity + kSure * std::max(-1.f, 1 - squared(y, x));
      if (!soft(y, x)) {
        log_density += std::min(
            0.f,
            LogDensityOfLight(log_light(y, x),
                              slope(y, x),
                              3 * result.sigma_l / (result.lab(y, x)[0] + 16),
                              light,
                              options.shadow_depth) -
                light.log_probability);
      }
      result.log_density(y, x) = log_density;
    }
  }
  return result;
}

}  // namespace sweepfit
