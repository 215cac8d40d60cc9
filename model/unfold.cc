// SPDX-License-Identifier: Apache-2.0
#include "model/unfold.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kMaxRounds = 100;
constexpr int kRoundsPerRing = 8;
constexpr int kMaxRings = 6;
// A face counts as turned over below this cosine against where it should look.
constexpr double kMinCosine = 0.03;
constexpr double kStep = 0.5;

// True where the rest shape itself is creased: no smoothing brings such a face
// back to where it looked.
bool IsCreased(const Vector3d& normal,
               const Triangle& triangle,
               const std::vector<Vector3d>& vertex_normals) {
  constexpr double kMinRestCosine = 0.3;
  Vector3d around = Vector3d::Zero();
  for (const int v : triangle) around += vertex_normals[v];
  return normal.dot(around.stableNormalized()) < kMinRestCosine;
}

}  // namespace

template <typename Face>
Unfolder::Lists Unfolder::ListPerVertex(const std::vector<Face>& faces,
                                        std::size_t num_vertices,
                                        bool of_neighbours) {
  Lists lists;
  lists.first.assign(num_vertices + 1, 0);
  const int per_corner = of_neighbours ? 2 : 1;
  for (const Face& face : faces) {
    for (const int v : face) lists.first[v + 1] += per_corner;
  }
  for (std::size_t v = 0; v < num_vertices; ++v) {
    lists.first[v + 1] += lists.first[v];
  }
  lists.entry.resize(lists.first.back());
  std::vector<int> next(lists.first.begin(), lists.first.end() - 1);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const int corners = static_cast<int>(faces[f].size());
    for (int i = 0; i < corners; ++i) {
      int& at = next[faces[f][i]];
      if (of_neighbours) {
        lists.entry[at++] = faces[f][(i + 1) % corners];
        lists.entry[at++] = faces[f][(i + corners - 1) % corners];
      } else {
        lists.entry[at++] = static_cast<int>(f);
      }
    }
  }
  return lists;
}

Unfolder::Unfolder(const std::vector<Quad>& quads,
                   const std::vector<Vector3d>& rest)
    : triangles_(TriangulateQuads(quads, rest)),
      neighbours_(ListPerVertex(quads, rest.size(), true)),
      triangles_around_(ListPerVertex(triangles_, rest.size(), false)) {
  const std::vector<Vector3d> vertex_normals =
      VertexNormals({rest, triangles_});
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    const Triangle& triangle = triangles_[t];
    const Vector3d normal = (rest[triangle[1]] - rest[triangle[0]])
                                .cross(rest[triangle[2]] - rest[triangle[0]])
                                .stableNormalized();
    rest_normal_.push_back(normal);
    is_watched_.push_back(!IsCreased(normal, triangle, vertex_normals));
    if (is_watched_.back() != 0) {
      watched_.push_back(static_cast<int>(t));
    }
  }
}

bool Unfolder::IsTurned(const std::vector<Matrix3d>& rotation,
                        const std::vector<Vector3d>& vertices,
                        int index) const {
  const Triangle& t = triangles_[index];
  const Vector3d normal =
      (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]);
  const Vector3d& rest = rest_normal_[index];
  const Vector3d expected =
      rotation[t[0]] * rest + rotation[t[1]] * rest + rotation[t[2]] * rest;
  const double cosine = normal.dot(expected);
  if (cosine <= 0) return true;
  return cosine * cosine < kMinCosine * kMinCosine * normal.squaredNorm() *
                               expected.squaredNorm();
}

int Unfolder::Apply(const std::vector<Matrix3d>& rotation,
                    std::vector<Vector3d>* vertices) const {
  std::vector<int> turned;
  const auto find_turned = [&](const std::vector<int>& suspects) {
    turned.clear();
    for (const int t : suspects) {
      if (IsTurned(rotation, *vertices, t)) turned.push_back(t);
    }
  };
  find_turned(watched_);
  if (turned.empty()) return 0;
  // What is listed in this round already.
  std::vector<char> in_region(vertices->size(), 0);
  std::vector<char> is_suspect(triangles_.size(), 0);
  std::vector<int> region, suspects;
  std::vector<Vector3d> moved;
  const auto add = [&](int v) {
    if (in_region[v] != 0) return;
    in_region[v] = 1;
    region.push_back(v);
  };
  const auto add_around = [&](int v) {
    const int end = neighbours_.first[v + 1];
    for (int k = neighbours_.first[v]; k < end; ++k) add(neighbours_.entry[k]);
  };
  for (int round = 0; !turned.empty() && round < kMaxRounds; ++round) {
    region.clear();
    for (const int t : turned) {
      for (const int v : triangles_[t]) {
        add(v);
        add_around(v);
      }
    }
    // Deep folds need room: the longer it takes, the wider the region.
    const int rings = std::min(round / kRoundsPerRing, kMaxRings);
    std::size_t first = 0;
    for (int ring = 0; ring < rings; ++ring) {
      const std::size_t last = region.size();
      for (std::size_t i = first; i < last; ++i) add_around(region[i]);
      first = last;
    }
    moved.clear();
    for (const int v : region) {
      Vector3d sum = Vector3d::Zero();
      const int begin = neighbours_.first[v];
      const int end = neighbours_.first[v + 1];
      for (int k = begin; k < end; ++k) {
        sum += (*vertices)[neighbours_.entry[k]];
      }
      const Vector3d& x = (*vertices)[v];
      moved.push_back(x + kStep * (sum / (end - begin) - x));
    }
    suspects.clear();
    for (std::size_t i = 0; i < region.size(); ++i) {
      const int v = region[i];
      (*vertices)[v] = moved[i];
      in_region[v] = 0;
      const int end = triangles_around_.first[v + 1];
      for (int k = triangles_around_.first[v]; k < end; ++k) {
        const int t = triangles_around_.entry[k];
        if (is_watched_[t] == 0 || is_suspect[t] != 0) continue;
        is_suspect[t] = 1;
        suspects.push_back(t);
      }
    }
    for (const int t : suspects) is_suspect[t] = 0;
    find_turned(suspects);
  }
  return static_cast<int>(turned.size());
}

}  // namespace sweepfit
