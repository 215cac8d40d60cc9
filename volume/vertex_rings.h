// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "model/mesh.h"

namespace sweepfit {

// The vertices around every vertex of a mesh, in ascending order.
class VertexRings {
 public:
  explicit VertexRings(const TriangleMesh& mesh);

  std::span<const int> operator[](int vertex) const {
    return {neighbor_.data() + first_[vertex],
            static_cast<size_t>(first_[vertex + 1] - first_[vertex])};
  }
  int size() const { return static_cast<int>(first_.size()) - 1; }

 private:
  std::vector<int> first_;
  std::vector<int> neighbor_;
};

// Unit vertex normals, averaged with those around `passes` times: creases of a
// visual hull are no features of the body.
std::vector<Eigen::Vector3d> SmoothNormals(const TriangleMesh& mesh,
                                           const VertexRings& rings,
                                           int passes);

// Distance from a vertex to those around it, mean, metres.
double MeanEdgeLength(const std::vector<Eigen::Vector3d>& vertices,
                      const VertexRings& rings);

}  // namespace sweepfit
