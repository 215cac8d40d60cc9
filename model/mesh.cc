// SPDX-License-Identifier: Apache-2.0
#include "model/mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <tuple>
#include <utility>

#include "model/disjoint_sets.h"

namespace sweepfit {
namespace {

// An edge of a face, to sort by its end points.
struct FaceEdge {
  int low, high;  // vertices
  int face;
  int corner;    // the edge leaves this corner of the face
  bool forward;  // from low to high
};

// All edges of all faces; those between the same vertices follow each other.
std::vector<FaceEdge> SortedEdges(const std::vector<Triangle>& triangles) {
  std::vector<FaceEdge> edges;
  edges.reserve(3 * triangles.size());
  for (std::size_t f = 0; f < triangles.size(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const int from = triangles[f][corner];
      const int to = triangles[f][(corner + 1) % 3];
      edges.push_back({std::min(from, to),
                       std::max(from, to),
                       static_cast<int>(f),
                       corner,
                       from < to});
    }
  }
  std::sort(
      edges.begin(), edges.end(), [](const FaceEdge& a, const FaceEdge& b) {
        return std::tie(a.low, a.high, a.face, a.corner) <
               std::tie(b.low, b.high, b.face, b.corner);
      });
  return edges;
}

// Calls visit(first, last) for each group of edges between the same vertices.
template <typename Visitor>
void ForEachEdge(const std::vector<FaceEdge>& edges, const Visitor& visit) {
  for (auto first = edges.begin(); first != edges.end();) {
    auto last = first;
    while (last != edges.end() && last->low == first->low &&
           last->high == first->high) {
      ++last;
    }
    visit(first, last);
    first = last;
  }
}

// Around a manifold vertex the faces form one fan or one disc. Corners of
// faces that share an edge at the vertex are in one fan.
int CountNonManifoldVertices(const TriangleMesh& mesh,
                             const std::vector<FaceEdge>& edges) {
  const std::vector<Triangle>& triangles = mesh.triangles;
  DisjointSets fans(3 * triangles.size());
  const auto corner_at = [&](const FaceEdge& edge, int vertex) {
    const int other = (edge.corner + 1) % 3;
    return 3 * edge.face +
           (triangles[edge.face][edge.corner] == vertex ? edge.corner : other);
  };
  ForEachEdge(edges, [&](auto first, auto last) {
    for (auto edge = first + 1; edge < last; ++edge) {
      for (const int vertex : {first->low, first->high}) {
        fans.Unite(corner_at(*first, vertex), corner_at(*edge, vertex));
      }
    }
  });
  std::vector<int> num_fans(mesh.vertices.size());
  for (std::size_t f = 0; f < triangles.size(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const int id = static_cast<int>(3 * f) + corner;
      if (fans.Find(id) == id) ++num_fans[triangles[f][corner]];
    }
  }
  return static_cast<int>(std::count_if(
      num_fans.begin(), num_fans.end(), [](int count) { return count > 1; }));
}

DisjointSets ConnectedVertices(const TriangleMesh& mesh) {
  DisjointSets sets(mesh.vertices.size());
  for (const Triangle& t : mesh.triangles) {
    sets.Unite(t[0], t[1]);
    sets.Unite(t[0], t[2]);
  }
  return sets;
}

// Twice the area times the normal.
Eigen::Vector3d AreaVector(const TriangleMesh& mesh, const Triangle& t) {
  return (mesh.vertices[t[1]] - mesh.vertices[t[0]])
      .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
}

// Six times the volume of the tetrahedron with a reference point.
double TetrahedronVolume(const TriangleMesh& mesh,
                         const Triangle& t,
                         const Eigen::Vector3d& reference) {
  return (mesh.vertices[t[0]] - reference).dot(AreaVector(mesh, t));
}

// Volumes are taken about a vertex: exact for closed meshes anyway, and exact
// to more digits far from the origin.
Eigen::Vector3d Reference(const TriangleMesh& mesh) {
  return mesh.vertices.empty() ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                               : mesh.vertices.front();
}

}  // namespace

std::vector<Triangle> TriangulateQuads(
    const std::vector<Quad>& quads,
    const std::vector<Eigen::Vector3d>& vertices) {
  std::vector<Triangle> triangles;
  triangles.reserve(2 * quads.size());
  for (const Quad& q : quads) {
    if (IsTriangle(q)) {
      triangles.push_back({q[0], q[1], q[2]});
      continue;
    }
    const double diagonal_02 = (vertices[q[2]] - vertices[q[0]]).squaredNorm();
    const double diagonal_13 = (vertices[q[3]] - vertices[q[1]]).squaredNorm();
    if (diagonal_02 <= diagonal_13) {
      triangles.push_back({q[0], q[1], q[2]});
      triangles.push_back({q[0], q[2], q[3]});
    } else {
      triangles.push_back({q[0], q[1], q[3]});
      triangles.push_back({q[1], q[2], q[3]});
    }
  }
  return triangles;
}

std::vector<Eigen::Vector3d> VertexNormals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals(mesh.vertices.size(),
                                       Eigen::Vector3d::Zero());
  for (const Triangle& t : mesh.triangles) {
    const Eigen::Vector3d area_vector = AreaVector(mesh, t);
    for (const int vertex : t) normals[vertex] += area_vector;
  }
  for (Eigen::Vector3d& normal : normals) {
    const double norm = normal.norm();
    normal = norm > 0 ? Eigen::Vector3d(normal / norm)
                      : Eigen::Vector3d(Eigen::Vector3d::UnitY());
  }
  return normals;
}

double EnclosedVolume(const TriangleMesh& mesh) {
  const Eigen::Vector3d reference = Reference(mesh);
  double six_volumes = 0;
  for (const Triangle& t : mesh.triangles) {
    six_volumes += TetrahedronVolume(mesh, t, reference);
  }
  return six_volumes / 6;
}

double SurfaceArea(const TriangleMesh& mesh) {
  double twice_area = 0;
  for (const Triangle& t : mesh.triangles) {
    twice_area += AreaVector(mesh, t).norm();
  }
  return twice_area / 2;
}

// A half-edge structure such as OpenMesh's cannot hold the very meshes that
// this must count the faults of, so edges are sorted instead.
MeshTopology CheckTopology(const TriangleMesh& mesh) {
  MeshTopology topology;
  const std::vector<FaceEdge> edges = SortedEdges(mesh.triangles);
  int num_edges = 0;
  ForEachEdge(edges, [&](auto first, auto last) {
    ++num_edges;
    const auto num_faces = last - first;
    if (num_faces == 1) ++topology.num_boundary_edges;
    if (num_faces > 2 || first->low == first->high) {
      ++topology.num_non_manifold_edges;
    }
    if (num_faces == 2 && first->forward == (first + 1)->forward) {
      ++topology.num_misoriented_edges;
    }
  });
  topology.num_non_manifold_vertices = CountNonManifoldVertices(mesh, edges);
  topology.num_components = ConnectedVertices(mesh).Count();
  topology.euler_characteristic = static_cast<int>(mesh.vertices.size()) -
                                  num_edges +
                                  static_cast<int>(mesh.triangles.size());
  return topology;
}

TriangleMesh LargestComponent(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) return {};
  DisjointSets sets = ConnectedVertices(mesh);
  std::vector<double> six_volumes(mesh.vertices.size());
  const Eigen::Vector3d reference = Reference(mesh);
  for (const Triangle& t : mesh.triangles) {
    six_volumes[sets.Find(t[0])] += TetrahedronVolume(mesh, t, reference);
  }
  // Only components with faces: a lone vertex encloses nothing.
  int largest = sets.Find(mesh.triangles.front()[0]);
  for (const Triangle& t : mesh.triangles) {
    const int component = sets.Find(t[0]);
    if (six_volumes[component] > six_volumes[largest]) largest = component;
  }

  TriangleMesh result;
  std::vector<int> new_index(mesh.vertices.size(), -1);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (sets.Find(static_cast<int>(v)) != largest) continue;
    new_index[v] = static_cast<int>(result.vertices.size());
    result.vertices.push_back(mesh.vertices[v]);
  }
  for (const Triangle& t : mesh.triangles) {
    if (new_index[t[0]] < 0) continue;
    result.triangles.push_back(
        {new_index[t[0]], new_index[t[1]], new_index[t[2]]});
  }
  return result;
}

}  // namespace sweepfit
