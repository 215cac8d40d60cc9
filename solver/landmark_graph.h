// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "volume/volume.h"

namespace sweepfit {

// The inside of a volume as a graph: points of a regular grid, joined to those
// of their 26 neighbours that can be reached without leaving the inside.
class SolidGraph {
 public:
  SolidGraph(const Volume& volume, double spacing);

  int num_nodes() const { return static_cast<int>(cell_.size()); }
  Eigen::Vector3d PointInWorld(int node) const;
  // Distance to the surface along the graph, metres.
  double depth(int node) const { return depth_[node]; }
  // The node deepest inside; of equals the first.
  int DeepestNode() const;

  // Shortest ways to the nearest source. Calling Extend adds sources.
  struct Distances {
    std::vector<float> distance;  // metres
    std::vector<int> parent;      // next node towards the source, -1 there
  };
  Distances FromNode(int source) const;
  void Extend(const std::vector<int>& sources, Distances* distances) const;

  // 26 nodes, -1 where there is no link.
  const std::array<std::int32_t, 26>& Neighbors(int node) const {
    return link_[node];
  }

  // The node reached by always going to the neighbour with the largest value.
  int Climb(int node, const std::vector<float>& value) const;

 private:
  int Node(const Eigen::Vector3i& cell) const;
  void LinkNodes(const Volume& volume);
  void MeasureDepth(const Volume& volume);
  void Relax(std::vector<float>* distance,
             std::vector<int>* parent,
             const std::vector<int>& sources) const;

  double spacing_;
  Eigen::Vector3i first_;  // cell with the lowest indices
  Eigen::Vector3i size_;
  std::vector<Eigen::Vector3i> cell_;
  std::vector<std::int32_t> node_of_cell_;
  // 26 per node, -1 where there is no link.
  std::vector<std::array<std::int32_t, 26>> link_;
  std::vector<float> depth_;
};

// An end of the body: a far point of the volume.
struct Extremum {
  int node = -1;
  Eigen::Vector3d point_in_world;
  // Way to the nearest of the body's centre and the ways to the extrema before
  // it: how far it sticks out.
  double prominence = 0;
  // Largest depth within 0.12 stature of the end: heads are thick.
  double thickness = 0;
  // From the end to the centre.
  std::vector<Eigen::Vector3d> path_in_world;
};

// Ends by falling prominence (Plagemann et al. 2010: the farthest point, then
// the farthest from the ways found so far, and so on), at most `max_count`.
std::vector<Extremum> FindExtrema(const SolidGraph& graph,
                                  double body_height,
                                  double min_prominence,
                                  int max_count);

}  // namespace sweepfit
