// SPDX-License-Identifier: Apache-2.0
// Marching squares.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "capture/silhouette.h"

namespace sweepfit {
namespace {

constexpr float kLevel = 0.5f;

// A cell of marching squares has a pixel centre at each corner. The contour
// enters and leaves it through its edges.
enum Edge : int { kTop, kRight, kBottom, kLeft };
enum Corner : unsigned {
  kTopLeft = 1,
  kTopRight = 2,
  kBottomRight = 4,
  kBottomLeft = 8
};

struct Passage {
  Edge from;
  Edge to;
};

// How the contour passes a cell, the inside to its left, by the set of corners
// inside. At the two saddles the centre of the cell decides what is joined.
struct Passages {
  int count = 0;
  std::array<Passage, 2> passage{};
};

Passages CellPassages(unsigned inside, bool centre_inside) {
  switch (inside) {
    case kTopLeft:
      return {1, {{{kLeft, kTop}}}};
    case kTopRight:
      return {1, {{{kTop, kRight}}}};
    case kBottomRight:
      return {1, {{{kRight, kBottom}}}};
    case kBottomLeft:
      return {1, {{{kBottom, kLeft}}}};
    case kTopLeft | kTopRight:
      return {1, {{{kLeft, kRight}}}};
    case kTopRight | kBottomRight:
      return {1, {{{kTop, kBottom}}}};
    case kBottomRight | kBottomLeft:
      return {1, {{{kRight, kLeft}}}};
    case kBottomLeft | kTopLeft:
      return {1, {{{kBottom, kTop}}}};
    case kTopRight | kBottomRight | kBottomLeft:
      return {1, {{{kTop, kLeft}}}};
    case kTopLeft | kBottomRight | kBottomLeft:
      return {1, {{{kRight, kTop}}}};
    case kTopLeft | kTopRight | kBottomLeft:
      return {1, {{{kBottom, kRight}}}};
    case kTopLeft | kTopRight | kBottomRight:
      return {1, {{{kLeft, kBottom}}}};
    case kTopLeft | kBottomRight:
      if (centre_inside) return {2, {{{kRight, kTop}, {kLeft, kBottom}}}};
      return {2, {{{kLeft, kTop}, {kRight, kBottom}}}};
    case kTopRight | kBottomLeft:
      if (centre_inside) return {2, {{{kTop, kLeft}, {kBottom, kRight}}}};
      return {2, {{{kTop, kRight}, {kBottom, kLeft}}}};
    default:
      return {};
  }
}

// The box of pixels inside; empty when there are none.
cv::Rect InsideBox(const cv::Mat1f& coverage) {
  int x_min = coverage.cols, x_max = -1, y_min = coverage.rows, y_max = -1;
  for (int y = 0; y < coverage.rows; ++y) {
    const float* row = coverage[y];
    const float* end = row + coverage.cols;
    const float* first =
        std::find_if(row, end, [](float v) { return v > kLevel; });
    if (first == end) continue;
    const float* last = end - 1;
    while (*last <= kLevel) --last;
    x_min = std::min(x_min, static_cast<int>(first - row));
    x_max = std::max(x_max, static_cast<int>(last - row));
    y_min = std::min(y_min, y);
    y_max = y;
  }
  if (x_max < 0) return {};
  return {x_min, y_min, x_max - x_min + 1, y_max - y_min + 1};
}

// The contour as a successor for every grid edge that it crosses. Edge
// 2 (y W + x) goes right from the pixel (x, y), the next number goes down.
class EdgeGraph {
 public:
  explicit EdgeGraph(const cv::Mat1f& coverage) : coverage_(coverage) {
    const cv::Rect inside = InsideBox(coverage);
    if (inside.empty()) return;
    origin_ = {inside.x - 1, inside.y - 1};
    width_ = inside.width + 2;
    const int height = inside.height + 2;
    next_.assign(2 * static_cast<std::size_t>(width_) * height, kNone);
    for (int y = 0; y + 1 < height; ++y) {
      for (int x = 0; x + 1 < width_; ++x) AddCell(x, y);
    }
  }

  std::vector<std::vector<Eigen::Vector2d>> TakePolylines() {
    std::vector<std::vector<Eigen::Vector2d>> polylines;
    for (std::size_t start = 0; start < next_.size(); ++start) {
      if (next_[start] == kNone) continue;
      std::vector<Eigen::Vector2d> polyline;
      for (std::int32_t edge = static_cast<std::int32_t>(start);
           next_[edge] != kNone;) {
        polyline.push_back(Crossing(edge));
        edge = std::exchange(next_[edge], kNone);
      }
      polylines.push_back(std::move(polyline));
    }
    return polylines;
  }

 private:
  static constexpr std::int32_t kNone = -1;

  // Coverage at a node of the graph; nothing is covered outside the picture.
  float At(int x, int y) const {
    x += origin_.x;
    y += origin_.y;
    const bool in_picture =
        x >= 0 && y >= 0 && x < coverage_.cols && y < coverage_.rows;
    return in_picture ? coverage_(y, x) : 0.f;
  }

  std::int32_t EdgeIndex(int x, int y, Edge edge) const {
    switch (edge) {
      case kTop:
        return 2 * (y * width_ + x);
      case kBottom:
        return 2 * ((y + 1) * width_ + x);
      case kLeft:
        return 2 * (y * width_ + x) + 1;
      default:
        return 2 * (y * width_ + x + 1) + 1;
    }
  }

  void AddCell(int x, int y) {
    const float a = At(x, y);
    const float b = At(x + 1, y);
    const float c = At(x + 1, y + 1);
    const float d = At(x, y + 1);
    const unsigned inside =
        (a > kLevel ? kTopLeft : 0u) | (b > kLevel ? kTopRight : 0u) |
        (c > kLevel ? kBottomRight : 0u) | (d > kLevel ? kBottomLeft : 0u);
    const Passages cell =
        CellPassages(inside, 0.25f * (a + b + c + d) > kLevel);
    for (int i = 0; i < cell.count; ++i) {
      next_[EdgeIndex(x, y, cell.passage[i].from)] =
          EdgeIndex(x, y, cell.passage[i].to);
    }
  }

  // Where the level crosses an edge, pixels of the picture.
  Eigen::Vector2d Crossing(std::int32_t edge) const {
    const int x = edge / 2 % width_;
    const int y = edge / 2 / width_;
    const bool goes_right = edge % 2 == 0;
    const double a = At(x, y);
    const double b = goes_right ? At(x + 1, y) : At(x, y + 1);
    const double t = (kLevel - a) / (b - a);
    return {origin_.x + x + (goes_right ? t : 0.0),
            origin_.y + y + (goes_right ? 0.0 : t)};
  }

  const cv::Mat1f& coverage_;
  cv::Point origin_;
  int width_ = 0;
  std::vector<std::int32_t> next_;
};

double EnclosedArea(const std::vector<Eigen::Vector2d>& polyline) {
  double twice_area = 0;
  for (std::size_t i = 0; i < polyline.size(); ++i) {
    const Eigen::Vector2d& a = polyline[i];
    const Eigen::Vector2d& b = polyline[(i + 1) % polyline.size()];
    twice_area += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * std::abs(twice_area);
}

}  // namespace

std::vector<std::vector<Eigen::Vector2d>> SubpixelContours(
    const cv::Mat1f& coverage) {
  std::vector<std::vector<Eigen::Vector2d>> polylines =
      EdgeGraph(coverage).TakePolylines();
  std::stable_sort(
      polylines.begin(), polylines.end(), [](const auto& a, const auto& b) {
        return EnclosedArea(a) > EnclosedArea(b);
      });
  return polylines;
}

}  // namespace sweepfit
