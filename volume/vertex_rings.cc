// SPDX-License-Identifier: Apache-2.0
#include "volume/vertex_rings.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace sweepfit {

VertexRings::VertexRings(const TriangleMesh& mesh) {
  const auto n = mesh.vertices.size();
  // Where every edge is listed twice, from each of its triangles.
  std::vector<int> start(n + 1, 0);
  for (const Triangle& t : mesh.triangles) {
    for (const int v : t) start[v + 1] += 2;
  }
  for (size_t v = 0; v < n; ++v) start[v + 1] += start[v];
  std::vector<int> listed(start[n]);
  std::vector<int> next(start.begin(), start.end() - 1);
  for (const Triangle& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      listed[next[t[k]]++] = t[(k + 1) % 3];
      listed[next[t[k]]++] = t[(k + 2) % 3];
    }
  }
  first_.assign(n + 1, 0);
  neighbor_.reserve(listed.size() / 2);
  for (size_t v = 0; v < n; ++v) {
    const auto begin = listed.begin() + start[v];
    const auto end = listed.begin() + start[v + 1];
    std::sort(begin, end);
    neighbor_.insert(neighbor_.end(), begin, std::unique(begin, end));
    first_[v + 1] = static_cast<int>(neighbor_.size());
  }
}

std::vector<Eigen::Vector3d> SmoothNormals(const TriangleMesh& mesh,
                                           const VertexRings& rings,
                                           int passes) {
  std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  std::vector<Eigen::Vector3d> next(normals.size());
  for (int pass = 0; pass < passes; ++pass) {
    tbb::parallel_for(0, rings.size(), [&](int v) {
      Eigen::Vector3d sum = normals[v];
      for (const int w : rings[v]) sum += normals[w];
      const double norm = sum.norm();
      next[v] = norm > 1e-9 ? Eigen::Vector3d(sum / norm) : normals[v];
    });
    normals.swap(next);
  }
  return normals;
}

double MeanEdgeLength(const std::vector<Eigen::Vector3d>& vertices,
                      const VertexRings& rings) {
  double sum = 0;
  long count = 0;
  for (int v = 0; v < rings.size(); ++v) {
    for (const int w : rings[v]) {
      sum += (vertices[w] - vertices[v]).norm();
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

}  // namespace sweepfit
