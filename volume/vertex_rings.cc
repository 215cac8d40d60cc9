// SPDX-License-Identifier: Apache-2.0
#include "volume/vertex_rings.h"

#include <algorithm>
#include <utility>

namespace sweepfit {

VertexRings::VertexRings(const TriangleMesh& mesh) {
  std::vector<std::pair<int, int>> edges;
  edges.reserve(6 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      edges.emplace_back(t[k], t[(k + 1) % 3]);
      edges.emplace_back(t[(k + 1) % 3], t[k]);
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  first_.assign(mesh.vertices.size() + 1, 0);
  neighbor_.reserve(edges.size());
  for (const auto& [from, to] : edges) {
    ++first_[from + 1];
    neighbor_.push_back(to);
  }
  for (size_t v = 0; v + 1 < first_.size(); ++v) first_[v + 1] += first_[v];
}

std::vector<Eigen::Vector3d> SmoothNormals(const TriangleMesh& mesh,
                                           const VertexRings& rings,
                                           int passes) {
  std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  std::vector<Eigen::Vector3d> next(normals.size());
  for (int pass = 0; pass < passes; ++pass) {
    for (int v = 0; v < rings.size(); ++v) {
      Eigen::Vector3d sum = normals[v];
      for (const int w : rings[v]) sum += normals[w];
      const double norm = sum.norm();
      next[v] = norm > 1e-9 ? Eigen::Vector3d(sum / norm) : normals[v];
    }
    normals.swap(next);
  }
  return normals;
}

double MeanEdgeLength(const TriangleMesh& mesh, const VertexRings& rings) {
  double sum = 0;
  long count = 0;
  for (int v = 0; v < rings.size(); ++v) {
    for (const int w : rings[v]) {
      sum += (mesh.vertices[w] - mesh.vertices[v]).norm();
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

}  // namespace sweepfit
