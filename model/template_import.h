// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "model/body.h"
#include "model/mesh.h"

namespace sweepfit {

// The skinned surface of a binary glTF file in its rest pose (the nodes as the
// file has them), in the scene's frame, +Y up.
struct SkinnedSurface {
  std::vector<Eigen::Vector3d> vertices;  // welded: one per place
  std::vector<Triangle> triangles;
  std::vector<std::array<Eigen::Vector2f, 3>> uv;            // per corner, v up
  std::vector<std::vector<std::pair<int, double>>> weights;  // (node, weight)
  // All nodes of the file.
  std::vector<std::string> node_name;
  std::vector<int> node_parent;  // -1: none
  std::vector<Eigen::Vector3d> node_in_scene;
};

// Reads the triangles of all skinned meshes of a .glb. Throws InputError naming
// the file and the fault: not binary glTF, cut short, accessors or indices out
// of range, no skin, no texture coordinates, NaN, no weights, compression.
SkinnedSurface LoadSkinnedSurface(const std::string& path);

// Makes a template of a rigged person in a .glb: finds the 21 joints by their
// names (`names` as in joint_names.h), measures the sections of our sweeps on
// the surface, and binds every vertex by its skin weights. Triangles are kept
// (as quads with a corner twice) and so are texture coordinates. Arms or legs
// that are held otherwise than our template's are brought there by the sweeps;
// the person is turned to face +Z, and scaled to metres when it is 60 to 250
// units tall.
//
// Throws InputError when joints are missing or in disorder, when the surface is
// not a single closed one, or when the person does not stand upright.
Body ImportTemplate(const std::string& path, const std::string& names = "auto");

}  // namespace sweepfit
