// SPDX-License-Identifier: Apache-2.0
#include "solver/relax_surface.h"

#include <Eigen/Geometry>
#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>
#include <algorithm>

#include "model/vertex_neighbours.h"
#include "solver/displacement.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

constexpr int kMaxRounds = 60;
// Stiffness around a vertex that is torn for the first time, against the pull
// towards where it was; its growth with every round more; the share of it that
// the neighbours get.
constexpr double kStiffness = 0.25;
constexpr double kGrowth = 2;
constexpr double kNeighbourShare = 0.5;
constexpr double kStiffest = 1e6;
// Edges of this length are as stiff as their ends, shorter ones stiffer.
constexpr double kSpacing = 0.010;      // metres
constexpr double kShortestEdge = 1e-4;  // metres
// A face has turned below this cosine to its normal on the reference: 45
// degrees. One that stands nearly upright on the skin turns over in motion.
constexpr double kMinCosine = 0.7;
// Edges longer than this many times that of the reference are torn.
constexpr double kMaxStretch = 3.5;

Vector3d FaceNormal(const Triangle& t, const std::vector<Vector3d>& x) {
  return (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).stableNormalized();
}

class Relaxation {
 public:
  Relaxation(const BodyTopology& topology,
             const std::vector<Vector3d>& reference)
      : reference_(reference),
        triangles_(TriangulateQuads(topology.quads, reference)),
        neighbours_(VertexNeighbours(topology.quads, reference.size())) {
    for (const Triangle& t : triangles_) {
      reference_normal_.push_back(FaceNormal(t, reference));
    }
  }

  // Marks the vertices of turned faces and torn edges; counts both.
  std::vector<bool> FindTorn(const std::vector<Vector3d>& x,
                             RelaxedSurface* result) const {
    std::vector<bool> torn(x.size(), false);
    result->turned_faces_left = 0;
    result->long_edges_left = 0;
    for (size_t i = 0; i < triangles_.size(); ++i) {
      if (FaceNormal(triangles_[i], x).dot(reference_normal_[i]) >=
          kMinCosine) {
        continue;
      }
      ++result->turned_faces_left;
      for (const int v : triangles_[i]) torn[v] = true;
    }
    for (size_t v = 0; v < x.size(); ++v) {
      for (const int n : neighbours_[v]) {
        if (n < static_cast<int>(v)) continue;
        const double before = (reference_[v] - reference_[n]).norm();
        if ((x[v] - x[n]).norm() <= kMaxStretch * before) continue;
        ++result->long_edges_left;
        torn[v] = torn[n] = true;
      }
    }
    return torn;
  }

  void Stiffen(const std::vector<bool>& torn,
               std::vector<double>* stiffness) const {
    const std::vector<double> before = *stiffness;
    const auto raise = [&](int v, double least) {
      (*stiffness)[v] = std::max((*stiffness)[v], least);
    };
    for (size_t v = 0; v < torn.size(); ++v) {
      if (!torn[v]) continue;
      const double own = std::clamp(kGrowth * before[v], kStiffness, kStiffest);
      raise(static_cast<int>(v), own);
      for (const int n : neighbours_[v]) raise(n, kNeighbourShare * own);
    }
  }

  // The displacements d of the reference that minimise
  //   sum_v |d_v - start_v|^2 + sum_vw stiffness_vw |d_v - d_w|^2
  // over the edges vw that have any stiffness: that of the stiffer end, by
  // length. Stiff enough, a neighbourhood moves as one piece.
  std::vector<Vector3d> Solve(const std::vector<Vector3d>& start,
                              const std::vector<double>& stiffness) const {
    std::vector<int> column(start.size(), -1), vertices;
    std::vector<Eigen::Triplet<double>> triplets;
    const auto column_of = [&](int v) {
      if (column[v] < 0) {
        column[v] = static_cast<int>(vertices.size());
        vertices.push_back(v);
        triplets.emplace_back(column[v], column[v], 1.0);
      }
      return column[v];
    };
    for (int v = 0; v < static_cast<int>(start.size()); ++v) {
      for (const int n : neighbours_[v]) {
        const double stiffer = std::max(stiffness[v], stiffness[n]);
        if (n < v || stiffer == 0) continue;
        const double length = (reference_[v] - reference_[n]).norm();
        const double weight =
            stiffer * kSpacing / std::max(length, kShortestEdge);
        const int a = column_of(v), b = column_of(n);
        triplets.emplace_back(a, a, weight);
        triplets.emplace_back(b, b, weight);
        triplets.emplace_back(a, b, -weight);
        triplets.emplace_back(b, a, -weight);
      }
    }
    const auto count = static_cast<Eigen::Index>(vertices.size());
    Eigen::SparseMatrix<double> matrix(count, count);
    matrix.setFromTriplets(triplets.begin(), triplets.end());
    Eigen::MatrixX3d right(count, 3);
    for (Eigen::Index i = 0; i < count; ++i) {
      right.row(i) = start[vertices[i]].transpose();
    }
    const Eigen::MatrixX3d solved =
        Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(matrix).solve(right);
    std::vector<Vector3d> result = start;
    for (Eigen::Index i = 0; i < count; ++i) {
      result[vertices[i]] = solved.row(i).transpose();
    }
    return result;
  }

 private:
  const std::vector<Vector3d>& reference_;
  std::vector<Triangle> triangles_;
  std::vector<std::vector<int>> neighbours_;
  std::vector<Vector3d> reference_normal_;
};

}  // namespace

RelaxedSurface RelaxSurface(const std::vector<Vector3d>& reference_rest,
                            Body* body) {
  const Relaxation relaxation(body->topology, reference_rest);
  std::vector<Vector3d> start = RestVertices(*body);
  const size_t n = start.size();
  for (size_t v = 0; v < n; ++v) start[v] -= reference_rest[v];
  std::vector<Vector3d> displacement = start;
  std::vector<double> stiffness(n, 0.0);
  RelaxedSurface result;
  std::vector<Vector3d> x(n);
  for (int round = 0;; ++round) {
    for (size_t v = 0; v < n; ++v) x[v] = reference_rest[v] + displacement[v];
    const std::vector<bool> torn = relaxation.FindTorn(x, &result);
    if (result.turned_faces_left + result.long_edges_left == 0 ||
        round == kMaxRounds) {
      break;
    }
    relaxation.Stiffen(torn, &stiffness);
    displacement = relaxation.Solve(start, stiffness);
  }
  std::vector<Vector3d> move(n);
  for (size_t v = 0; v < n; ++v) {
    move[v] = displacement[v] - start[v];
    if (!move[v].isZero()) ++result.moved_vertices;
  }
  DisplaceAtRest(move, body);
  return result;
}

}  // namespace sweepfit
