// SPDX-License-Identifier: Apache-2.0
#include "capture/person_mask.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>
#include <vector>

namespace sweepfit {
namespace {

// Beyond this no evidence of a single pixel is trusted, ln units.
constexpr float kMostRatio = 12;

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

Components FindComponents(const cv::Mat1b& mask) {
  Components result;
  cv::Mat centroids;
  result.count = cv::connectedComponentsWithStats(
      mask, result.label, result.stats, centroids, 8, CV_32S);
  return result;
}

cv::Mat1b Select(const Components& components,
                 const std::vector<std::uint8_t>& value) {
  cv::Mat1b mask(components.label.size());
  for (int y = 0; y < mask.rows; ++y) {
    const int* label = components.label[y];
    std::uint8_t* row = mask[y];
    for (int x = 0; x < mask.cols; ++x) row[x] = value[label[x]];
  }
  return mask;
}

int BoxDistance(const cv::Rect& a, const cv::Rect& b) {
  const int dx = std::max({0, a.x - b.br().x, b.x - a.br().x});
  const int dy = std::max({0, a.y - b.br().y, b.y - a.br().y});
  return std::max(dx, dy);
}

// The largest component of those with a value, and those within `near` of its
// height.
cv::Mat1b KeepPerson(const Components& components,
                     const std::vector<std::uint8_t>& has_value,
                     double near,
                     double* stray) {
  constexpr double kSmallestShare = 0.005;
  int largest = 0;
  for (int i = 1; i < components.count; ++i) {
    if (!has_value[i]) continue;
    if (largest == 0 || components.Area(i) > components.Area(largest)) {
      largest = i;
    }
  }
  if (stray) *stray = 0;
  std::vector<std::uint8_t> value(components.count, 0);
  if (largest == 0) return Select(components, value);
  const cv::Rect person = components.Box(largest);
  const double area = components.Area(largest);
  for (int i = 1; i < components.count; ++i) {
    if (!has_value[i]) continue;
    if (i == largest || (components.Area(i) > kSmallestShare * area &&
                         BoxDistance(components.Box(i), person) <=
                             near * std::max(person.width, person.height))) {
      value[i] = 255;
    } else if (stray) {
      *stray += components.Area(i) / area;
    }
  }
  return Select(components, value);
}

// The person among the pixels above `grow` that hang together with one above
// `seed`.
cv::Mat1b PersonAbove(const cv::Mat1f& ratio,
                      double seed,
                      double grow,
                      double near,
                      double* stray) {
  cv::Mat1b low = ratio > grow;
  cv::medianBlur(low, low, 3);
  const Components components = FindComponents(low);
  std::vector<std::uint8_t> has_seed(components.count, 0);
  for (int y = 0; y < ratio.rows; ++y) {
    const float* row = ratio[y];
    const int* label = components.label[y];
    for (int x = 0; x < ratio.cols; ++x) {
      if (row[x] > seed) has_seed[label[x]] = 1;
    }
  }
  return KeepPerson(components, has_seed, near, stray);
}

cv::Mat Disc(int radius) {
  return cv::getStructuringElement(cv::MORPH_ELLIPSE,
                                   {2 * radius + 1, 2 * radius + 1});
}

// ln of the ratio of an even density of colours to the background's.
cv::Mat1f EvenRatio(const BackgroundEvidence& evidence) {
  return kLogEvenDensity - evidence.log_density;
}

// Densities of the person's colours, per cell of the picture, from pixels that
// are certain in the cell and the cells around it.
class PersonColours {
 public:
  PersonColours(const cv::Mat3f& lab, const cv::Mat1b& certain)
      : cell_(std::max(kSmallestCell,
                       std::max(lab.cols, lab.rows) / kCellsAlong)),
        columns_(lab.cols / cell_ + 1),
        rows_(lab.rows / cell_ + 1),
        histograms_(static_cast<std::size_t>(columns_) * rows_) {
    for (int y = 0; y < lab.rows; ++y) {
      for (int x = 0; x < lab.cols; ++x) {
        if (certain(y, x)) Add(x / cell_, y / cell_, BinOf(lab(y, x)));
      }
    }
  }

  // ln of the density of the colour at a pixel, per CIELAB unit cubed.
  float LogDensity(const cv::Vec3f& colour, int x, int y) const {
    constexpr float kEvenShare = 0.1f;
    constexpr float kEvenCount =
        100;  // of pixels; few certain ones tell little
    const Histogram& histogram =
        histograms_[(y / cell_) * columns_ + x / cell_];
    const float even = std::exp(kLogEvenDensity);
    if (histogram.count.empty()) return kLogEvenDensity;
    const float n = static_cast<float>(histogram.total);
    const float seen =
        Interpolate(histogram, colour) / (n * kBin * kBin * kBin);
    const float share = (1 - kEvenShare) * n / (n + kEvenCount);
    return std::log(share * seen + (1 - share) * even);
  }

 private:
  static constexpr int kSmallestCell = 16;  // px
  static constexpr int kCellsAlong = 10;
  static constexpr float kBin = 6;  // CIELAB units
  static constexpr int kBinsL = 18, kBinsAb = 29;
  static constexpr float kLowestAb = -84;

  struct Histogram {
    std::vector<float> count;  // empty: nothing is certain near
    int total = 0;
  };

  static int Clamp(float bin, int bins) {
    return std::clamp(static_cast<int>(bin), 0, bins - 1);
  }
  static int Index(int l, int a, int b) {
    return (l * kBinsAb + a) * kBinsAb + b;
  }
  static int BinOf(const cv::Vec3f& colour) {
    return Index(Clamp(colour[0] / kBin, kBinsL),
                 Clamp((colour[1] - kLowestAb) / kBin, kBinsAb),
                 Clamp((colour[2] - kLowestAb) / kBin, kBinsAb));
  }

  void Add(int column, int row, int bin) {
    for (int j = std::max(0, row - 1); j <= std::min(rows_ - 1, row + 1); ++j) {
      for (int i = std::max(0, column - 1);
           i <= std::min(columns_ - 1, column + 1);
           ++i) {
        Histogram& histogram = histograms_[j * columns_ + i];
        if (histogram.count.empty()) {
          histogram.count.assign(kBinsL * kBinsAb * kBinsAb, 0.f);
        }
        histogram.count[bin] += 1;
        ++histogram.total;
      }
    }
  }

  // Count per bin between the middles of bins.
  static float Interpolate(const Histogram& histogram,
                           const cv::Vec3f& colour) {
    const std::array<float, 3> at = {colour[0] / kBin - 0.5f,
                                     (colour[1] - kLowestAb) / kBin - 0.5f,
                                     (colour[2] - kLowestAb) / kBin - 0.5f};
    const std::array<int, 3> bins = {kBinsL, kBinsAb, kBinsAb};
    std::array<int, 3> low{}, high{};
    std::array<float, 3> t{};
    for (int c = 0; c < 3; ++c) {
      const float inside =
          std::clamp(at[c], 0.f, static_cast<float>(bins[c] - 1));
      low[c] = static_cast<int>(inside);
      high[c] = std::min(low[c] + 1, bins[c] - 1);
      t[c] = inside - static_cast<float>(low[c]);
    }
    float sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const int l = corner & 1 ? high[0] : low[0];
      const int a = corner & 2 ? high[1] : low[1];
      const int b = corner & 4 ? high[2] : low[2];
      sum += (corner & 1 ? t[0] : 1 - t[0]) * (corner & 2 ? t[1] : 1 - t[1]) *
             (corner & 4 ? t[2] : 1 - t[2]) * histogram.count[Index(l, a, b)];
    }
    return sum;
  }

  int cell_;
  int columns_, rows_;
  std::vector<Histogram> histograms_;
};

// ln of the ratio of the person's density to the background's.
cv::Mat1f PersonRatio(const BackgroundEvidence& evidence,
                      const cv::Mat1f& even_ratio,
                      const cv::Mat1b& certain) {
  const PersonColours colours(evidence.lab, certain);
  cv::Mat1f ratio(even_ratio.size());
  for (int y = 0; y < ratio.rows; ++y) {
    for (int x = 0; x < ratio.cols; ++x) {
      const float even = even_ratio(y, x);
      // What the colours of the person could not change is not looked up.
      ratio(y, x) = std::clamp(
          even > kMostRatio ? even
                            : colours.LogDensity(evidence.lab(y, x), x, y) -
                                  evidence.log_density(y, x),
          -kMostRatio,
          kMostRatio);
    }
  }
  return ratio;
}

float SquaredLength(const cv::Vec3f& v) {
  return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

// Cuts the uncertain pixels (non-zero) of a mask whose other pixels are given.
class Cut {
 public:
  Cut(const BackgroundEvidence& evidence,
      const cv::Mat1f& ratio,
      const cv::Mat1b& uncertain,
      const SegmentOptions& options,
      cv::Mat1b* mask)
      : evidence_(evidence),
        uncertain_(uncertain),
        smoothness_(static_cast<float>(options.smoothness)),
        mask_(*mask),
        node_(mask->size(), -1) {
    constexpr float kContrast = 3;  // CIELAB units per pixel
    const float sigma = evidence.sigma_l;
    per_contrast_ = 0.5f / (kContrast * kContrast + 2 * sigma * sigma);
    const int count = cv::countNonZero(uncertain);
    graph_.create(count, 8 * count);
    for (int y = 0; y < mask_.rows; ++y) {
      for (int x = 0; x < mask_.cols; ++x) {
        if (!uncertain(y, x)) continue;
        const int node = node_(y, x) = graph_.addVtx();
        graph_.addTermWeights(
            node, std::max(0.f, ratio(y, x)), std::max(0.f, -ratio(y, x)));
      }
    }
    for (int y = 0; y < mask_.rows; ++y) {
      for (int x = 0; x < mask_.cols; ++x) {
        Join(x, y, x + 1, y, 1);
        Join(x, y, x, y + 1, 1);
        Join(x, y, x + 1, y + 1, kDiagonal);
        Join(x, y, x - 1, y + 1, kDiagonal);
      }
    }
  }

  void Solve() {
    graph_.maxFlow();
    for (int y = 0; y < mask_.rows; ++y) {
      for (int x = 0; x < mask_.cols; ++x) {
        if (node_(y, x) < 0) continue;
        mask_(y, x) = graph_.inSourceSegment(node_(y, x)) ? 255 : 0;
      }
    }
  }

 private:
  static constexpr float kDiagonal = 0.70710678f;
  static constexpr float kLeast = 0.15f;  // so that textures hold together

  void Join(int x, int y, int other_x, int other_y, float share) {
    if (other_x < 0 || other_x >= mask_.cols || other_y >= mask_.rows) return;
    const int a = node_(y, x), b = node_(other_y, other_x);
    if (a < 0 && b < 0) return;
    const float squared = std::min(
        SquaredLength(evidence_.lab(y, x) - evidence_.lab(other_y, other_x)),
        SquaredLength(evidence_.change(y, x) -
                      evidence_.change(other_y, other_x)));
    const float weight =
        share * smoothness_ *
        (kLeast + (1 - kLeast) * std::exp(-squared * per_contrast_));
    if (a >= 0 && b >= 0) {
      graph_.addEdges(a, b, weight, weight);
    } else {
      const int node = a >= 0 ? a : b;
      const bool given = a >= 0 ? mask_(other_y, other_x) : mask_(y, x);
      graph_.addTermWeights(node, given ? weight : 0, given ? 0 : weight);
    }
  }

  const BackgroundEvidence& evidence_;
  const cv::Mat1b& uncertain_;
  float smoothness_;
  float per_contrast_ = 0;
  cv::Mat1b& mask_;
  cv::Mat1i node_;
  cv::detail::GCGraph<float> graph_;
};

// The components of `mask` that touch `core`.
cv::Mat1b Touching(const cv::Mat1b& mask, const cv::Mat1b& core) {
  Components components;
  components.count = cv::connectedComponents(mask, components.label, 8, CV_32S);
  std::vector<std::uint8_t> value(components.count, 0);
  for (int y = 0; y < mask.rows; ++y) {
    const int* label = components.label[y];
    const std::uint8_t* row = core[y];
    for (int x = 0; x < mask.cols; ++x) {
      if (row[x]) value[label[x]] = 255;
    }
  }
  value[0] = 0;
  return Select(components, value);
}

// The mask with its concavities closed, at low resolution: what a garment like
// the wall behind it lost may be there.
cv::Mat1b Closed(const cv::Mat1b& mask) {
  constexpr double kBridge = 0.03;  // of the person's height
  constexpr int kShrink = 4;
  const int radius =
      std::max(1, cvRound(kBridge * cv::boundingRect(mask).height / kShrink));
  cv::Mat1b small, closed;
  cv::resize(
      mask,
      small,
      {std::max(1, mask.cols / kShrink), std::max(1, mask.rows / kShrink)},
      0,
      0,
      cv::INTER_AREA);
  small = small > 0;
  cv::copyMakeBorder(
      small, small, radius, radius, radius, radius, cv::BORDER_CONSTANT, 0);
  cv::morphologyEx(small, small, cv::MORPH_CLOSE, Disc(radius));
  cv::resize(
      small({radius, radius, small.cols - 2 * radius, small.rows - 2 * radius}),
      closed,
      mask.size(),
      0,
      0,
      cv::INTER_NEAREST);
  return closed;
}

// What is enclosed by the mask.
cv::Mat1b Holes(const cv::Mat1b& mask) {
  cv::Mat1b outside;
  cv::copyMakeBorder(mask, outside, 1, 1, 1, 1, cv::BORDER_CONSTANT, 0);
  cv::floodFill(outside, {0, 0}, 255);
  return outside({1, 1, mask.cols, mask.rows}) == 0;
}

// Pixels that a person of this rough shape could cover and that their own
// evidence does not decide.
cv::Mat1b Uncertain(const cv::Mat1b& rough, const cv::Mat1f& ratio) {
  constexpr int kBand = 4;  // px around the rough outline
  constexpr float kCertain = 8, kInDoubt = -3;
  cv::Mat1b possible, core = ratio >= kCertain;
  const cv::Mat1b in_doubt = ratio > kInDoubt;
  cv::dilate(rough, possible, Disc(kBand));
  possible |= Touching(in_doubt | rough, rough);
  possible |= Closed(rough);
  possible |= Holes(rough);
  core &= rough;
  cv::erode(core, core, Disc(2), {-1, -1}, 1, cv::BORDER_CONSTANT, 255);
  return possible & ~core;
}

}  // namespace

cv::Mat1b RoughPerson(const BackgroundEvidence& evidence,
                      const SegmentOptions& options) {
  constexpr double kInDoubt = 5;  // ln units
  constexpr double kNear = 0.25;
  return PersonAbove(EvenRatio(evidence),
                     options.seed_ratio,
                     options.grow_ratio - kInDoubt,
                     kNear,
                     nullptr);
}

cv::Mat1b PersonMask(const BackgroundEvidence& evidence,
                     const SegmentOptions& options,
                     double* stray) {
  constexpr double kNear = 0.03;
  constexpr int kPasses = 2;
  constexpr float kCertain = 4;
  const cv::Mat1f even_ratio = EvenRatio(evidence);
  cv::Mat1b mask = PersonAbove(
      even_ratio, options.seed_ratio, options.grow_ratio, kNear, stray);
  cv::Mat1f ratio = even_ratio;
  cv::Mat1b certain;
  for (int pass = 0; pass < kPasses; ++pass) {
    certain = ratio > kCertain;
    certain &= mask;
    cv::erode(certain, certain, Disc(1));
    ratio = PersonRatio(evidence, even_ratio, certain);
    mask = PersonAbove(
        ratio, options.seed_ratio, options.grow_ratio, kNear, nullptr);
  }
  Cut(evidence, ratio, Uncertain(mask, ratio), options, &mask).Solve();
  const Components components = FindComponents(mask);
  return KeepPerson(components,
                    std::vector<std::uint8_t>(components.count, 1),
                    kNear,
                    nullptr);
}

}  // namespace sweepfit
