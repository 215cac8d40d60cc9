// SPDX-License-Identifier: Apache-2.0
#include "model/self_intersection.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// True when the segment from p to q passes through the inside of triangle abc.
bool Pierces(const Vector3d& p,
             const Vector3d& q,
             const Vector3d& a,
             const Vector3d& b,
             const Vector3d& c) {
  const Vector3d normal = (b - a).cross(c - a);
  const double side_p = normal.dot(p - a);
  const double side_q = normal.dot(q - a);
  // Within this of the plane a point counts as in it, metres.
  constexpr double kTouching = 1e-9;
  const double touching = kTouching * normal.norm();
  if (!(std::min(side_p, side_q) < -touching &&
        std::max(side_p, side_q) > touching)) {
    return false;
  }
  // The same side of all three edges, seen along the segment.
  const Vector3d along = q - p;
  const double u = along.dot((a - p).cross(b - p));
  const double v = along.dot((b - p).cross(c - p));
  const double w = along.dot((c - p).cross(a - p));
  return (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
}

bool ShareVertex(const Triangle& s, const Triangle& t) {
  for (const int a : s) {
    for (const int b : t) {
      if (a == b) return true;
    }
  }
  return false;
}

bool Intersect(const TriangleMesh& mesh, const Triangle& s, const Triangle& t) {
  const auto& x = mesh.vertices;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    if (Pierces(x[s[i]], x[s[j]], x[t[0]], x[t[1]], x[t[2]]) ||
        Pierces(x[t[i]], x[t[j]], x[s[0]], x[s[1]], x[s[2]])) {
      return true;
    }
  }
  return false;
}

struct Cell {
  std::uint64_t key;
  int triangle;
};

}  // namespace

std::vector<std::pair<int, int>> SelfIntersections(const TriangleMesh& mesh) {
  std::vector<std::pair<int, int>> pairs;
  const int count = static_cast<int>(mesh.triangles.size());
  if (count == 0) return pairs;
  std::vector<Eigen::AlignedBox3d> boxes(count);
  Eigen::AlignedBox3d all;
  double size = 0;
  for (int t = 0; t < count; ++t) {
    for (const int v : mesh.triangles[t]) boxes[t].extend(mesh.vertices[v]);
    all.extend(boxes[t]);
    size += boxes[t].sizes().maxCoeff();
  }
  // A grid of cells of twice the mean triangle.
  const double cell = std::max(2 * size / count, 1e-9);
  std::vector<Cell> cells;
  for (int t = 0; t < count; ++t) {
    const auto index = [&](const Vector3d& p) {
      return ((p - all.min()) / cell).array().floor().cast<std::int64_t>();
    };
    const Eigen::Array<std::int64_t, 3, 1> low = index(boxes[t].min());
    const Eigen::Array<std::int64_t, 3, 1> high = index(boxes[t].max());
    for (std::int64_t i = low[0]; i <= high[0]; ++i) {
      for (std::int64_t j = low[1]; j <= high[1]; ++j) {
        for (std::int64_t k = low[2]; k <= high[2]; ++k) {
          const auto key = static_cast<std::uint64_t>(
              (i & 0x1fffff) << 42 | (j & 0x1fffff) << 21 | (k & 0x1fffff));
          cells.push_back({key, t});
        }
      }
    }
  }
  std::sort(cells.begin(), cells.end(), [](const Cell& a, const Cell& b) {
    return a.key != b.key ? a.key < b.key : a.triangle < b.triangle;
  });
  for (std::size_t begin = 0; begin < cells.size();) {
    std::size_t end = begin;
    while (end < cells.size() && cells[end].key == cells[begin].key) ++end;
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t j = i + 1; j < end; ++j) {
        const int s = cells[i].triangle;
        const int t = cells[j].triangle;
        if (!boxes[s].intersects(boxes[t]) ||
            ShareVertex(mesh.triangles[s], mesh.triangles[t])) {
          continue;
        }
        if (Intersect(mesh, mesh.triangles[s], mesh.triangles[t])) {
          pairs.emplace_back(s, t);
        }
      }
    }
    begin = end;
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace sweepfit
