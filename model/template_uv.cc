// SPDX-License-Identifier: Apache-2.0
#include "model/template_uv.h"

#include <glog/logging.h>

#include <algorithm>
#include <map>
#include <numeric>

namespace sweepfit {
namespace {

constexpr double kGutter = 16.0 / 2048;

// Mean lengths of the edges between consecutive grid lines, accumulated.
class LineSpacing {
 public:
  void Add(int line, double length) {
    sum_[line] += length;
    ++count_[line];
  }

  // Position of each line, the first at 0. Lines are consecutive.
  std::map<int, double> Positions() const {
    std::map<int, double> position;
    double at = 0;
    for (const auto& [line, sum] : sum_) {
      position[line] = at;
      at += sum / count_.at(line);
    }
    position[sum_.rbegin()->first + 1] = at;
    return position;
  }

 private:
  std::map<int, double> sum_;
  std::map<int, int> count_;
};

// A chart of the left half as a rectangle in metres.
struct Rectangle {
  std::map<int, double> column, row;
  bool flip = false;  // columns run against u, so that no chart is mirrored
  double width() const { return column.rbegin()->second; }
  double height() const { return row.rbegin()->second; }
};

std::vector<Rectangle> MeasureCharts(
    const HalfComplex& half, const std::vector<Eigen::Vector3d>& vertices) {
  std::vector<LineSpacing> columns(half.charts.size());
  std::vector<LineSpacing> rows(half.charts.size());
  for (size_t q = 0; q < half.quads.size(); ++q) {
    const int chart = half.quad_chart[q];
    for (int i = 0; i < 4; ++i) {
      const ChartCorner& a = half.quad_corner[q][i];
      const ChartCorner& b = half.quad_corner[q][(i + 1) % 4];
      const double length =
          (vertices[half.quads[q][i]] - vertices[half.quads[q][(i + 1) % 4]])
              .norm();
      if (a.row == b.row) {
        columns[chart].Add(std::min(a.column, b.column), length);
      } else {
        rows[chart].Add(std::min(a.row, b.row), length);
      }
    }
  }
  std::vector<Rectangle> rectangles;
  for (size_t c = 0; c < half.charts.size(); ++c)
    rectangles.push_back({columns[c].Positions(), rows[c].Positions()});
  for (size_t q = 0; q < half.quads.size(); ++q) {
    const auto& corner = half.quad_corner[q];
    // Counter-clockwise unless the first edge is followed by a right turn.
    const int turn =
        (corner[1].column - corner[0].column) *
            (corner[2].row - corner[1].row) -
        (corner[1].row - corner[0].row) * (corner[2].column - corner[1].column);
    rectangles[half.quad_chart[q]].flip = turn < 0;
  }
  return rectangles;
}

// A rectangle to be packed; `chart` with `side` 0 left, 1 right.
struct Piece {
  int chart = 0;
  int side = 0;
  double width = 0;
  double height = 0;
  double x = 0, y = 0;
};

// Puts pieces, in the order given, on shelves of width 1 at a scale; returns
// the height used.
double PackShelves(double scale, std::vector<Piece>* pieces) {
  double x = kGutter;
  double y = kGutter;
  double shelf = 0;
  for (Piece& piece : *pieces) {
    const double width = piece.width * scale;
    if (x + width + kGutter > 1) {
      x = kGutter;
      y += shelf + kGutter;
      shelf = 0;
    }
    if (x + width + kGutter > 1) return 2;  // wider than a shelf
    piece.x = x;
    piece.y = y;
    x += width + kGutter;
    shelf = std::max(shelf, piece.height * scale);
  }
  return y + shelf + kGutter;
}

// The largest scale at which all pieces fit into the unit square.
double Pack(std::vector<Piece>* pieces) {
  std::stable_sort(
      pieces->begin(), pieces->end(), [](const Piece& a, const Piece& b) {
        return a.height > b.height;
      });
  // Fitting is not quite monotone in the scale: try from large to small.
  double area = 0;
  for (const Piece& piece : *pieces) area += piece.width * piece.height;
  CHECK_GT(area, 0);
  double scale = 1 / std::sqrt(area);
  while (PackShelves(scale, pieces) > 1) scale *= 0.995;
  return scale;
}

}  // namespace

std::vector<std::array<Eigen::Vector2f, 4>> UnrollCharts(
    const HalfComplex& half,
    const std::vector<Eigen::Vector3d>& half_vertices) {
  const std::vector<Rectangle> rectangles = MeasureCharts(half, half_vertices);
  std::vector<Piece> pieces;
  for (size_t c = 0; c < rectangles.size(); ++c) {
    const bool symmetric = half.charts[c].symmetric;
    const Rectangle& rectangle = rectangles[c];
    const double width = rectangle.width() * (symmetric ? 2 : 1);
    for (int side = 0; side < (symmetric ? 1 : 2); ++side) {
      pieces.push_back({static_cast<int>(c), side, width, rectangle.height()});
    }
  }
  const double scale = Pack(&pieces);
  std::vector<std::array<const Piece*, 2>> piece_of(rectangles.size());
  for (const Piece& piece : pieces) {
    piece_of[piece.chart][piece.side] = &piece;
    if (half.charts[piece.chart].symmetric) piece_of[piece.chart][1] = &piece;
  }

  const size_t count = half.quads.size();
  std::vector<std::array<Eigen::Vector2f, 4>> uv(2 * count);
  for (size_t q = 0; q < count; ++q) {
    const int chart = half.quad_chart[q];
    const Rectangle& rectangle = rectangles[chart];
    const bool symmetric = half.charts[chart].symmetric;
    for (int i = 0; i < 4; ++i) {
      const ChartCorner& corner = half.quad_corner[q][i];
      const double x = rectangle.column.at(corner.column);
      const double y = rectangle.row.at(corner.row);
      const double width = rectangle.width();
      const Piece& left = *piece_of[chart][0];
      const Piece& right = *piece_of[chart][1];
      double left_x = symmetric ? width + x : x;
      double right_x = width - x;
      if (rectangle.flip) std::swap(left_x, right_x);
      // The right half's quads run the other way round: 0, 3, 2, 1.
      const int j = (4 - i) % 4;
      uv[q][i] = Eigen::Vector2d(left.x + scale * left_x, left.y + scale * y)
                     .cast<float>();
      uv[count + q][j] =
          Eigen::Vector2d(right.x + scale * right_x, right.y + scale * y)
              .cast<float>();
    }
  }
  return uv;
}

}  // namespace sweepfit
