// SPDX-License-Identifier: Apache-2.0
#include "model/closest_point.h"

#include <glog/logging.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace sweepfit {
namespace {

constexpr int kLeafSize = 4;
// Halving 2^31 triangles cannot go deeper.
constexpr int kMaxDepth = 64;

TrianglePoint FromWeights(const Eigen::Vector3d& a,
                          const Eigen::Vector3d& b,
                          const Eigen::Vector3d& c,
                          const Eigen::Vector3d& weights) {
  return {weights[0] * a + weights[1] * b + weights[2] * c, weights};
}

}  // namespace

TrianglePoint ClosestPointOnTriangle(const Eigen::Vector3d& p,
                                     const Eigen::Vector3d& a,
                                     const Eigen::Vector3d& b,
                                     const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a;
  const double d1 = ab.dot(p - a), d2 = ac.dot(p - a);
  if (d1 <= 0 && d2 <= 0) return {a, {1, 0, 0}};
  const double d3 = ab.dot(p - b), d4 = ac.dot(p - b);
  if (d3 >= 0 && d4 <= d3) return {b, {0, 1, 0}};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double s = d1 / (d1 - d3);
    return FromWeights(a, b, c, {1 - s, s, 0});
  }
  const double d5 = ab.dot(p - c), d6 = ac.dot(p - c);
  if (d6 >= 0 && d5 <= d6) return {c, {0, 0, 1}};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double s = d2 / (d2 - d6);
    return FromWeights(a, b, c, {1 - s, 0, s});
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double s = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return FromWeights(a, b, c, {0, 1 - s, s});
  }
  const double sum = va + vb + vc;
  if (!(sum > 0)) return {a, {1, 0, 0}};
  return FromWeights(a, b, c, {va / sum, vb / sum, vc / sum});
}

ClosestPointFinder::ClosestPointFinder(const TriangleMesh& mesh)
    : mesh_(mesh), order_(mesh.triangles.size()) {
  CHECK(!mesh.triangles.empty());
  std::iota(order_.begin(), order_.end(), 0);
  std::vector<Eigen::Vector3d> centers(order_.size());
  for (size_t i = 0; i < centers.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    centers[i] =
        (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3;
  }
  nodes_.reserve(order_.size());
  Build(0, static_cast<int>(order_.size()), centers);
}

int ClosestPointFinder::Build(int begin,
                              int end,
                              const std::vector<Eigen::Vector3d>& centers) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  Eigen::AlignedBox3d box, center_box;
  for (int i = begin; i < end; ++i) {
    center_box.extend(centers[order_[i]]);
    for (int vertex : mesh_.triangles[order_[i]]) {
      box.extend(mesh_.vertices[vertex]);
    }
  }
  nodes_[index].box = box;
  if (end - begin <= kLeafSize) {
    nodes_[index].begin = begin;
    nodes_[index].end = end;
    return index;
  }
  int axis = 0;
  center_box.sizes().maxCoeff(&axis);
  const int middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin,
                   order_.begin() + middle,
                   order_.begin() + end,
                   [&](int a, int b) {
                     return std::pair(centers[a][axis], a) <
                            std::pair(centers[b][axis], b);
                   });
  Build(begin, middle, centers);
  const int right = Build(middle, end, centers);
  nodes_[index].right = right;
  return index;
}

ClosestPointFinder::Result ClosestPointFinder::Find(
    const Eigen::Vector3d& point) const {
  Result best;
  double best_squared = std::numeric_limits<double>::infinity();
  std::array<std::pair<double, int>, kMaxDepth> stack;
  int size = 0;
  stack[size++] = {nodes_[0].box.squaredExteriorDistance(point), 0};
  while (size > 0) {
    const auto [lower_bound, index] = stack[--size];
    if (lower_bound >= best_squared) continue;
    const Node& node = nodes_[index];
    if (node.right < 0) {
      for (int i = node.begin; i < node.end; ++i) {
        const Triangle& t = mesh_.triangles[order_[i]];
        const TrianglePoint candidate =
            ClosestPointOnTriangle(point,
                                   mesh_.vertices[t[0]],
                                   mesh_.vertices[t[1]],
                                   mesh_.vertices[t[2]]);
        const double squared = (point - candidate.point).squaredNorm();
        if (squared < best_squared) {
          best_squared = squared;
          best.triangle = order_[i];
          best.on_mesh = candidate;
        }
      }
      continue;
    }
    std::pair<double, int> near{
        nodes_[index + 1].box.squaredExteriorDistance(point), index + 1};
    std::pair<double, int> far{
        nodes_[node.right].box.squaredExteriorDistance(point), node.right};
    if (far.first < near.first) std::swap(near, far);
    stack[size++] = far;
    stack[size++] = near;
  }
  best.distance = std::sqrt(best_squared);
  return best;
}

}  // namespace sweepfit
