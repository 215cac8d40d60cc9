// SPDX-License-Identifier: Apache-2.0
#include "capture/clean_mask.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace sweepfit {
namespace {

struct Components {
  cv::Mat1i label;  // 0: none
  cv::Mat1i stats;
  int count = 0;  // with label 0

  int Area(int i) const { return stats(i, cv::CC_STAT_AREA); }
  cv::Rect Box(int i) const {
    return {stats(i, cv::CC_STAT_LEFT),
            stats(i, cv::CC_STAT_TOP),
            stats(i, cv::CC_STAT_WIDTH),
            stats(i, cv::CC_STAT_HEIGHT)};
  }
};

Components FindComponents(const cv::Mat1b& mask, int connectivity) {
  Components result;
  cv::Mat centroids;
  result.count = cv::connectedComponentsWithStats(
      mask, result.label, result.stats, centroids, connectivity, CV_32S);
  return result;
}

cv::Mat1b Select(const Components& components, const std::vector<bool>& keep) {
  cv::Mat1b mask(components.label.size());
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      mask(y, x) = keep[components.label(y, x)] ? 255 : 0;
    }
  }
  return mask;
}

// Pixels above the low threshold that hang together with one above the high.
cv::Mat1b Hysteresis(const cv::Mat1f& squared, const SegmentOptions& options) {
  cv::Mat1b low = squared > options.threshold_low;
  cv::medianBlur(low, low, 3);
  const Components components = FindComponents(low, 8);
  std::vector<bool> keep(components.count, false);
  for (int y = 0; y < squared.rows; ++y) {
    for (int x = 0; x < squared.cols; ++x) {
      if (squared(y, x) > options.threshold_high) {
        keep[components.label(y, x)] = true;
      }
    }
  }
  keep[0] = false;
  return Select(components, keep);
}

int BoxDistance(const cv::Rect& a, const cv::Rect& b) {
  const int dx = std::max({0, a.x - b.br().x, b.x - a.br().x});
  const int dy = std::max({0, a.y - b.br().y, b.y - a.br().y});
  return std::max(dx, dy);
}

cv::Mat1b KeepPerson(const cv::Mat1b& mask) {
  constexpr double kSmallestShare = 0.005;
  constexpr double kNear = 0.03;  // of the person's height
  const Components components = FindComponents(mask, 8);
  int largest = 0;
  for (int i = 1; i < components.count; ++i) {
    if (largest == 0 || components.Area(i) > components.Area(largest)) {
      largest = i;
    }
  }
  std::vector<bool> keep(components.count, false);
  if (largest == 0) return Select(components, keep);
  const cv::Rect person = components.Box(largest);
  for (int i = 1; i < components.count; ++i) {
    keep[i] = components.Area(i) > kSmallestShare * components.Area(largest) &&
              BoxDistance(components.Box(i), person) <= kNear * person.height;
  }
  keep[largest] = true;
  return Select(components, keep);
}

// A gap between arm and trunk shows the background as it is; a hole in the
// mask of a shirt that resembles the background differs from it a little.
void FillFalseHoles(const BackgroundDifference& difference,
                    const SegmentOptions& options,
                    cv::Mat1b* mask) {
  constexpr double kLargestShare = 0.002;
  constexpr int kPinHole = 6;  // px, too small for a gap
  const int person_area = cv::countNonZero(*mask);
  const Components holes = FindComponents(*mask == 0, 4);
  std::vector<double> sum(holes.count, 0);
  for (int y = 0; y < mask->rows; ++y) {
    for (int x = 0; x < mask->cols; ++x) {
      sum[holes.label(y, x)] += difference.squared_unexplained(y, x);
    }
  }
  std::vector<bool> fill(holes.count, false);
  for (int i = 1; i < holes.count; ++i) {
    const int area = holes.Area(i);
    fill[i] =
        area <= kPinHole || (area < kLargestShare * person_area &&
                             sum[i] / area > 0.25 * options.threshold_low);
  }
  *mask |= Select(holes, fill);
}

// The difference that counts: near the lowest part of the person (given
// roughly), where feet meet the floor, the one that allows for their shadows.
cv::Mat1f WithFeet(const BackgroundDifference& difference,
                   const cv::Mat1b& rough) {
  constexpr double kShare = 0.15;  // of the person's height
  constexpr int kBelow = 8;        // px
  cv::Mat1f squared = difference.squared.clone();
  const cv::Rect person = cv::boundingRect(rough);
  const int first = person.y + cvRound((1 - kShare) * person.height);
  const int last = std::min(person.br().y + kBelow, rough.rows);
  if (first < last) {
    difference.squared_at_feet.rowRange(first, last)
        .copyTo(squared.rowRange(first, last));
  }
  return squared;
}

}  // namespace

cv::Mat1b PersonMask(const BackgroundDifference& difference,
                     const SegmentOptions& options) {
  const cv::Mat1b rough = KeepPerson(Hysteresis(difference.squared, options));
  cv::Mat1b mask = KeepPerson(Hysteresis(WithFeet(difference, rough), options));
  FillFalseHoles(difference, options, &mask);
  const cv::Mat cross = cv::getStructuringElement(cv::MORPH_CROSS, {3, 3});
  cv::morphologyEx(mask, mask, cv::MORPH_OPEN, cross);
  return KeepPerson(mask);
}

}  // namespace sweepfit
