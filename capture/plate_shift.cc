// SPDX-License-Identifier: Apache-2.0
#include "capture/plate_shift.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "model/median.h"

namespace sweepfit {
namespace {

constexpr int kGreen = 1;

// One Gauss-Newton step: the shift that best explains picture - gain * plate by
// the plate's slopes, over a grid of pixels and without what differs most.
cv::Point2d RefineShift(const cv::Mat3b& picture,
                        const cv::Mat3b& plate,
                        double gain) {
  constexpr int kMostSamples = 200000;
  constexpr double kMostDifference = 30;  // codes
  constexpr double kLeastSlope = 4;       // codes per pixel
  const int step =
      1 + static_cast<int>(std::sqrt(plate.total() / double{kMostSamples}));
  double xx = 0, xy = 0, yy = 0, xd = 0, yd = 0;
  for (int y = 1; y + 1 < plate.rows; y += step) {
    for (int x = 1; x + 1 < plate.cols; x += step) {
      const double difference =
          picture(y, x)[kGreen] - gain * plate(y, x)[kGreen];
      const double dx =
          0.5 * gain * (plate(y, x + 1)[kGreen] - plate(y, x - 1)[kGreen]);
      const double dy =
          0.5 * gain * (plate(y + 1, x)[kGreen] - plate(y - 1, x)[kGreen]);
      if (std::abs(difference) > kMostDifference ||
          dx * dx + dy * dy < kLeastSlope * kLeastSlope) {
        continue;
      }
      xx += dx * dx;
      xy += dx * dy;
      yy += dy * dy;
      xd -= dx * difference;
      yd -= dy * difference;
    }
  }
  // A few clear edges in both directions, or nothing can be said.
  constexpr double kLeast = 100 * kLeastSlope * kLeastSlope;
  const double determinant = xx * yy - xy * xy;
  if (std::min(xx, yy) < kLeast || determinant < 0.01 * xx * yy) return {};
  return {(yy * xd - xy * yd) / determinant, (xx * yd - xy * xd) / determinant};
}

cv::Point2d CorrelatePhase(const cv::Mat3b& picture, const cv::Mat3b& plate) {
  constexpr int kLargestSide = 640;
  constexpr double kLeastResponse = 0.03;
  const int shrink = 1 + (std::max(plate.cols, plate.rows) - 1) / kLargestSide;
  const auto prepare = [&](const cv::Mat3b& image) {
    cv::Mat1b channel, small;
    cv::extractChannel(image, channel, kGreen);
    cv::resize(channel, small, {}, 1.0 / shrink, 1.0 / shrink, cv::INTER_AREA);
    cv::Mat1f result;
    small.convertTo(result, CV_32F);
    return result;
  };
  const cv::Mat1f from = prepare(plate), to = prepare(picture);
  cv::Mat1f window;
  cv::createHanningWindow(window, from.size(), CV_32F);
  double response = 0;
  const cv::Point2d shift = cv::phaseCorrelate(from, to, window, &response);
  const double limit = 0.05 * std::max(from.cols, from.rows);
  if (response < kLeastResponse || std::hypot(shift.x, shift.y) > limit) {
    return {};
  }
  return shift * shrink;
}

// Median of |picture - gain * plate|, codes, among pixels on the plate's edges.
double EdgeResidual(const cv::Mat3b& picture,
                    const cv::Mat3b& plate,
                    double gain) {
  constexpr int kLeastSlope = 8;
  constexpr int kStep = 2;
  std::vector<float> residual;
  for (int y = 1; y + 1 < plate.rows; y += kStep) {
    for (int x = 1; x + 1 < plate.cols; x += kStep) {
      const int dx = plate(y, x + 1)[kGreen] - plate(y, x - 1)[kGreen];
      const int dy = plate(y + 1, x)[kGreen] - plate(y - 1, x)[kGreen];
      if (std::abs(dx) + std::abs(dy) < 2 * kLeastSlope) continue;
      residual.push_back(static_cast<float>(
          std::abs(picture(y, x)[kGreen] - gain * plate(y, x)[kGreen])));
    }
  }
  return MedianInPlace(&residual);
}

}  // namespace

cv::Point2d MeasurePlateShift(const cv::Mat3b& picture,
                              const cv::Mat3b& plate,
                              const cv::Vec3d& gain) {
  constexpr double kStill = 0.15;  // px
  constexpr double kGained = 0.8;
  const double g = gain[kGreen];
  const cv::Point2d small = RefineShift(picture, plate, g);
  if (std::hypot(small.x, small.y) < kStill) return {};
  cv::Point2d shift = CorrelatePhase(picture, plate);
  for (int pass = 0; pass < 2; ++pass) {
    shift += RefineShift(picture, cv::Mat3b(Shift(plate, shift)), g);
  }
  // Only a shift that explains the edges much better counts.
  const cv::Mat3b moved = Shift(plate, shift);
  const bool better = EdgeResidual(picture, moved, g) <
                      kGained * EdgeResidual(picture, plate, g);
  return better ? shift : cv::Point2d();
}

cv::Mat Shift(const cv::Mat& plate, const cv::Point2d& shift) {
  const cv::Matx23d move(1, 0, shift.x, 0, 1, shift.y);
  cv::Mat moved;
  cv::warpAffine(
      plate, moved, move, plate.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return moved;
}

}  // namespace sweepfit
