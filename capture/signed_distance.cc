// SPDX-License-Identifier: Apache-2.0
// Sub-pixel signed distance of a silhouette, in pinhole pixels.
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/core/hal/intrin.hpp>

#include "capture/silhouette.h"

namespace sweepfit {
namespace {

using Polyline = std::vector<Eigen::Vector2d>;

// For each pixel the nearest point of the contour that is known so far. Close
// to the contour it is the exact foot point; from there it spreads by the
// 8-neighbour sequential transform of Danielsson, whose choice among foot
// points less than a pixel apart is good to a few hundredths of a pixel.
class NearestContourPoint {
 public:
  NearestContourPoint(int width, int height)
      : width_(width),
        height_(height),
        foot_x_(height, width + kLeft + kLanes, kNone),
        foot_y_(foot_x_.clone()),
        squared_(foot_x_.clone()) {}

  // Enters a piece of the contour into the pixels around it.
  void AddSegment(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    constexpr int kReach = 3;
    const int x_min = ClampX(std::floor(std::min(a.x(), b.x())) - kReach);
    const int x_max = ClampX(std::ceil(std::max(a.x(), b.x())) + kReach);
    const int y_min = ClampY(std::floor(std::min(a.y(), b.y())) - kReach);
    const int y_max = ClampY(std::ceil(std::max(a.y(), b.y())) + kReach);
    const Eigen::Vector2d along = b - a;
    const double squared_length = std::max(along.squaredNorm(), 1e-20);
    for (int y = y_min; y <= y_max; ++y) {
      for (int x = x_min; x <= x_max; ++x) {
        const Eigen::Vector2d p(x, y);
        const double s =
            std::clamp((p - a).dot(along) / squared_length, 0.0, 1.0);
        const Eigen::Vector2d foot = a + s * along;
        RowOf(y).Offer(
            x, static_cast<float>(foot.x()), static_cast<float>(foot.y()));
      }
    }
  }

  void Spread() {
    for (int y = 0; y < height_; ++y) SpreadRow(y, y - 1);
    for (int y = height_ - 1; y >= 0; --y) SpreadRow(y, y + 1);
  }

  // Infinite where there is no contour at all.
  float Distance(int x, int y) const {
    return std::sqrt(squared_(y, kLeft + x));
  }

 private:
  static constexpr float kNone = std::numeric_limits<float>::infinity();
  // Pixels beside the picture, without a foot point, so that those at its sides
  // have neighbours, and whole lanes.
  static constexpr int kLeft = 1;
  static constexpr int kLanes = cv::v_float32x4::nlanes;

  // One row of pixels; x = 0 is the first of the picture.
  struct Row {
    float y;
    float* foot_x;
    float* foot_y;
    float* squared;

    void Offer(int x, float at_x, float at_y) const {
      const float dx = at_x - static_cast<float>(x);
      const float dy = at_y - y;
      const float distance = dx * dx + dy * dy;
      if (distance < squared[x]) {
        squared[x] = distance;
        foot_x[x] = at_x;
        foot_y[x] = at_y;
      }
    }
  };

  Row RowOf(int y) {
    return {static_cast<float>(y),
            foot_x_[y] + kLeft,
            foot_y_[y] + kLeft,
            squared_[y] + kLeft};
  }

  int ClampX(double x) const {
    return static_cast<int>(std::clamp(x, 0.0, width_ - 1.0));
  }
  int ClampY(double y) const {
    return static_cast<int>(std::clamp(y, 0.0, height_ - 1.0));
  }

  void SpreadRow(int y, int previous_y) {
    const Row row = RowOf(y);
    if (previous_y >= 0 && previous_y < height_) {
      SpreadAcross(RowOf(previous_y), row);
    }
    const int last = width_ - 1;
    for (int x = 1; x <= last; ++x) {
      row.Offer(x, row.foot_x[x - 1], row.foot_y[x - 1]);
    }
    for (int x = last - 1; x >= 0; --x) {
      row.Offer(x, row.foot_x[x + 1], row.foot_y[x + 1]);
    }
  }

  // Offers what a row and its neighbours to either side know to the next row.
  void SpreadAcross(const Row& from, const Row& to) const {
    const cv::v_float32x4 y = cv::v_setall_f32(to.y);
    cv::v_float32x4 x(0, 1, 2, 3);
    for (int first = 0; first < width_; first += kLanes) {
      cv::v_float32x4 foot_x = cv::v_load(to.foot_x + first);
      cv::v_float32x4 foot_y = cv::v_load(to.foot_y + first);
      cv::v_float32x4 squared = cv::v_load(to.squared + first);
      for (int side = -1; side <= 1; ++side) {
        const cv::v_float32x4 at_x = cv::v_load(from.foot_x + first + side);
        const cv::v_float32x4 at_y = cv::v_load(from.foot_y + first + side);
        const cv::v_float32x4 dx = at_x - x;
        const cv::v_float32x4 dy = at_y - y;
        const cv::v_float32x4 distance = dx * dx + dy * dy;
        const cv::v_float32x4 nearer = distance < squared;
        foot_x = cv::v_select(nearer, at_x, foot_x);
        foot_y = cv::v_select(nearer, at_y, foot_y);
        squared = cv::v_select(nearer, distance, squared);
      }
      cv::v_store(to.foot_x + first, foot_x);
      cv::v_store(to.foot_y + first, foot_y);
      cv::v_store(to.squared + first, squared);
      x += cv::v_setall_f32(kLanes);
    }
    // The lanes beyond the picture.
    for (int i = width_; i < width_ + kLanes; ++i) {
      to.foot_x[i] = to.foot_y[i] = to.squared[i] = kNone;
    }
  }

  int width_, height_;
  // Infinite where none is known.
  cv::Mat1f foot_x_, foot_y_;
  cv::Mat1f squared_;
};

// How far pinhole pixels of the picture's own size fall outside the picture as
// taken; 0 without distortion.
int Overhang(const Camera& camera) {
  constexpr int kStep = 8;
  constexpr double kMaxShare = 0.1;
  double overhang = 0;
  const auto visit = [&](double x, double y) {
    const Eigen::Vector2d p = camera.Distort({x, y});
    overhang = std::max({overhang,
                         -p.x(),
                         -p.y(),
                         p.x() - (camera.width - 1),
                         p.y() - (camera.height - 1)});
  };
  for (int x = 0; x < camera.width + kStep; x += kStep) {
    visit(std::min(x, camera.width - 1), 0);
    visit(std::min(x, camera.width - 1), camera.height - 1);
  }
  for (int y = 0; y < camera.height + kStep; y += kStep) {
    visit(0, std::min(y, camera.height - 1));
    visit(camera.width - 1, std::min(y, camera.height - 1));
  }
  const double limit = kMaxShare * std::max(camera.width, camera.height);
  return static_cast<int>(std::ceil(std::min(overhang, limit)));
}

// The pixels enclosed by closed polylines, by the even-odd rule.
cv::Mat1b Enclosed(const std::vector<Polyline>& polylines, cv::Size size) {
  std::vector<std::vector<double>> crossings(size.height);
  for (const Polyline& polyline : polylines) {
    for (std::size_t i = 0; i < polyline.size(); ++i) {
      const Eigen::Vector2d* a = &polyline[i];
      const Eigen::Vector2d* b = &polyline[(i + 1) % polyline.size()];
      if (a->y() > b->y()) std::swap(a, b);
      const int first = static_cast<int>(std::max(0.0, std::ceil(a->y())));
      for (int y = first; y < std::min<double>(size.height, b->y()); ++y) {
        const double t = (y - a->y()) / (b->y() - a->y());
        crossings[y].push_back(a->x() + t * (b->x() - a->x()));
      }
    }
  }
  cv::Mat1b enclosed(size, 0);
  for (int y = 0; y < size.height; ++y) {
    std::vector<double>& row = crossings[y];
    std::sort(row.begin(), row.end());
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      const int first = static_cast<int>(std::max(0.0, std::ceil(row[i])));
      for (int x = first; x < std::min<double>(size.width, row[i + 1]); ++x) {
        enclosed(y, x) = 1;
      }
    }
  }
  return enclosed;
}

}  // namespace

cv::Mat1f SignedDistance(const Camera& camera, const cv::Mat1f& coverage) {
  const int overhang = Overhang(camera);
  cv::Mat1f padded = coverage;
  if (overhang > 0) {
    cv::copyMakeBorder(coverage,
                       padded,
                       overhang,
                       overhang,
                       overhang,
                       overhang,
                       cv::BORDER_REPLICATE);
  }
  const auto is_in_padded = [&](const Eigen::Vector2d& p) {
    return p.x() >= 0 && p.y() >= 0 && p.x() <= padded.cols - 1 &&
           p.y() <= padded.rows - 1;
  };

  std::vector<Polyline> contours = SubpixelContours(padded);
  NearestContourPoint nearest(camera.width, camera.height);
  const Eigen::Vector2d shift(overhang, overhang);
  for (Polyline& contour : contours) {
    std::vector<bool> is_seen(contour.size());
    for (std::size_t i = 0; i < contour.size(); ++i) {
      // The frame of the picture closes contours but is no boundary.
      is_seen[i] = is_in_padded(contour[i]);
      contour[i] = camera.Undistort(contour[i] - shift);
    }
    for (std::size_t i = 0; i < contour.size(); ++i) {
      const std::size_t j = (i + 1) % contour.size();
      if (is_seen[i] && is_seen[j]) nearest.AddSegment(contour[i], contour[j]);
    }
  }
  nearest.Spread();

  const cv::Mat1b enclosed =
      Enclosed(contours, cv::Size(camera.width, camera.height));
  const float farthest = static_cast<float>(camera.width + camera.height);
  cv::Mat1f distance(camera.height, camera.width);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const float d = std::min(nearest.Distance(x, y), farthest);
      distance(y, x) = enclosed(y, x) ? -d : d;
    }
  }
  return distance;
}

ImageSample SampleBilinear(const cv::Mat1f& image,
                           const Eigen::Vector2d& pixel) {
  // Written so that NaN goes to the border, too.
  const auto clamp = [](double value, double limit) {
    return value > 0 ? std::min(value, limit) : 0.0;
  };
  const double x = clamp(pixel.x(), image.cols - 1);
  const double y = clamp(pixel.y(), image.rows - 1);
  const int x0 = std::max(0, std::min(static_cast<int>(x), image.cols - 2));
  const int y0 = std::max(0, std::min(static_cast<int>(y), image.rows - 2));
  const int x1 = std::min(x0 + 1, image.cols - 1);
  const int y1 = std::min(y0 + 1, image.rows - 1);
  const double fx = x - x0;
  const double fy = y - y0;
  const double a = image(y0, x0);
  const double b = image(y0, x1);
  const double c = image(y1, x0);
  const double d = image(y1, x1);
  ImageSample sample;
  sample.value =
      (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d);
  sample.gradient = {(1 - fy) * (b - a) + fy * (d - c),
                     (1 - fx) * (c - a) + fx * (d - b)};
  return sample;
}

}  // namespace sweepfit
