// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "model/mesh.h"

namespace sweepfit {

// Turns faces of a posed mesh back that a deep fold has turned over: at the
// groin, the armpit or the waist a joint can bend further than the skin beside
// it has room for. First the vertices of such faces and their neighbours are
// drawn a few millimetres to the mean of the vertices around them, which irons
// the fold; then what still is turned over is turned by the least movement,
// until every face looks to the side that its vertices' rotations say. Where
// that finds no room, the fold is smoothed as far as it takes, or until a
// number of rounds is over. Faces elsewhere stay as they are, so a posture
// without folds is left alone.
class Unfolder {
 public:
  Unfolder(const std::vector<Quad>& quads,
           const std::vector<Eigen::Vector3d>& rest);

  // `rotation`: how every vertex has turned from rest. Returns the number of
  // faces (triangles of the quads split as at rest) that remain turned over.
  int Apply(const std::vector<Eigen::Matrix3d>& rotation,
            std::vector<Eigen::Vector3d>* vertices) const;

 private:
  bool IsTurned(const std::vector<Eigen::Matrix3d>& rotation,
                const std::vector<Eigen::Vector3d>& vertices,
                int triangle) const;
  // Where a triangle should look, not of unit length.
  Eigen::Vector3d Expected(const std::vector<Eigen::Matrix3d>& rotation,
                           int triangle) const;
  // The watched triangles around some vertices that are turned over.
  // `is_listed` is zero for all triangles, before and after.
  void FindTurned(const std::vector<Eigen::Matrix3d>& rotation,
                  const std::vector<Eigen::Vector3d>& vertices,
                  const std::vector<int>& around,
                  std::vector<char>* is_listed,
                  std::vector<int>* turned) const;
  // The steps; none moves anything without turned faces. `turned` is kept up
  // to date. Smoothing moves no vertex by more than `most_moved`, metres.
  void Smooth(const std::vector<Eigen::Matrix3d>& rotation,
              int num_rounds,
              double most_moved,
              std::vector<int>* turned,
              std::vector<Eigen::Vector3d>* vertices) const;
  void TurnBack(const std::vector<Eigen::Matrix3d>& rotation,
                std::vector<int>* turned,
                std::vector<Eigen::Vector3d>* vertices) const;

  // Lists per vertex, one after the other: those of vertex v begin at
  // first[v].
  struct Lists {
    std::vector<int> first;
    std::vector<int> entry;
  };
  template <typename Face>
  static Lists ListPerVertex(const std::vector<Face>& faces,
                             std::size_t num_vertices,
                             bool of_neighbours);

  std::vector<Triangle> triangles_;
  std::vector<Eigen::Vector3d> rest_normal_;  // unit, per triangle
  std::vector<int> watched_;                  // triangles not creased at rest
  std::vector<char> is_watched_;              // per triangle
  Lists neighbours_;  // vertices, those across an inner edge twice
  Lists triangles_around_;
};

}  // namespace sweepfit
