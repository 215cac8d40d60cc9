// SPDX-License-Identifier: Apache-2.0
#include "solver/relax_surface.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "model/vertex_neighbours.h"
#include "solver/displacement.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

constexpr int kMaxRounds = 240;
// The region grows by a ring every so many rounds, up to so many rings.
constexpr int kRoundsPerRing = 10;
constexpr int kMaxRings = 12;
constexpr double kStep = 0.6;
// A face has turned below this cosine to its normal on the reference: 60
// degrees. One that stands nearly upright on the skin turns over in motion.
constexpr double kMinCosine = 0.5;
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
    for (size_t v = 0; v < neighbours_.size(); ++v) {
      Vector3d mean = Vector3d::Zero();
      for (const int n : neighbours_[v]) mean += reference[n];
      mean /= std::max<double>(1, static_cast<double>(neighbours_[v].size()));
      shape_.push_back(reference[v] - mean);
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

  void Grow(std::vector<bool>* region) const {
    const std::vector<bool> inner = *region;
    for (size_t v = 0; v < inner.size(); ++v) {
      if (!inner[v]) continue;
      for (const int n : neighbours_[v]) (*region)[n] = true;
    }
  }

  void Step(const std::vector<bool>& region, std::vector<Vector3d>* x) const {
    const std::vector<Vector3d> before = *x;
    for (size_t v = 0; v < region.size(); ++v) {
      if (!region[v] || neighbours_[v].empty()) continue;
      Vector3d mean = Vector3d::Zero();
      for (const int n : neighbours_[v]) mean += before[n];
      mean /= static_cast<double>(neighbours_[v].size());
      (*x)[v] += kStep * (mean + shape_[v] - before[v]);
    }
  }

 private:
  const std::vector<Vector3d>& reference_;
  std::vector<Triangle> triangles_;
  std::vector<std::vector<int>> neighbours_;
  std::vector<Vector3d> reference_normal_;
  std::vector<Vector3d> shape_;
};

}  // namespace

RelaxedSurface RelaxSurface(const std::vector<Vector3d>& reference_rest,
                            Body* body) {
  const Relaxation relaxation(body->topology, reference_rest);
  const std::vector<Vector3d> start = RestVertices(*body);
  std::vector<Vector3d> x = start;
  RelaxedSurface result;
  for (int round = 0;; ++round) {
    std::vector<bool> region = relaxation.FindTorn(x, &result);
    if (result.turned_faces_left + result.long_edges_left == 0 ||
        round == kMaxRounds) {
      break;
    }
    const int rings = std::min(1 + round / kRoundsPerRing, kMaxRings);
    for (int ring = 0; ring < rings; ++ring) relaxation.Grow(&region);
    relaxation.Step(region, &x);
  }
  std::vector<Vector3d> move(x.size());
  for (size_t v = 0; v < x.size(); ++v) {
    move[v] = x[v] - start[v];
    if (!move[v].isZero()) ++result.moved_vertices;
  }
  DisplaceAtRest(move, body);
  return result;
}

}  // namespace sweepfit
