// SPDX-License-Identifier: Apache-2.0
#include "model/texture_atlas.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <utility>

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2f;
using Eigen::Vector3d;

constexpr int kGrid = 1024;            // cells along a side to look for overlap
constexpr double kMostOverlap = 0.02;  // slivers at borders of charts
constexpr double kGutter = 6.0 / 2048;  // around each chart
constexpr int kSmallestChart = 12;      // triangles
constexpr int kMergeRounds = 8;

bool WithinUnitSquare(const CornerCoordinates& uv) {
  constexpr float kSlack = 1e-3f;
  for (const auto& corners : uv) {
    for (const Vector2f& corner : corners) {
      if (!(corner.minCoeff() >= -kSlack && corner.maxCoeff() <= 1 + kSlack)) {
        return false;  // or no number
      }
    }
  }
  return true;
}

bool Usable(const CornerCoordinates& uv) {
  return WithinUnitSquare(uv) && OverlapShare(uv) <= kMostOverlap;
}

// The squares of the materials side by side, a little apart.
CornerCoordinates SideBySide(const CornerCoordinates& uv,
                             const std::vector<int>& material) {
  std::map<int, int> tile;
  for (const int m : material) {
    tile.emplace(m, static_cast<int>(tile.size()));
  }
  const int across =
      static_cast<int>(std::ceil(std::sqrt(static_cast<double>(tile.size()))));
  const float side = 1.0f / static_cast<float>(across);
  const float inset = static_cast<float>(kGutter);
  CornerCoordinates moved = uv;
  for (std::size_t t = 0; t < moved.size(); ++t) {
    const int index = tile.at(material[t]);
    const Vector2f origin(static_cast<float>(index % across) * side,
                          static_cast<float>(index / across) * side);
    for (Vector2f& corner : moved[t]) {
      corner = origin + Vector2f::Constant(inset) + (side - 2 * inset) * corner;
    }
  }
  return moved;
}

// ------------------------------------------------------------- box atlas

class Boxes {
 public:
  Boxes(const TriangleMesh& mesh, const std::vector<int>& group)
      : mesh_(mesh), group_(group) {
    FindNeighbours();
    Label();
    for (int round = 0; round < kMergeRounds; ++round) {
      FindCharts();
      if (!MergeSmallCharts()) break;
    }
    FindCharts();
  }

  CornerCoordinates Make() const {
    CornerCoordinates uv(mesh_.triangles.size());
    std::vector<Vector2d> size(charts_.size());
    for (std::size_t c = 0; c < charts_.size(); ++c) {
      size[c] = Project(charts_[c], &uv);
    }
    std::vector<Vector2d> origin;
    const double scale = Pack(size, &origin);
    for (std::size_t c = 0; c < charts_.size(); ++c) {
      for (const int t : charts_[c]) {
        for (Vector2f& corner : uv[t]) {
          corner = (origin[c] + scale * corner.cast<double>()).cast<float>();
        }
      }
    }
    return uv;
  }

 private:
  void FindNeighbours() {
    std::map<std::pair<int, int>, int> first;
    neighbours_.assign(mesh_.triangles.size(), {-1, -1, -1});
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const Triangle& triangle = mesh_.triangles[t];
      for (int i = 0; i < 3; ++i) {
        const int a = triangle[i], b = triangle[(i + 1) % 3];
        const auto [found, is_new] = first.emplace(
            std::pair(std::min(a, b), std::max(a, b)), static_cast<int>(3 * t));
        if (is_new) {
          found->second += i;
          continue;
        }
        const int other = found->second;
        neighbours_[t][i] = other / 3;
        neighbours_[other / 3][other % 3] = static_cast<int>(t);
      }
    }
  }

  // Six directions of each group.
  void Label() {
    const std::vector<Vector3d> normals = VertexNormals(mesh_);
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      Vector3d normal = Vector3d::Zero();
      for (const int v : mesh_.triangles[t]) normal += normals[v];
      int axis = 0;
      normal.cwiseAbs().maxCoeff(&axis);
      label_.push_back(6 * group_[t] + 2 * axis + (normal[axis] < 0 ? 1 : 0));
    }
  }

  void FindCharts() {
    charts_.clear();
    chart_of_.assign(label_.size(), -1);
    for (std::size_t seed = 0; seed < label_.size(); ++seed) {
      if (chart_of_[seed] >= 0) continue;
      const int chart = static_cast<int>(charts_.size());
      std::vector<int> members = {static_cast<int>(seed)};
      chart_of_[seed] = chart;
      for (std::size_t i = 0; i < members.size(); ++i) {
        for (const int next : neighbours_[members[i]]) {
          if (next < 0 || chart_of_[next] >= 0 ||
              label_[next] != label_[seed]) {
            continue;
          }
          chart_of_[next] = chart;
          members.push_back(next);
        }
      }
      charts_.push_back(std::move(members));
    }
  }

  // Small charts take the label of the neighbour with the longest border; of
  // opposite directions only where there is no other.
  bool MergeSmallCharts() {
    bool merged = false;
    std::vector<int> next = label_;
    for (const std::vector<int>& members : charts_) {
      if (static_cast<int>(members.size()) >= kSmallestChart) continue;
      std::map<int, double> border;
      const int own = label_[members[0]];
      for (const int t : members) {
        for (int i = 0; i < 3; ++i) {
          const int other = neighbours_[t][i];
          if (other < 0 || label_[other] == own) continue;
          const Triangle& triangle = mesh_.triangles[t];
          const double length = (mesh_.vertices[triangle[i]] -
                                 mesh_.vertices[triangle[(i + 1) % 3]])
                                    .norm();
          const bool opposite = (label_[other] ^ 1) == own;
          border[label_[other]] += (opposite ? 0.01 : 1) * length;
        }
      }
      if (border.empty()) continue;
      const auto longest = std::max_element(
          border.begin(), border.end(), [](const auto& a, const auto& b) {
            return a.second < b.second;
          });
      for (const int t : members) next[t] = longest->first;
      merged = true;
    }
    label_ = next;
    return merged;
  }

  // A chart along its axis, its longest direction up, from the origin. Returns
  // its size.
  Vector2d Project(const std::vector<int>& chart, CornerCoordinates* uv) const {
    const int axis = label_[chart[0]] % 6 / 2;
    const int across = axis == 0 ? 2 : 0, up = axis == 1 ? 2 : 1;
    const auto flat = [&](int v) {
      return Vector2d(mesh_.vertices[v][across], mesh_.vertices[v][up]);
    };
    Vector2d mean = Vector2d::Zero();
    for (const int t : chart) {
      for (const int v : mesh_.triangles[t]) mean += flat(v);
    }
    mean /= 3.0 * static_cast<double>(chart.size());
    Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
    for (const int t : chart) {
      for (const int v : mesh_.triangles[t]) {
        const Vector2d d = flat(v) - mean;
        spread += d * d.transpose();
      }
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(spread);
    Vector2d longest = solver.eigenvectors().col(1);
    if (longest.y() < 0) longest = -longest;
    const Vector2d right(longest.y(), -longest.x());
    Eigen::AlignedBox2d box;
    for (const int t : chart) {
      for (const int v : mesh_.triangles[t]) {
        box.extend(Vector2d(right.dot(flat(v)), longest.dot(flat(v))));
      }
    }
    for (const int t : chart) {
      for (int k = 0; k < 3; ++k) {
        const Vector2d p = flat(mesh_.triangles[t][k]);
        (*uv)[t][k] =
            (Vector2d(right.dot(p), longest.dot(p)) - box.min()).cast<float>();
      }
    }
    return box.sizes();
  }

  // Places on shelves for the largest scale at which all fit.
  static double Pack(const std::vector<Vector2d>& size,
                     std::vector<Vector2d>* origin) {
    std::vector<std::size_t> order(size.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) {
      return size[a].y() > size[b].y();
    });
    const auto fits = [&](double scale) {
      origin->assign(size.size(), Vector2d::Zero());
      Vector2d at(kGutter, kGutter);
      double shelf = 0;
      for (const std::size_t i : order) {
        const Vector2d extent = scale * size[i] + Vector2d::Constant(kGutter);
        if (at.x() + extent.x() > 1) {
          at = Vector2d(kGutter, at.y() + shelf);
          shelf = 0;
        }
        if (at.x() + extent.x() > 1 || at.y() + extent.y() > 1) return false;
        (*origin)[i] = at;
        at.x() += extent.x();
        shelf = std::max(shelf, extent.y());
      }
      return true;
    };
    double low = 0, high = 1;
    for (const Vector2d& s : size) high = std::max(high, s.maxCoeff());
    high = 2 / high;
    for (int step = 0; step < 40; ++step) {
      const double middle = (low + high) / 2;
      (fits(middle) ? low : high) = middle;
    }
    fits(low);
    return low;
  }

  const TriangleMesh& mesh_;
  const std::vector<int>& group_;
  std::vector<std::array<int, 3>> neighbours_;
  std::vector<int> label_;  // per triangle
  std::vector<int> chart_of_;
  std::vector<std::vector<int>> charts_;
};

}  // namespace

double OverlapShare(const CornerCoordinates& uv) {
  std::vector<std::uint8_t> covered(kGrid * kGrid, 0);
  std::int64_t total = 0, distinct = 0;
  const auto cross = [](const Vector2d& a, const Vector2d& b) {
    return a.x() * b.y() - a.y() * b.x();
  };
  for (const auto& corners : uv) {
    std::array<Vector2d, 3> p;
    Eigen::AlignedBox2d box;
    for (int k = 0; k < 3; ++k) {
      p[k] = kGrid * corners[k].cast<double>() - Vector2d::Constant(0.5);
      box.extend(p[k]);
    }
    const double area = cross(p[1] - p[0], p[2] - p[0]);
    if (!(std::abs(area) > 1e-12)) continue;
    const auto first = [](double x) {
      return static_cast<int>(std::clamp(std::ceil(x), 0.0, 1.0 * kGrid));
    };
    const auto last = [](double x) {
      return static_cast<int>(std::clamp(std::floor(x), -1.0, kGrid - 1.0));
    };
    for (int y = first(box.min().y()); y <= last(box.max().y()); ++y) {
      for (int x = first(box.min().x()); x <= last(box.max().x()); ++x) {
        const Vector2d at(x, y);
        bool inside = true;
        for (int k = 0; k < 3 && inside; ++k) {
          // Strictly, so that a shared edge is in neither.
          inside = cross(p[(k + 1) % 3] - p[k], at - p[k]) * area >
                   1e-9 * area * area;
        }
        if (!inside) continue;
        ++total;
        std::uint8_t& cell = covered[y * kGrid + x];
        if (cell == 0) ++distinct;
        cell = 1;
      }
    }
  }
  return distinct > 0 ? static_cast<double>(total - distinct) / distinct : 0;
}

CornerCoordinates BoxAtlas(const TriangleMesh& mesh,
                           const std::vector<int>& group) {
  return Boxes(mesh, group).Make();
}

std::string FitTextureAtlas(const TriangleMesh& mesh,
                            const std::vector<int>& material,
                            const std::vector<int>& group,
                            CornerCoordinates* uv) {
  if (Usable(*uv)) return "";
  const bool several =
      std::set<int>(material.begin(), material.end()).size() > 1;
  if (several && WithinUnitSquare(*uv)) {
    CornerCoordinates moved = SideBySide(*uv, material);
    if (OverlapShare(moved) <= kMostOverlap) {
      *uv = std::move(moved);
      return "the textures of the materials were put side by side";
    }
  }
  *uv = BoxAtlas(mesh, group);
  return "new texture coordinates were made; those of the file do not give "
         "every place a texel of its own";
}

}  // namespace sweepfit
