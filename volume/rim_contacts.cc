// SPDX-License-Identifier: Apache-2.0
#include "volume/rim_contacts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// How far from the edge of the silhouette a contact is looked for, pixels:
// along the edge, inwards and outwards.
constexpr double kAlong = 1.5;
constexpr double kInwards = 8;
constexpr double kOutwards = 3;
// Vertices this much less far out than the best, pixels, share 1/e of its vote.
constexpr double kTie = 0.4;
constexpr double kLeastSlope = 0.5;

struct EdgePoint {
  Vector2d pixel;
  Vector2d outward;  // unit
};

// About one point for every two pixels of the edge.
std::vector<EdgePoint> EdgePoints(const cv::Mat1f& distance) {
  std::vector<EdgePoint> points;
  for (int v = 1; v + 1 < distance.rows; ++v) {
    for (int u = 1 + v % 2; u + 1 < distance.cols; u += 2) {
      const float d = distance(v, u);
      if (!(d > -0.5f && d <= 0.5f)) continue;
      const Vector2d gradient(0.5 * (distance(v, u + 1) - distance(v, u - 1)),
                              0.5 * (distance(v + 1, u) - distance(v - 1, u)));
      const double norm = gradient.norm();
      if (norm < 0.5) continue;  // a ridge between two edges
      const Vector2d outward = gradient / norm;
      points.push_back({Vector2d(u, v) - d * outward, outward});
    }
  }
  return points;
}

struct Candidate {
  int vertex;
  Vector2d pixel;
  double metres_per_pixel;
  Vector3d ray;
};

// Candidates sorted into square cells of the picture.
class CandidateGrid {
 public:
  static constexpr int kCell = 8;  // pixels, no less than any reach above

  CandidateGrid(int width, int height, std::vector<Candidate> candidates)
      : columns_(width / kCell + 1),
        rows_(height / kCell + 1),
        candidates_(std::move(candidates)) {
    first_.assign(static_cast<size_t>(columns_) * rows_ + 1, 0);
    std::stable_sort(candidates_.begin(),
                     candidates_.end(),
                     [this](const Candidate& a, const Candidate& b) {
                       return CellOf(a.pixel) < CellOf(b.pixel);
                     });
    for (const Candidate& c : candidates_) ++first_[CellOf(c.pixel) + 1];
    for (size_t i = 0; i + 1 < first_.size(); ++i) first_[i + 1] += first_[i];
  }

  template <typename Visit>
  void ForEachNear(const Vector2d& pixel, Visit visit) const {
    const int column = static_cast<int>(pixel.x()) / kCell;
    const int row = static_cast<int>(pixel.y()) / kCell;
    for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r) {
      const int from = std::max(0, column - 1);
      const int to = std::min(columns_ - 1, column + 1);
      const int end = first_[r * columns_ + to + 1];
      for (int i = first_[r * columns_ + from]; i < end; ++i) {
        visit(candidates_[i]);
      }
    }
  }

 private:
  int CellOf(const Vector2d& pixel) const {
    return static_cast<int>(pixel.y()) / kCell * columns_ +
           static_cast<int>(pixel.x()) / kCell;
  }

  int columns_, rows_;
  std::vector<Candidate> candidates_;
  std::vector<int> first_;
};

}  // namespace

std::vector<OffsetTarget> FindRimContacts(const View& view,
                                          const std::vector<Vector3d>& vertices,
                                          const std::vector<Vector3d>& normals,
                                          double sigma) {
  const Camera& camera = view.camera;
  const cv::Mat1f& distance = view.signed_distance;
  const Vector3d center = camera.CenterInWorld();
  std::vector<Candidate> candidates;
  for (size_t v = 0; v < vertices.size(); ++v) {
    constexpr double kFacing = 0.7;
    const Vector3d to_vertex = vertices[v] - center;
    const double facing = to_vertex.dot(normals[v]);
    if (facing * facing > kFacing * kFacing * to_vertex.squaredNorm()) continue;
    const Vector3d in_camera = camera.PointInCamera(vertices[v]);
    if (!(in_camera.z() > 0)) continue;
    const Vector2d pixel = (camera.K * in_camera).hnormalized();
    if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= distance.cols - 1 &&
          pixel.y() <= distance.rows - 1)) {
      continue;
    }
    if (SampleBilinear(distance, pixel).value < -kInwards) continue;
    candidates.push_back({static_cast<int>(v),
                          pixel,
                          in_camera.z() / camera.FocalLength(),
                          to_vertex.normalized()});
  }
  const CandidateGrid grid(distance.cols, distance.rows, std::move(candidates));

  // Per vertex the votes and their mean.
  struct Sum {
    double weight = 0, value = 0, slope = 0;
  };
  std::vector<Sum> sums(vertices.size());
  struct Vote {
    int vertex;
    double out, value, slope;
  };
  std::vector<Vote> votes;
  for (const EdgePoint& point : EdgePoints(distance)) {
    votes.clear();
    double farthest = -kInwards;
    const Vector3d outward_in_world =
        camera.camera_from_world.transpose() *
        Vector3d(point.outward.x(), point.outward.y(), 0);
    grid.ForEachNear(point.pixel, [&](const Candidate& c) {
      const Vector2d offset = c.pixel - point.pixel;
      const double out = offset.dot(point.outward);
      const double along =
          offset.x() * point.outward.y() - offset.y() * point.outward.x();
      if (std::abs(along) > kAlong || out < -kInwards || out > kOutwards) {
        return;
      }
      const Vector3d across =
          (outward_in_world - outward_in_world.dot(c.ray) * c.ray).normalized();
      const double slope = across.dot(normals[c.vertex]);
      if (slope < kLeastSlope) return;
      votes.push_back({c.vertex, out, -out * c.metres_per_pixel, slope});
      farthest = std::max(farthest, out);
    });
    double total = 0;
    for (const Vote& vote : votes) {
      total += std::exp((vote.out - farthest) / kTie);
    }
    for (const Vote& vote : votes) {
      const double share = std::exp((vote.out - farthest) / kTie) / total;
      Sum& sum = sums[vote.vertex];
      sum.weight += share;
      sum.value += share * vote.value;
      sum.slope += share * vote.slope;
    }
  }
  std::vector<OffsetTarget> targets;
  for (size_t v = 0; v < sums.size(); ++v) {
    const Sum& sum = sums[v];
    if (sum.weight < 1e-3) continue;
    targets.push_back({static_cast<int>(v),
                       sum.slope / sum.weight,
                       sum.value / sum.weight,
                       sum.weight / (sigma * sigma)});
  }
  return targets;
}

}  // namespace sweepfit
