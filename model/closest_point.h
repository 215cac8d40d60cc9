// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "model/mesh.h"

namespace sweepfit {

// Point of a triangle and its barycentric weights.
struct TrianglePoint {
  Eigen::Vector3d point;
  Eigen::Vector3d weights;
};
// The point of triangle abc closest to p (region test of Ericson, Real-Time
// Collision Detection, 5.1.5). Degenerate triangles give some point of them.
TrianglePoint ClosestPointOnTriangle(const Eigen::Vector3d& p,
                                     const Eigen::Vector3d& a,
                                     const Eigen::Vector3d& b,
                                     const Eigen::Vector3d& c);

// Exact nearest points of a mesh by a tree of boxes. The mesh must outlive the
// finder. Thread-safe.
class ClosestPointFinder {
 public:
  // The mesh needs at least one triangle.
  explicit ClosestPointFinder(const TriangleMesh& mesh);

  struct Result {
    int triangle = -1;
    double distance = 0;  // metres
    TrianglePoint on_mesh;
  };
  Result Find(const Eigen::Vector3d& point) const;

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    int begin = 0, end = 0;  // triangles order_[begin, end) of a leaf
    int right = -1;          // second child; the first follows the node
  };
  int Build(int begin, int end, const std::vector<Eigen::Vector3d>& centers);

  const TriangleMesh& mesh_;
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

}  // namespace sweepfit
