// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "model/mesh.h"

namespace sweepfit {

// The skinned surface of a binary glTF file, in the scene's frame. Vertices of
// one place are welded, whatever seams of texture, normals and materials lie
// there.
struct SkinnedSurface {
  // A person may be held in two ways: as the nodes stand in the file, and as
  // the skin was bound to the joints. Often they are the same.
  struct Posture {
    std::vector<Eigen::Vector3d> vertices;
    std::vector<Eigen::Vector3d> nodes;  // all nodes of the file
  };
  Posture as_nodes;
  Posture as_bound;
  std::vector<Triangle> triangles;
  // Per triangle: of each corner, v up; NaN where the file has none.
  std::vector<std::array<Eigen::Vector2f, 3>> uv;
  std::vector<int> material;  // per triangle; -1: none
  std::vector<int> mesh;      // per triangle: index into mesh_name
  std::vector<std::string> mesh_name;
  // Per vertex: (node, weight), weights summing to 1.
  std::vector<std::vector<std::pair<int, double>>> weights;
  std::vector<std::string> node_name;
  std::vector<int> node_parent;  // -1: none
  std::vector<bool> is_joint;    // of some skin
};

// Reads the triangles of all skinned meshes of a .glb. Throws InputError naming
// the file and the fault: not binary glTF, cut short, accessors or indices out
// of range, no skin, NaN, no weights, compression.
SkinnedSurface LoadSkinnedSurface(const std::string& path);

}  // namespace sweepfit
