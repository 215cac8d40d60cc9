// SPDX-License-Identifier: Apache-2.0
#include "model/unfold.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kSmoothingRounds = 48;
constexpr int kTurningRounds = 300;
constexpr int kLastRounds = 100;
constexpr int kRoundsPerRing = 8;
constexpr int kMaxRings = 6;
// A face counts as turned over below this cosine against where it should look.
constexpr double kMinCosine = 0.03;
constexpr double kStep = 0.5;
// Smoothing moves a vertex by no more, metres.
constexpr double kMostSmoothed = 0.004;
// Nor by more than this where turning found no room.
constexpr double kMostYielded = 0.032;
// Faces are turned to this cosine, a little beyond the limit, by more than the
// mean of what the faces around a vertex ask for (over-relaxation).
constexpr double kTurnedCosine = 0.08;
constexpr double kTurningStep = 1.3;

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
    for (int i = 0; i < NumCorners(face); ++i) {
      lists.first[face[i] + 1] += per_corner;
    }
  }
  for (std::size_t v = 0; v < num_vertices; ++v) {
    lists.first[v + 1] += lists.first[v];
  }
  lists.entry.resize(lists.first.back());
  std::vector<int> next(lists.first.begin(), lists.first.end() - 1);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const int corners = NumCorners(faces[f]);
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
  const Vector3d expected = Expected(rotation, index);
  const double cosine = normal.dot(expected);
  if (cosine <= 0) return true;
  return cosine * cosine < kMinCosine * kMinCosine * normal.squaredNorm() *
                               expected.squaredNorm();
}

Vector3d Unfolder::Expected(const std::vector<Matrix3d>& rotation,
                            int index) const {
  const Triangle& t = triangles_[index];
  const Vector3d& rest = rest_normal_[index];
  return rotation[t[0]] * rest + rotation[t[1]] * rest + rotation[t[2]] * rest;
}

int Unfolder::Apply(const std::vector<Matrix3d>& rotation,
                    std::vector<Vector3d>* vertices) const {
  std::vector<int> turned;
  for (const int t : watched_) {
    if (IsTurned(rotation, *vertices, t)) turned.push_back(t);
  }
  if (turned.empty()) return 0;
  Smooth(rotation, kSmoothingRounds, kMostSmoothed, &turned, vertices);
  TurnBack(rotation, &turned, vertices);
  // A deeper fold yields step by step, so that it drags no more skin than it
  // must.
  for (double most = 2 * kMostSmoothed; !turned.empty() && most <= kMostYielded;
       most *= 2) {
    Smooth(rotation, kSmoothingRounds, most, &turned, vertices);
    TurnBack(rotation, &turned, vertices);
  }
  // A fold with no room on either side goes only if the skin around it yields.
  constexpr double kAnyWay = std::numeric_limits<double>::infinity();
  Smooth(rotation, kLastRounds, kAnyWay, &turned, vertices);
  return static_cast<int>(turned.size());
}

void Unfolder::FindTurned(const std::vector<Matrix3d>& rotation,
                          const std::vector<Vector3d>& vertices,
                          const std::vector<int>& around,
                          std::vector<char>* is_listed,
                          std::vector<int>* turned) const {
  std::vector<int> suspects;
  for (const int v : around) {
    const int end = triangles_around_.first[v + 1];
    for (int k = triangles_around_.first[v]; k < end; ++k) {
      const int t = triangles_around_.entry[k];
      if (is_watched_[t] == 0 || (*is_listed)[t] != 0) continue;
      (*is_listed)[t] = 1;
      suspects.push_back(t);
    }
  }
  turned->clear();
  for (const int t : suspects) {
    (*is_listed)[t] = 0;
    if (IsTurned(rotation, vertices, t)) turned->push_back(t);
  }
}

void Unfolder::Smooth(const std::vector<Matrix3d>& rotation,
                      int num_rounds,
                      double most_moved,
                      std::vector<int>* turned,
                      std::vector<Vector3d>* vertices) const {
  if (turned->empty()) return;
  const std::vector<Vector3d> folded = *vertices;
  // What is listed in this round already.
  std::vector<char> in_region(vertices->size(), 0);
  std::vector<char> is_listed(triangles_.size(), 0);
  std::vector<int> region;
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
  for (int round = 0; !turned->empty() && round < num_rounds; ++round) {
    region.clear();
    for (const int t : *turned) {
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
      const Vector3d way = x + kStep * (sum / (end - begin) - x) - folded[v];
      const double length = way.norm();
      moved.push_back(folded[v] + std::min(1.0, most_moved / length) * way);
    }
    for (std::size_t i = 0; i < region.size(); ++i) {
      (*vertices)[region[i]] = moved[i];
      in_region[region[i]] = 0;
    }
    FindTurned(rotation, *vertices, region, &is_listed, turned);
  }
}

// With n the area normal of a face and e the unit normal wanted, n . e depends
// on the vertices by e x (the opposite edge); each face asks for the least
// movement that makes n . e = kTurnedCosine |n| (position-based dynamics:
// Mueller et al., 2007).
void Unfolder::TurnBack(const std::vector<Matrix3d>& rotation,
                        std::vector<int>* turned,
                        std::vector<Vector3d>* vertices) const {
  if (turned->empty()) return;
  std::vector<Vector3d> sum(vertices->size(), Vector3d::Zero());
  std::vector<int> count(vertices->size(), 0);
  std::vector<char> is_listed(triangles_.size(), 0);
  std::vector<int> moved;
  for (int round = 0; !turned->empty() && round < kTurningRounds; ++round) {
    moved.clear();
    for (const int index : *turned) {
      const Triangle& t = triangles_[index];
      const Vector3d expected = Expected(rotation, index).stableNormalized();
      const Vector3d a = (*vertices)[t[1]] - (*vertices)[t[0]];
      const Vector3d b = (*vertices)[t[2]] - (*vertices)[t[0]];
      const Vector3d normal = a.cross(b);
      const Vector3d by_second = b.cross(expected);
      const Vector3d by_third = expected.cross(a);
      const std::array<Vector3d, 3> by = {
          -by_second - by_third, by_second, by_third};
      const double squared =
          by[0].squaredNorm() + by[1].squaredNorm() + by[2].squaredNorm();
      if (!(squared > 0)) continue;  // no area and no direction
      const double step =
          (kTurnedCosine * normal.norm() - normal.dot(expected)) / squared;
      for (int i = 0; i < 3; ++i) {
        if (count[t[i]]++ == 0) moved.push_back(t[i]);
        sum[t[i]] += step * by[i];
      }
    }
    for (const int v : moved) {
      (*vertices)[v] += kTurningStep / count[v] * sum[v];
      sum[v].setZero();
      count[v] = 0;
    }
    if (moved.empty()) return;  // they would be lost from the list
    FindTurned(rotation, *vertices, moved, &is_listed, turned);
  }
}

}  // namespace sweepfit
