// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace sweepfit {

using Triangle = std::array<int, 3>;
using Quad = std::array<int, 4>;

// An indexed triangle mesh; counter-clockwise seen from outside.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;
};

// A quad whose last corner repeats the third stands for a triangle.
inline bool IsTriangle(const Quad& quad) { return quad[2] == quad[3]; }
inline int NumCorners(const Quad& quad) { return IsTriangle(quad) ? 3 : 4; }
inline int NumCorners(const Triangle&) { return 3; }

// Splits every quad along its shorter diagonal in the given vertex positions
// (ties: the diagonal 0-2); a quad that stands for a triangle gives only that.
std::vector<Triangle> TriangulateQuads(
    const std::vector<Quad>& quads,
    const std::vector<Eigen::Vector3d>& vertices);

// Area-weighted unit vertex normals, pointing outside. +Y where a vertex has
// no area around it.
std::vector<Eigen::Vector3d> VertexNormals(const TriangleMesh& mesh);

// Enclosed volume by the divergence theorem, cubic metres; positive for a
// closed mesh with outward orientation.
double EnclosedVolume(const TriangleMesh& mesh);

double SurfaceArea(const TriangleMesh& mesh);

// What a closed surface must satisfy, counted. A vertex without faces is a
// component of its own.
struct MeshTopology {
  int num_boundary_edges = 0;
  int num_non_manifold_edges = 0;  // edges with more than two faces
  int num_misoriented_edges = 0;   // edges run twice the same way
  int num_non_manifold_vertices = 0;
  int num_components = 0;
  int euler_characteristic = 0;  // of the whole mesh
  bool IsClosedManifold() const {
    return num_boundary_edges == 0 && num_non_manifold_edges == 0 &&
           num_misoriented_edges == 0 && num_non_manifold_vertices == 0;
  }
};
MeshTopology CheckTopology(const TriangleMesh& mesh);

// The component with the largest enclosed volume, vertices and triangles in
// their old order; empty for a mesh without triangles.
TriangleMesh LargestComponent(const TriangleMesh& mesh);

// Binary PLY, 32-bit floats, triangles. Throw InputError when the file cannot
// be written or read. LoadPly reads ascii and binary little endian with any
// further elements and properties, and splits larger faces into fans.
void SavePly(const TriangleMesh& mesh, const std::string& path);
TriangleMesh LoadPly(const std::string& path);

}  // namespace sweepfit
