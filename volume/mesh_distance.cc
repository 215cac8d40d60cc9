// SPDX-License-Identifier: Apache-2.0
#include "volume/mesh_distance.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "model/closest_point.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;
using Point = Eigen::Matrix<std::int64_t, 2, 1>;

constexpr int kSide = BlockGrid::kSide;

// A triangle with an edge longer than this, in voxels, is large: it may pass
// voxels that none of its vertices is near.
constexpr double kLargeEdge = 2;

// Plan coordinates are rounded to this share of a voxel, so that which side of
// an edge a grid line passes is exact.
constexpr double kUnits = 1 << 16;

// Lists per key from (key, item) pairs that are produced twice by
// for_each(emit): first to be counted, then to be filed.
template <typename ForEach>
void FileByKey(std::int64_t num_keys,
               ForEach for_each,
               std::vector<int>* first,
               std::vector<int>* items) {
  first->assign(num_keys + 1, 0);
  for_each([&](std::int64_t key, int) { ++(*first)[key + 1]; });
  for (std::int64_t k = 0; k < num_keys; ++k) (*first)[k + 1] += (*first)[k];
  items->resize(first->back());
  std::vector<int> next(first->begin(), first->end() - 1);
  for_each([&](std::int64_t key, int item) { (*items)[next[key]++] = item; });
}

// On which side of the line from a to b the point p lies: +1 left, -1 right. A
// point on the line is moved by an infinitesimal amount along x, and by a still
// smaller one along y.
int SideOfEdge(const Point& a, const Point& b, const Point& p) {
  const Point ab = b - a;
  const std::int64_t cross =
      ab.x() * (p.y() - a.y()) - ab.y() * (p.x() - a.x());
  if (cross != 0) return cross > 0 ? 1 : -1;
  if (ab.y() != 0) return ab.y() < 0 ? 1 : -1;
  return ab.x() >= 0 ? 1 : -1;
}

}  // namespace

MeshDistance::MeshDistance(const TriangleMesh& mesh,
                           double voxel_size,
                           double band)
    : mesh_(mesh), voxel_size_(voxel_size), band_(band) {
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity());
  Vector3d high = -low;
  for (const Triangle& triangle : mesh.triangles) {
    for (const int v : triangle) {
      low = low.cwiseMin(mesh.vertices[v]);
      high = high.cwiseMax(mesh.vertices[v]);
    }
  }
  const auto block_of = [&](const Vector3d& p) -> Vector3i {
    return (p / (kSide * voxel_size)).array().floor().cast<int>();
  };
  const Vector3d margin = Vector3d::Constant(band + voxel_size);
  first_block_ = block_of(low - margin);
  num_blocks_ = block_of(high + margin) - first_block_ + Vector3i::Ones();

  FileByKey(
      static_cast<std::int64_t>(mesh.vertices.size()),
      [&](auto emit) {
        for (size_t t = 0; t < mesh.triangles.size(); ++t) {
          for (const int v : mesh.triangles[t]) emit(v, static_cast<int>(t));
        }
      },
      &first_around_,
      &around_);
  SortIntoBlocks();
  FindCrossings();
}

std::int64_t MeshDistance::BlockAt(const Vector3i& block_index) const {
  const Vector3i local = block_index - first_block_;
  if ((local.array() < 0).any() ||
      (local.array() >= num_blocks_.array()).any()) {
    return -1;
  }
  return (static_cast<std::int64_t>(local.x()) * num_blocks_.y() + local.y()) *
             num_blocks_.z() +
         local.z();
}

void MeshDistance::SortIntoBlocks() {
  const std::int64_t num_blocks = static_cast<std::int64_t>(num_blocks_.x()) *
                                  num_blocks_.y() * num_blocks_.z();
  // All blocks with a voxel in the box widened by the band.
  const auto for_blocks =
      [&](const Vector3d& low, const Vector3d& high, int item, auto& emit) {
        const Vector3i from = ((low.array() - band_) / voxel_size_)
                                  .ceil()
                                  .cast<int>()
                                  .unaryExpr([](int i) { return i >> 3; });
        const Vector3i to = ((high.array() + band_) / voxel_size_)
                                .floor()
                                .cast<int>()
                                .unaryExpr([](int i) { return i >> 3; });
        for (int x = from.x(); x <= to.x(); ++x) {
          for (int y = from.y(); y <= to.y(); ++y) {
            const std::int64_t row = BlockAt({x, y, from.z()});
            for (int z = from.z(); z <= to.z(); ++z) {
              emit(row + z - from.z(), item);
            }
          }
        }
      };
  FileByKey(
      num_blocks,
      [&](auto emit) {
        for (size_t v = 0; v < mesh_.vertices.size(); ++v) {
          if (first_around_[v] == first_around_[v + 1]) continue;
          const Vector3d& p = mesh_.vertices[v];
          for_blocks(p, p, static_cast<int>(v), emit);
        }
      },
      &first_vertex_,
      &vertices_);
  FileByKey(
      num_blocks,
      [&](auto emit) {
        for (size_t t = 0; t < mesh_.triangles.size(); ++t) {
          const Vector3d& a = mesh_.vertices[mesh_.triangles[t][0]];
          const Vector3d& b = mesh_.vertices[mesh_.triangles[t][1]];
          const Vector3d& c = mesh_.vertices[mesh_.triangles[t][2]];
          const double longest = std::max({(b - a).squaredNorm(),
                                           (c - b).squaredNorm(),
                                           (a - c).squaredNorm()});
          const double large = kLargeEdge * voxel_size_;
          if (longest <= large * large) continue;
          for_blocks(a.cwiseMin(b).cwiseMin(c),
                     a.cwiseMax(b).cwiseMax(c),
                     static_cast<int>(t),
                     emit);
        }
      },
      &first_large_,
      &large_);
}

void MeshDistance::FindCrossings() {
  const Vector3i first_voxel = kSide * first_block_;
  const int width = kSide * num_blocks_.x(), height = kSide * num_blocks_.y();
  // Plan coordinates relative to the box, and in voxels.
  std::vector<Point> plan(mesh_.vertices.size());
  for (size_t v = 0; v < plan.size(); ++v) {
    for (int axis = 0; axis < 2; ++axis) {
      plan[v][axis] = std::llround(
          (mesh_.vertices[v][axis] / voxel_size_ - first_voxel[axis]) * kUnits);
    }
  }
  const auto units = static_cast<std::int64_t>(kUnits);
  const auto for_each = [&](auto emit) {
    for (const Triangle& triangle : mesh_.triangles) {
      const Point& a = plan[triangle[0]];
      const Point& b = plan[triangle[1]];
      const Point& c = plan[triangle[2]];
      // The voxels whose centres may lie within.
      const Point low = a.cwiseMin(b).cwiseMin(c),
                  high = a.cwiseMax(b).cwiseMax(c);
      const std::int64_t x0 = (low.x() + units - 1) / units;
      const std::int64_t y0 = (low.y() + units - 1) / units;
      for (std::int64_t x = x0; x * units <= high.x(); ++x) {
        for (std::int64_t y = y0; y * units <= high.y(); ++y) {
          const Point p(x * units, y * units);
          const int side = SideOfEdge(a, b, p);
          if (SideOfEdge(b, c, p) != side || SideOfEdge(c, a, p) != side) {
            continue;
          }
          emit(triangle, x * height + y, p, side);
        }
      }
    }
  };
  first_crossing_.assign(static_cast<size_t>(width) * height + 1, 0);
  for_each([&](const Triangle&, std::int64_t column, const Point&, int) {
    ++first_crossing_[column + 1];
  });
  for (size_t i = 0; i + 1 < first_crossing_.size(); ++i) {
    first_crossing_[i + 1] += first_crossing_[i];
  }
  crossings_.resize(first_crossing_.back());
  std::vector<int> next(first_crossing_.begin(), first_crossing_.end() - 1);
  for_each([&](const Triangle& triangle,
               std::int64_t column,
               const Point& p,
               int side) {
    // Weights of the corners: areas opposite to them.
    double area[3], sum = 0;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2d u =
          (plan[triangle[(k + 1) % 3]] - p).cast<double>();
      const Eigen::Vector2d w =
          (plan[triangle[(k + 2) % 3]] - p).cast<double>();
      area[k] = u.x() * w.y() - u.y() * w.x();
      sum += area[k];
    }
    double z = 0;
    for (int k = 0; k < 3; ++k) {
      const double weight = sum != 0 ? area[k] / sum : 1.0 / 3;
      z += weight * mesh_.vertices[triangle[k]].z();
    }
    // Seen from +z a triangle that runs left faces up: the line leaves there.
    crossings_[next[column]++] = {static_cast<float>(z / voxel_size_),
                                  static_cast<std::int8_t>(-side)};
  });
}

BlockGrid::BlockValues MeshDistance::Evaluate(
    const Vector3i& block_index) const {
  BlockGrid::BlockValues values;
  const std::int64_t at = BlockAt(block_index);
  if (at < 0) {
    values.fill(static_cast<float>(band_));
    return values;
  }
  const Vector3i first = kSide * block_index;
  // The nearest vertex of every voxel, in voxels from the block's first one.
  std::array<float, BlockGrid::kBlockSize> nearest;
  std::array<int, BlockGrid::kBlockSize> vertex;
  const auto band = static_cast<float>(band_ / voxel_size_);
  nearest.fill(std::numeric_limits<float>::infinity());
  vertex.fill(-1);
  for (int i = first_vertex_[at]; i < first_vertex_[at + 1]; ++i) {
    const int v = vertices_[i];
    const Eigen::Vector3f p =
        (mesh_.vertices[v] / voxel_size_ - first.cast<double>()).cast<float>();
    Vector3i from, to;
    for (int axis = 0; axis < 3; ++axis) {
      from[axis] = std::max(0, static_cast<int>(std::ceil(p[axis] - band)));
      to[axis] =
          std::min(kSide - 1, static_cast<int>(std::floor(p[axis] + band)));
    }
    for (int x = from.x(); x <= to.x(); ++x) {
      const float dx = static_cast<float>(x) - p.x();
      for (int y = from.y(); y <= to.y(); ++y) {
        const float dy = static_cast<float>(y) - p.y();
        const float dxy = dx * dx + dy * dy;
        for (int z = from.z(); z <= to.z(); ++z) {
          const float dz = static_cast<float>(z) - p.z();
          const float d = dxy + dz * dz;
          const int o = x << 6 | y << 3 | z;
          if (d < nearest[o]) {
            nearest[o] = d;
            vertex[o] = v;
          }
        }
      }
    }
  }
  const int height = kSide * num_blocks_.y();
  const Vector3i local = kSide * (block_index - first_block_);
  for (int column = 0; column < kSide * kSide; ++column) {
    const int x = column >> 3, y = column & 7;
    const std::int64_t c =
        static_cast<std::int64_t>(local.x() + x) * height + local.y() + y;
    for (int z = 0; z < kSide; ++z) {
      const int o = column << 3 | z;
      int winding = 0;
      for (int i = first_crossing_[c]; i < first_crossing_[c + 1]; ++i) {
        if (crossings_[i].z < static_cast<float>(first.z() + z)) {
          winding += crossings_[i].winding;
        }
      }
      const Vector3d point =
          voxel_size_ * (first + Vector3i(x, y, z)).cast<double>();
      double squared = band_ * band_;
      const auto try_triangle = [&](int t) {
        const Triangle& triangle = mesh_.triangles[t];
        const Vector3d on_mesh =
            ClosestPointOnTriangle(point,
                                   mesh_.vertices[triangle[0]],
                                   mesh_.vertices[triangle[1]],
                                   mesh_.vertices[triangle[2]])
                .point;
        squared = std::min(squared, (on_mesh - point).squaredNorm());
      };
      if (vertex[o] >= 0) {
        for (int i = first_around_[vertex[o]]; i < first_around_[vertex[o] + 1];
             ++i) {
          try_triangle(around_[i]);
        }
      }
      for (int i = first_large_[at]; i < first_large_[at + 1]; ++i) {
        try_triangle(large_[i]);
      }
      const double distance = std::sqrt(squared);
      values[o] = static_cast<float>(winding > 0 ? -distance : distance);
    }
  }
  return values;
}

std::vector<BlockGrid::Block> MeshDistance::Blocks() const {
  std::vector<BlockGrid::Block> all;
  for (int x = 0; x < num_blocks_.x(); ++x) {
    for (int y = 0; y < num_blocks_.y(); ++y) {
      for (int z = 0; z < num_blocks_.z(); ++z) {
        all.push_back({first_block_ + Vector3i(x, y, z), {}});
      }
    }
  }
  std::vector<char> keep(all.size(), 0);
  tbb::parallel_for(size_t{0}, all.size(), [&](size_t b) {
    all[b].values = Evaluate(all[b].index);
    keep[b] = *std::min_element(all[b].values.begin(), all[b].values.end()) <
              static_cast<float>(band_);
  });
  size_t count = 0;
  for (size_t b = 0; b < all.size(); ++b) {
    if (keep[b]) all[count++] = all[b];
  }
  all.resize(count);
  return all;
}

}  // namespace sweepfit
