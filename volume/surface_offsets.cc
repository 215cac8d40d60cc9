// SPDX-License-Identifier: Apache-2.0
#include "volume/surface_offsets.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// Weight of an offset itself, 1 / metres^2: decides only where nothing else
// does.
constexpr double kMagnitudeWeight = 100;
// Far from converged over the whole body, but over the reach of the data.
constexpr int kIterations = 80;
constexpr double kTolerance = 1e-4;

// Vertices in parts of fixed size: sums come out the same for any number of
// threads.
class Parts {
 public:
  explicit Parts(int size) : size_(size), sums_((size + kPart - 1) / kPart) {}

  // visit(vertex) for all of them.
  template <typename Visit>
  void ForEach(Visit visit) const {
    tbb::parallel_for(size_t{0}, sums_.size(), [&](size_t part) {
      const int end = std::min(size_, static_cast<int>(part + 1) * kPart);
      for (int v = static_cast<int>(part) * kPart; v < end; ++v) visit(v);
    });
  }
  // Sum of value(vertex).
  template <typename Value>
  double Sum(Value value) {
    tbb::parallel_for(size_t{0}, sums_.size(), [&](size_t part) {
      const int end = std::min(size_, static_cast<int>(part + 1) * kPart);
      double sum = 0;
      for (int v = static_cast<int>(part) * kPart; v < end; ++v) {
        sum += value(v);
      }
      sums_[part] = sum;
    });
    double total = 0;
    for (const double sum : sums_) total += sum;
    return total;
  }

 private:
  static constexpr int kPart = 4096;
  int size_;
  std::vector<double> sums_;
};

// The residuals of mean curvature are linear in the offsets x,
//   scale_v (sum_w n_v.n_w x_w / |ring| - x_v) + rest_v.
class Bending {
 public:
  Bending(const std::vector<Vector3d>& vertices,
          const std::vector<Vector3d>& normals,
          const VertexRings& rings,
          const std::vector<double>& sigma_curvature)
      : rings_(rings) {
    const int n = rings.size();
    const double edge = MeanEdgeLength(vertices, rings);
    scale_.assign(n, 0);
    share_.assign(n, 0);
    rest_.assign(n, 0);
    first_.assign(n + 1, 0);
    for (int v = 0; v < n; ++v) {
      first_[v + 1] = first_[v] + static_cast<int>(rings[v].size());
    }
    cosine_.resize(first_[n]);
    Parts(n).ForEach([&](int v) {
      if (rings[v].empty()) return;
      scale_[v] = 2 / (edge * edge * sigma_curvature[v]);
      share_[v] = scale_[v] / static_cast<double>(rings[v].size());
      Vector3d sum = Vector3d::Zero();
      float* cosine = &cosine_[first_[v]];
      for (const int w : rings[v]) {
        sum += vertices[w] - vertices[v];
        *cosine++ = static_cast<float>(normals[v].dot(normals[w]));
      }
      rest_[v] = share_[v] * normals[v].dot(sum);
    });
  }

  double rest(int v) const { return rest_[v]; }
  double share(int v) const { return share_[v]; }
  // One row of the matrix times x.
  double Row(int v, const std::vector<double>& x) const {
    return share_[v] * Gather(v, x) - scale_[v] * x[v];
  }
  // One row of the transposed matrix times y, given share * y as well.
  double Column(int v,
                const std::vector<double>& y,
                const std::vector<double>& shared_y) const {
    return Gather(v, shared_y) - scale_[v] * y[v];
  }
  // Squared length of a column.
  double ColumnNorm(int v) const {
    double sum = scale_[v] * scale_[v];
    const float* cosine = &cosine_[first_[v]];
    for (const int w : rings_[v]) {
      const double entry = share_[w] * *cosine++;
      sum += entry * entry;
    }
    return sum;
  }

 private:
  double Gather(int v, const std::vector<double>& x) const {
    double sum = 0;
    const float* cosine = &cosine_[first_[v]];
    for (const int w : rings_[v]) sum += *cosine++ * x[w];
    return sum;
  }

  const VertexRings& rings_;
  std::vector<double> scale_, share_, rest_;
  std::vector<int> first_;
  std::vector<float> cosine_;  // of the normals along every edge
};

}  // namespace

std::vector<double> SolveOffsets(const std::vector<Vector3d>& vertices,
                                 const std::vector<Vector3d>& normals,
                                 const VertexRings& rings,
                                 const std::vector<OffsetTarget>& targets,
                                 const std::vector<double>& upper,
                                 const std::vector<double>& sigma_curvature) {
  const int n = rings.size();
  const Bending bending(vertices, normals, rings, sigma_curvature);
  std::vector<double> diagonal(n, kMagnitudeWeight), right(n, 0);
  for (const OffsetTarget& t : targets) {
    diagonal[t.vertex] += t.weight * t.slope * t.slope;
    right[t.vertex] += t.weight * t.slope * t.value;
  }
  // Conjugate gradients on the normal equations, preconditioned by their
  // diagonal; the matrix B^T B is never formed.
  Parts parts(n);
  std::vector<double> y(n), shared_y(n), preconditioner(n);
  parts.ForEach([&](int v) {
    y[v] = bending.rest(v);
    shared_y[v] = bending.share(v) * y[v];
    preconditioner[v] = 1 / (bending.ColumnNorm(v) + diagonal[v]);
  });
  std::vector<double> x(n, 0), residual(n), direction(n), image(n);
  const double right_norm = parts.Sum([&](int v) {
    residual[v] = right[v] - bending.Column(v, y, shared_y);
    direction[v] = preconditioner[v] * residual[v];
    return residual[v] * residual[v];
  });
  double energy = parts.Sum([&](int v) { return residual[v] * direction[v]; });
  const double enough = kTolerance * kTolerance * right_norm;
  for (int i = 0; i < kIterations && energy > 0; ++i) {
    parts.ForEach([&](int v) {
      y[v] = bending.Row(v, direction);
      shared_y[v] = bending.share(v) * y[v];
    });
    const double bend = parts.Sum([&](int v) {
      image[v] = bending.Column(v, y, shared_y) + diagonal[v] * direction[v];
      return direction[v] * image[v];
    });
    const double step = energy / bend;
    const double norm = parts.Sum([&](int v) {
      x[v] += step * direction[v];
      residual[v] -= step * image[v];
      return residual[v] * residual[v];
    });
    if (norm < enough) break;
    const double next = parts.Sum(
        [&](int v) { return preconditioner[v] * residual[v] * residual[v]; });
    const double keep = next / energy;
    energy = next;
    parts.ForEach([&](int v) {
      direction[v] = preconditioner[v] * residual[v] + keep * direction[v];
    });
  }
  for (int v = 0; v < n; ++v) x[v] = std::min(x[v], upper[v]);
  return x;
}

}  // namespace sweepfit
