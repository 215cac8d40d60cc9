// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_graph.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

namespace sweepfit {
namespace {

std::array<Eigen::Vector3i, 26> NeighborOffsets() {
  std::array<Eigen::Vector3i, 26> offsets;
  int count = 0;
  for (int n = 0; n < 27; ++n) {
    if (n == 13) continue;
    offsets[count++] = {n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1};
  }
  return offsets;
}

const std::array<Eigen::Vector3i, 26>& Offsets() {
  static const std::array<Eigen::Vector3i, 26> offsets = NeighborOffsets();
  return offsets;
}

constexpr float kFar = std::numeric_limits<float>::infinity();

}  // namespace

SolidGraph::SolidGraph(const Volume& volume, double spacing)
    : spacing_(spacing) {
  const Eigen::Vector3d low = volume.BoxMin() / spacing;
  const Eigen::Vector3d high = volume.BoxMax() / spacing;
  first_ = low.array().floor().cast<int>() - 1;
  size_ = high.array().ceil().cast<int>() + 2;
  size_ -= first_;
  node_of_cell_.assign(static_cast<size_t>(size_.x()) * size_.y() * size_.z(),
                       -1);
  size_t at = 0;
  for (int x = 0; x < size_.x(); ++x) {
    for (int y = 0; y < size_.y(); ++y) {
      for (int z = 0; z < size_.z(); ++z, ++at) {
        const Eigen::Vector3i cell = first_ + Eigen::Vector3i(x, y, z);
        if (volume.Sample(spacing * cell.cast<double>()) >= 0) continue;
        node_of_cell_[at] = num_nodes();
        cell_.push_back(cell);
      }
    }
  }
  LinkNodes(volume);
  MeasureDepth(volume);
}

Eigen::Vector3d SolidGraph::PointInWorld(int node) const {
  return spacing_ * cell_[node].cast<double>();
}

int SolidGraph::Node(const Eigen::Vector3i& cell) const {
  const Eigen::Vector3i local = cell - first_;
  if ((local.array() < 0).any() || (local.array() >= size_.array()).any()) {
    return -1;
  }
  return node_of_cell_[(static_cast<size_t>(local.x()) * size_.y() +
                        local.y()) *
                           size_.z() +
                       local.z()];
}

void SolidGraph::LinkNodes(const Volume& volume) {
  link_.resize(cell_.size());
  tbb::parallel_for(0, num_nodes(), [&](int node) {
    const Eigen::Vector3d point = PointInWorld(node);
    // Deep points need no look at the way between.
    const bool shallow = volume.Sample(point) > -spacing_;
    for (int n = 0; n < 26; ++n) {
      int next = Node(cell_[node] + Offsets()[n]);
      if (next >= 0 && shallow &&
          volume.Sample(0.5 * (point + PointInWorld(next))) >= 0) {
        next = -1;
      }
      link_[node][n] = next;
    }
  });
  // A way is open only if both ends find it so.
  for (int node = 0; node < num_nodes(); ++node) {
    for (int n = 0; n < 26; ++n) {
      const int next = link_[node][n];
      if (next >= 0 && link_[next][25 - n] != node) link_[node][n] = -1;
    }
  }
}

void SolidGraph::MeasureDepth(const Volume& volume) {
  depth_.assign(cell_.size(), kFar);
  std::vector<int> parent(cell_.size(), -1);
  std::vector<int> surface;
  for (int node = 0; node < num_nodes(); ++node) {
    for (int n = 0; n < 26; ++n) {
      if (link_[node][n] >= 0) continue;
      depth_[node] =
          static_cast<float>(std::max(0.0, -volume.Sample(PointInWorld(node))));
      surface.push_back(node);
      break;
    }
  }
  Relax(&depth_, &parent, surface);
}

void SolidGraph::Relax(std::vector<float>* distance,
                       std::vector<int>* parent,
                       const std::vector<int>& sources) const {
  using Entry = std::pair<float, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (const int source : sources) queue.emplace((*distance)[source], source);
  std::array<float, 26> step;
  for (int n = 0; n < 26; ++n) {
    step[n] = static_cast<float>(
        spacing_ * std::sqrt(static_cast<double>(Offsets()[n].squaredNorm())));
  }
  while (!queue.empty()) {
    const auto [at, node] = queue.top();
    queue.pop();
    if (at > (*distance)[node]) continue;
    for (int n = 0; n < 26; ++n) {
      const int next = link_[node][n];
      if (next < 0 || at + step[n] >= (*distance)[next]) continue;
      (*distance)[next] = at + step[n];
      (*parent)[next] = node;
      queue.emplace((*distance)[next], next);
    }
  }
}

int SolidGraph::DeepestNode() const {
  return static_cast<int>(std::max_element(depth_.begin(), depth_.end()) -
                          depth_.begin());
}

SolidGraph::Distances SolidGraph::FromNode(int source) const {
  Distances result;
  result.distance.assign(cell_.size(), kFar);
  result.parent.assign(cell_.size(), -1);
  Extend({source}, &result);
  return result;
}

void SolidGraph::Extend(const std::vector<int>& sources,
                        Distances* distances) const {
  for (const int source : sources) {
    distances->distance[source] = 0;
    distances->parent[source] = -1;
  }
  Relax(&distances->distance, &distances->parent, sources);
}

int SolidGraph::Climb(int node, const std::vector<float>& value) const {
  while (true) {
    int best = node;
    for (const int next : link_[node]) {
      if (next >= 0 && value[next] > value[best] && value[next] < kFar) {
        best = next;
      }
    }
    if (best == node) return node;
    node = best;
  }
}

std::vector<Extremum> FindExtrema(const SolidGraph& graph,
                                  double body_height,
                                  double min_prominence,
                                  int max_count) {
  std::vector<Extremum> extrema;
  const int center = graph.DeepestNode();
  const SolidGraph::Distances from_center = graph.FromNode(center);
  SolidGraph::Distances nearest = from_center;
  while (static_cast<int>(extrema.size()) < max_count) {
    int farthest = -1;
    for (int node = 0; node < graph.num_nodes(); ++node) {
      // What cannot be reached from the centre is no part of the body.
      if (nearest.distance[node] == kFar) continue;
      if (farthest < 0 || nearest.distance[node] > nearest.distance[farthest]) {
        farthest = node;
      }
    }
    if (farthest < 0 || nearest.distance[farthest] < min_prominence) break;
    Extremum extremum;
    extremum.prominence = nearest.distance[farthest];
    extremum.node = graph.Climb(farthest, from_center.distance);
    extremum.point_in_world = graph.PointInWorld(extremum.node);
    std::vector<int> path;
    const double end = from_center.distance[extremum.node];
    for (int node = extremum.node; node >= 0; node = from_center.parent[node]) {
      path.push_back(node);
      extremum.path_in_world.push_back(graph.PointInWorld(node));
    }
    // A path may run close to the skin: the depth of what it can climb to.
    for (const int node : path) {
      if (end - from_center.distance[node] > 0.12 * body_height) break;
      int deep = node;
      for (int step = 0; step < 3; ++step) {
        for (const int next : graph.Neighbors(deep)) {
          if (next >= 0 && graph.depth(next) > graph.depth(deep)) deep = next;
        }
      }
      extremum.thickness = std::max(extremum.thickness, graph.depth(deep));
    }
    path.push_back(farthest);
    graph.Extend(path, &nearest);
    extrema.push_back(std::move(extremum));
  }
  return extrema;
}

}  // namespace sweepfit
