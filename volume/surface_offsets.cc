// SPDX-License-Identifier: Apache-2.0
#include "volume/surface_offsets.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>

namespace sweepfit {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using RowMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

// Weight of an offset itself, 1 / metres^2: decides only where nothing else
// does.
constexpr double kMagnitudeWeight = 100;
// Far from converged over the whole body, but over the reach of the data.
constexpr int kIterations = 80;
constexpr double kTolerance = 1e-4;

// Curvature residual: matrix * offset + rest.
struct Bending {
  RowMatrix matrix;
  VectorXd rest;
};

Bending MakeBending(const std::vector<Vector3d>& vertices,
                    const std::vector<Vector3d>& normals,
                    const VertexRings& rings,
                    const std::vector<double>& sigma_curvature) {
  const int n = rings.size();
  double length = 0;
  size_t num_edges = 0;
  for (int v = 0; v < n; ++v) {
    for (const int w : rings[v]) length += (vertices[w] - vertices[v]).norm();
    num_edges += rings[v].size();
  }
  const double edge =
      length / static_cast<double>(std::max<size_t>(num_edges, 1));
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(num_edges + n);
  Bending bending{RowMatrix(n, n), VectorXd::Zero(n)};
  for (int v = 0; v < n; ++v) {
    if (rings[v].empty()) continue;
    const double scale = 2 / (edge * edge * sigma_curvature[v]);
    const double share = 1.0 / static_cast<double>(rings[v].size());
    Vector3d mean = Vector3d::Zero();
    for (const int w : rings[v]) {
      mean += share * vertices[w];
      entries.emplace_back(v, w, scale * share * normals[v].dot(normals[w]));
    }
    entries.emplace_back(v, v, -scale);
    bending.rest[v] = scale * normals[v].dot(mean - vertices[v]);
  }
  bending.matrix.setFromTriplets(entries.begin(), entries.end());
  return bending;
}

}  // namespace

std::vector<double> SolveOffsets(const std::vector<Vector3d>& vertices,
                                 const std::vector<Vector3d>& normals,
                                 const VertexRings& rings,
                                 const std::vector<OffsetTarget>& targets,
                                 const std::vector<double>& upper,
                                 const std::vector<double>& sigma_curvature) {
  const int n = rings.size();
  const Bending bending =
      MakeBending(vertices, normals, rings, sigma_curvature);
  const RowMatrix transposed = bending.matrix.transpose();
  RowMatrix matrix = transposed * bending.matrix;
  VectorXd right = -(transposed * bending.rest);
  VectorXd diagonal = VectorXd::Constant(n, kMagnitudeWeight);
  for (const OffsetTarget& t : targets) {
    diagonal[t.vertex] += t.weight * t.slope * t.slope;
    right[t.vertex] += t.weight * t.slope * t.value;
  }
  matrix.diagonal() += diagonal;
  Eigen::ConjugateGradient<RowMatrix, Eigen::Lower | Eigen::Upper> solver;
  solver.setMaxIterations(kIterations);
  solver.setTolerance(kTolerance);
  solver.compute(matrix);
  const VectorXd offset = solver.solve(right);
  std::vector<double> result(n);
  for (int v = 0; v < n; ++v) result[v] = std::min(offset[v], upper[v]);
  return result;
}

}  // namespace sweepfit
