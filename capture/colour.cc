// SPDX-License-Identifier: Apache-2.0
#include "capture/colour.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>

namespace sweepfit {
namespace {

double Decode(double code) {
  const double v = std::clamp(code / 255, 0.0, 1.0);
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

// Pixels that are converted together: loops of a fixed length, so that the
// compiler does several at once.
constexpr int kBlock = 16;
using Block = std::array<float, kBlock>;

// Cube roots of values from kLeastRoot to 2, to the last digit or two: a first
// guess from a third of the exponent, then Halley's method twice.
constexpr float kLeastRoot = 1e-3f;
void CubeRoots(const Block& values, Block* roots) {
  constexpr std::int32_t kTwoThirdsOfBias = 0x2a514067;
  for (int i = 0; i < kBlock; ++i) {
    const float x = std::max(values[i], kLeastRoot);
    const float third =
        static_cast<float>(std::bit_cast<std::int32_t>(x)) * (1.f / 3);
    float root = std::bit_cast<float>(static_cast<std::int32_t>(third) +
                                      kTwoThirdsOfBias);
    for (int step = 0; step < 2; ++step) {
      const float cube = root * root * root;
      root *= (cube + 2 * x) / (2 * cube + x);
    }
    (*roots)[i] = root;
  }
}

// CIELAB's f of a share of the white point's X, Y or Z.
void Compress(Block* values) {
  constexpr float kLinearBelow = 0.008856f;
  Block roots;
  CubeRoots(*values, &roots);
  for (int i = 0; i < kBlock; ++i) {
    const float x = (*values)[i];
    (*values)[i] = x > kLinearBelow ? roots[i] : 7.787f * x + 16.f / 116;
  }
}

// At most kBlock pixels.
void ToLab(const cv::Vec3f* linear, int count, cv::Vec3f* lab) {
  // X, Y, Z of sRGB's primaries (red, green, blue), over those of D65.
  constexpr std::array<float, 3> kX = {0.4339528f, 0.3762194f, 0.1898278f};
  constexpr std::array<float, 3> kY = {0.212671f, 0.715160f, 0.072169f};
  constexpr std::array<float, 3> kZ = {0.0177579f, 0.1094765f, 0.8727656f};
  Block red{}, green{}, blue{}, x, y, z;
  for (int i = 0; i < count; ++i) {
    blue[i] = linear[i][0];
    green[i] = linear[i][1];
    red[i] = linear[i][2];
  }
  for (int i = 0; i < kBlock; ++i) {
    x[i] = kX[0] * red[i] + kX[1] * green[i] + kX[2] * blue[i];
    y[i] = kY[0] * red[i] + kY[1] * green[i] + kY[2] * blue[i];
    z[i] = kZ[0] * red[i] + kZ[1] * green[i] + kZ[2] * blue[i];
  }
  for (Block* values : {&x, &y, &z}) Compress(values);
  for (int i = 0; i < count; ++i) {
    lab[i] = {116 * y[i] - 16, 500 * (x[i] - y[i]), 200 * (y[i] - z[i])};
  }
}

}  // namespace

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

// OpenCV's conversion is not used: its first call makes tables for a fifth of a
// second. Its splines are also off by up to 0.03 units in the dark.
cv::Mat3f ToLab(const cv::Mat3f& linear) {
  cv::Mat3f lab(linear.size());
  for (int y = 0; y < linear.rows; ++y) {
    for (int x = 0; x < linear.cols; x += kBlock) {
      const int count = std::min(kBlock, linear.cols - x);
      ToLab(linear[y] + x, count, lab[y] + x);
    }
  }
  return lab;
}

}  // namespace sweepfit
