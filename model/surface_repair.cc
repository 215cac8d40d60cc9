// SPDX-License-Identifier: Apache-2.0
#include "model/surface_repair.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <numeric>
#include <set>
#include <utility>

namespace sweepfit {
namespace {

using Eigen::Vector3d;

constexpr double kLargestHoleByHeight = 0.15;   // around
constexpr double kReachByHeight = 0.9;          // of the piece that is kept
constexpr double kConsiderableByHeight = 0.25;  // pieces worth a word
constexpr std::size_t kFewestTriangles = 500;

std::string Number(const char* format, double value) {
  char text[32];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

class Repair {
 public:
  Repair(SkinnedSurface* surface,
         std::vector<Vector3d>* vertices,
         std::vector<std::string>* notes)
      : surface_(*surface), vertices_(*vertices), notes_(*notes) {}

  std::string Run() {
    DropLooseVertices();
    if (surface_.triangles.size() < kFewestTriangles) {
      return "the skinned surface has only " +
             std::to_string(surface_.triangles.size()) + " triangles";
    }
    Eigen::AlignedBox3d box;
    for (const Vector3d& vertex : vertices_) box.extend(vertex);
    lowest_ = box.min().y();
    height_ = box.sizes().y();
    if (!(height_ > 0)) return "the skinned surface has no height";
    DropDoubleFaces();
    SplitTouchingSheets();
    for (const auto& step : {&Repair::KeepTallestPiece,
                             &Repair::TurnFacesAlike,
                             &Repair::FillHoles}) {
      std::string fault = (this->*step)();
      if (!fault.empty()) return fault;
    }
    const double volume = EnclosedVolume({vertices_, surface_.triangles});
    if (volume < 0) {
      for (std::size_t t = 0; t < surface_.triangles.size(); ++t) Flip(t);
      notes_.push_back("the surface was turned inside out");
    }
    return "";
  }

 private:
  using Edge = std::pair<int, int>;

  static Edge Undirected(int a, int b) {
    return {std::min(a, b), std::max(a, b)};
  }

  void Flip(std::size_t t) {
    std::swap(surface_.triangles[t][1], surface_.triangles[t][2]);
    std::swap(surface_.uv[t][1], surface_.uv[t][2]);
  }

  // Keeps the triangles that are flagged.
  void KeepTriangles(const std::vector<bool>& keep) {
    std::size_t kept = 0;
    for (std::size_t t = 0; t < keep.size(); ++t) {
      if (!keep[t]) continue;
      surface_.triangles[kept] = surface_.triangles[t];
      surface_.uv[kept] = surface_.uv[t];
      surface_.material[kept] = surface_.material[t];
      surface_.mesh[kept] = surface_.mesh[t];
      ++kept;
    }
    surface_.triangles.resize(kept);
    surface_.uv.resize(kept);
    surface_.material.resize(kept);
    surface_.mesh.resize(kept);
  }

  // A new vertex like an old one.
  int Duplicate(int vertex) {
    const auto repeat = [vertex](auto* list) {
      auto copy = (*list)[vertex];
      list->push_back(std::move(copy));
    };
    repeat(&vertices_);
    repeat(&surface_.as_nodes.vertices);
    repeat(&surface_.as_bound.vertices);
    repeat(&surface_.weights);
    return static_cast<int>(vertices_.size()) - 1;
  }

  void DropDoubleFaces() {
    std::set<Triangle> seen;
    std::vector<bool> keep(surface_.triangles.size());
    for (std::size_t t = 0; t < keep.size(); ++t) {
      Triangle sorted = surface_.triangles[t];
      std::sort(sorted.begin(), sorted.end());
      keep[t] = seen.insert(sorted).second;
    }
    KeepTriangles(keep);
  }

  std::map<Edge, std::vector<int>> TrianglesOfEdges() const {
    std::map<Edge, std::vector<int>> triangles;
    for (std::size_t t = 0; t < surface_.triangles.size(); ++t) {
      const Triangle& triangle = surface_.triangles[t];
      for (int i = 0; i < 3; ++i) {
        triangles[Undirected(triangle[i], triangle[(i + 1) % 3])].push_back(
            static_cast<int>(t));
      }
    }
    return triangles;
  }

  // Triangles around a vertex that are not joined by edges of two triangles get
  // vertices of their own. That also parts sheets that meet in an edge.
  void SplitTouchingSheets() {
    const auto edges = TrianglesOfEdges();
    std::vector<std::vector<int>> around(vertices_.size());
    for (std::size_t t = 0; t < surface_.triangles.size(); ++t) {
      for (const int v : surface_.triangles[t]) {
        around[v].push_back(static_cast<int>(t));
      }
    }
    const std::vector<Triangle> before = surface_.triangles;
    for (std::size_t v = 0; v < around.size(); ++v) {
      const int vertex = static_cast<int>(v);
      std::set<int> left(around[v].begin(), around[v].end());
      bool first = true;
      while (!left.empty()) {
        std::vector<int> sheet = {*left.begin()};
        left.erase(left.begin());
        for (std::size_t i = 0; i < sheet.size(); ++i) {
          for (const int other : before[sheet[i]]) {
            if (other == vertex) continue;
            const std::vector<int>& both = edges.at(Undirected(vertex, other));
            if (both.size() != 2) continue;
            for (const int t : both) {
              if (left.erase(t) > 0) sheet.push_back(t);
            }
          }
        }
        if (!first) {
          const int copy = Duplicate(vertex);
          for (const int t : sheet) {
            std::replace(surface_.triangles[t].begin(),
                         surface_.triangles[t].end(),
                         vertex,
                         copy);
          }
        }
        first = false;
      }
    }
  }

  // Pieces as triangles that share vertices.
  std::vector<int> PieceOfTriangles(int* num_pieces) const {
    std::vector<int> parent(vertices_.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto find = [&](int v) {
      while (parent[v] != v) v = parent[v] = parent[parent[v]];
      return v;
    };
    for (const Triangle& triangle : surface_.triangles) {
      parent[find(triangle[1])] = find(triangle[0]);
      parent[find(triangle[2])] = find(triangle[0]);
    }
    std::map<int, int> index;
    std::vector<int> piece;
    for (const Triangle& triangle : surface_.triangles) {
      piece.push_back(
          index.emplace(find(triangle[0]), static_cast<int>(index.size()))
              .first->second);
    }
    *num_pieces = static_cast<int>(index.size());
    return piece;
  }

  std::string KeepTallestPiece() {
    struct Piece {
      Eigen::AlignedBox3d box;
      double area = 0;
      int triangles = 0;
      std::set<int> meshes;
    };
    int num = 0;
    const std::vector<int> piece_of = PieceOfTriangles(&num);
    std::vector<Piece> pieces(num);
    for (std::size_t t = 0; t < piece_of.size(); ++t) {
      Piece& piece = pieces[piece_of[t]];
      const Triangle& triangle = surface_.triangles[t];
      for (const int v : triangle) piece.box.extend(vertices_[v]);
      piece.area += (vertices_[triangle[1]] - vertices_[triangle[0]])
                        .cross(vertices_[triangle[2]] - vertices_[triangle[0]])
                        .norm() /
                    2;
      ++piece.triangles;
      piece.meshes.insert(surface_.mesh[t]);
    }
    double tallest = 0;
    for (const Piece& piece : pieces) {
      tallest = std::max(tallest, piece.box.sizes().y());
    }
    int best = -1;
    for (int i = 0; i < num; ++i) {
      if (pieces[i].box.sizes().y() < 0.95 * tallest) continue;
      if (best < 0 || pieces[i].area > pieces[best].area) best = i;
    }
    const auto describe = [&](const Piece& piece) {
      std::string names;
      for (const int mesh : piece.meshes) {
        names += (names.empty() ? "'" : ", '") + surface_.mesh_name[mesh] + "'";
      }
      const auto percent = [&](double y) {
        return Number("%.0f", 100 * (y - lowest_) / height_);
      };
      return names + " (" + std::to_string(piece.triangles) +
             " triangles, from " + percent(piece.box.min().y()) + " to " +
             percent(piece.box.max().y()) + " % of the height)";
    };
    std::string large;
    int num_small = 0;
    for (int i = 0; i < num; ++i) {
      if (i == best) continue;
      if (pieces[i].box.diagonal().norm() < kConsiderableByHeight * height_) {
        ++num_small;
      } else {
        large += (large.empty() ? "" : "; ") + describe(pieces[i]);
      }
    }
    if (tallest < kReachByHeight * height_) {
      return "the skinned surface must be one piece from the feet to the "
             "crown; it is " +
             describe(pieces[best]) + (large.empty() ? "" : "; ") + large +
             ". Join what belongs to the body at its borders, or make one "
             "surface of it (in Blender: Join, Remesh, then transfer weights)";
    }
    if (!large.empty()) {
      notes_.push_back("pieces left out: " + large +
                       "; kept: " + describe(pieces[best]));
    }
    if (num_small > 0) {
      notes_.push_back(std::to_string(num_small) +
                       " small pieces left out (eyes, teeth, ...)");
    }
    std::vector<bool> keep(piece_of.size());
    for (std::size_t t = 0; t < keep.size(); ++t) {
      keep[t] = piece_of[t] == best;
    }
    KeepTriangles(keep);
    DropLooseVertices();
    return "";
  }

  void DropLooseVertices() {
    std::vector<int> index(vertices_.size(), -1);
    for (const Triangle& triangle : surface_.triangles) {
      for (const int v : triangle) index[v] = 0;
    }
    int kept = 0;
    for (std::size_t v = 0; v < index.size(); ++v) {
      if (index[v] < 0) continue;
      index[v] = kept;
      vertices_[kept] = vertices_[v];
      surface_.as_nodes.vertices[kept] = surface_.as_nodes.vertices[v];
      surface_.as_bound.vertices[kept] = surface_.as_bound.vertices[v];
      if (static_cast<std::size_t>(kept) != v) {
        surface_.weights[kept] = std::move(surface_.weights[v]);
      }
      ++kept;
    }
    vertices_.resize(kept);
    surface_.as_nodes.vertices.resize(kept);
    surface_.as_bound.vertices.resize(kept);
    surface_.weights.resize(kept);
    for (Triangle& triangle : surface_.triangles) {
      for (int& v : triangle) v = index[v];
    }
  }

  bool RunsAlong(int t, int a, int b) const {
    const Triangle& triangle = surface_.triangles[t];
    for (int i = 0; i < 3; ++i) {
      if (triangle[i] == a && triangle[(i + 1) % 3] == b) return true;
    }
    return false;
  }

  std::string TurnFacesAlike() {
    const auto edges = TrianglesOfEdges();
    const std::size_t num = surface_.triangles.size();
    std::vector<bool> done(num);
    int turned = 0;
    for (std::size_t seed = 0; seed < num; ++seed) {
      if (done[seed]) continue;
      done[seed] = true;
      std::vector<int> queue = {static_cast<int>(seed)};
      for (std::size_t i = 0; i < queue.size(); ++i) {
        const Triangle triangle = surface_.triangles[queue[i]];
        for (int k = 0; k < 3; ++k) {
          const int a = triangle[k], b = triangle[(k + 1) % 3];
          const std::vector<int>& both = edges.at(Undirected(a, b));
          if (both.size() > 2) {
            return "more than two faces of the skinned surface meet in an edge";
          }
          for (const int other : both) {
            if (done[other]) continue;
            done[other] = true;
            if (RunsAlong(other, a, b)) {
              Flip(other);
              ++turned;
            }
            queue.push_back(other);
          }
        }
      }
    }
    for (const auto& [edge, both] : edges) {
      if (both.size() == 2 && RunsAlong(both[0], edge.first, edge.second) ==
                                  RunsAlong(both[1], edge.first, edge.second)) {
        return "the faces of the skinned surface cannot be turned alike: it "
               "has only one side";
      }
    }
    if (turned > 0) {
      notes_.push_back(std::to_string(turned) + " faces turned to the outside");
    }
    return "";
  }

  std::string FillHoles() {
    // The next vertex along an open border, against the faces' direction.
    std::map<int, int> next;
    std::map<int, std::pair<int, int>> corner;  // triangle and corner of both
    const auto edges = TrianglesOfEdges();
    for (const auto& [edge, both] : edges) {
      if (both.size() != 1) continue;
      const Triangle& triangle = surface_.triangles[both[0]];
      for (int i = 0; i < 3; ++i) {
        const int a = triangle[i], b = triangle[(i + 1) % 3];
        if (Undirected(a, b) != edge) continue;
        next[b] = a;
        corner[b] = {both[0], (i + 1) % 3};
      }
    }
    std::vector<std::vector<int>> holes;
    double largest = 0;
    Vector3d at_largest = Vector3d::Zero();
    while (!next.empty()) {
      std::vector<int> hole;
      double around = 0;
      Vector3d middle = Vector3d::Zero();
      int v = next.begin()->first;
      for (auto found = next.find(v); found != next.end();
           found = next.find(v)) {
        hole.push_back(v);
        middle += vertices_[v];
        const int following = found->second;
        around += (vertices_[following] - vertices_[v]).norm();
        next.erase(found);
        v = following;
      }
      if (around > largest) {
        largest = around;
        at_largest = middle / static_cast<double>(hole.size());
      }
      holes.push_back(std::move(hole));
    }
    if (largest > kLargestHoleByHeight * height_) {
      return "the skinned surface must be closed but has " +
             std::to_string(holes.size()) + " holes; the largest is " +
             Number("%.0f", 100 * largest / height_) +
             " % of the height around, at " +
             Number("%.0f", 100 * (at_largest.y() - lowest_) / height_) +
             " % of the height. Close it, or make one surface of body and "
             "clothes (in Blender: Join, Remesh, then transfer weights)";
    }
    for (const std::vector<int>& hole : holes) Fill(hole, corner);
    if (!holes.empty()) {
      notes_.push_back(std::to_string(holes.size()) + " holes filled");
    }
    return "";
  }

  void Fill(const std::vector<int>& hole,
            const std::map<int, std::pair<int, int>>& corner) {
    const auto add = [&](int a, int b, int c) {
      // The texture's texel at the border.
      const auto& [t, k] = corner.at(a);
      const Eigen::Vector2f uv = surface_.uv[t][k];
      surface_.triangles.push_back({a, b, c});
      surface_.uv.push_back({uv, uv, uv});
      surface_.material.push_back(surface_.material[t]);
      surface_.mesh.push_back(surface_.mesh[t]);
    };
    const int num = static_cast<int>(hole.size());
    if (num == 3) {
      add(hole[0], hole[1], hole[2]);
      return;
    }
    const int middle = Duplicate(hole[0]);
    std::map<int, double> weights;
    const auto mean = [&](std::vector<Vector3d>* points) {
      Vector3d sum = Vector3d::Zero();
      for (const int v : hole) sum += (*points)[v];
      (*points)[middle] = sum / num;
    };
    mean(&vertices_);
    mean(&surface_.as_nodes.vertices);
    mean(&surface_.as_bound.vertices);
    for (const int v : hole) {
      for (const auto& [node, weight] : surface_.weights[v]) {
        weights[node] += weight / num;
      }
    }
    surface_.weights[middle].assign(weights.begin(), weights.end());
    for (int i = 0; i < num; ++i) add(hole[i], hole[(i + 1) % num], middle);
  }

  SkinnedSurface& surface_;
  std::vector<Vector3d>& vertices_;
  std::vector<std::string>& notes_;
  double lowest_ = 0, height_ = 0;
};

}  // namespace

std::string RepairSurface(SkinnedSurface* surface,
                          std::vector<Vector3d>* vertices,
                          std::vector<std::string>* notes) {
  return Repair(surface, vertices, notes).Run();
}

}  // namespace sweepfit
