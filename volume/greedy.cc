// SPDX-License-Identifier: Apache-2.0
#include "volume/greedy.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <queue>
#include <utility>

#include "model/median.h"
#include "volume/intersect.h"
#include "volume/vertex_rings.h"
#include "volume/volume_impl.h"

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3i;

// A voxel on a flat surface has 17 occupied ones among its 26 neighbours; one
// with more than this stands in a pit.
constexpr int kMostNeighbors = 19;
constexpr int kSmoothingPasses = 2;

// Occupied voxels in a box, one byte each: 0 empty, 1 occupied. The outermost
// layer is empty.
class OccupancyBox {
 public:
  explicit OccupancyBox(const BlockGrid& grid) : voxel_(grid.voxel_size()) {
    Vector3d low, high;
    grid.Box(&low, &high);
    first_ = (low / voxel_).array().floor().cast<int>() - 1;
    const Vector3i last = (high / voxel_).array().ceil().cast<int>() + 1;
    size_ = last - first_ + Vector3i::Ones();
    occupied_.assign(static_cast<size_t>(size_.x()) * size_.y() * size_.z(), 0);
    for (const BlockGrid::Block& block : grid.blocks()) {
      for (int o = 0; o < BlockGrid::kBlockSize; ++o) {
        if (block.values[o] >= 0) continue;
        const Vector3i voxel = block.index * BlockGrid::kSide +
                               Vector3i(o >> 6, o >> 3 & 7, o & 7);
        occupied_[IdOf(voxel)] = 1;
      }
    }
    stride_ = {static_cast<std::int64_t>(size_.y()) * size_.z(), size_.z(), 1};
  }

  std::int64_t count() const {
    return static_cast<std::int64_t>(occupied_.size());
  }
  bool occupied(std::int64_t id) const { return occupied_[id] != 0; }
  void Clear(std::int64_t id) { occupied_[id] = 0; }
  std::int64_t IdOf(const Vector3i& voxel) const {
    const Vector3i v = voxel - first_;
    return (static_cast<std::int64_t>(v.x()) * size_.y() + v.y()) * size_.z() +
           v.z();
  }
  bool Contains(const Vector3i& voxel) const {
    const Vector3i v = voxel - first_;
    return (v.array() >= 0).all() && (v.array() < size_.array()).all();
  }
  Vector3i VoxelOf(std::int64_t id) const {
    const auto z = static_cast<int>(id % size_.z());
    const auto y = static_cast<int>(id / size_.z() % size_.y());
    const auto x = static_cast<int>(id / size_.z() / size_.y());
    return first_ + Vector3i(x, y, z);
  }
  Vector3d PointOf(std::int64_t id) const {
    return voxel_ * VoxelOf(id).cast<double>();
  }
  // Of an occupied voxel, which never lies in the outermost layer.
  template <typename Visit>
  void ForEachNeighbor(std::int64_t id, Visit visit) const {
    for (int n = 0; n < 27; ++n) {
      if (n == 13) continue;
      visit(id + (n / 9 - 1) * stride_[0] + (n / 3 % 3 - 1) * stride_[1] +
            (n % 3 - 1));
    }
  }
  bool IsSurface(std::int64_t id) const {
    if (!occupied(id)) return false;
    for (const std::int64_t stride : stride_) {
      if (!occupied(id + stride) || !occupied(id - stride)) return true;
    }
    return false;
  }
  // Nothing occupied between the voxel and a point far outside.
  bool IsVisibleFrom(std::int64_t id, const Vector3d& eye) const {
    const Vector3d start = VoxelOf(id).cast<double>();
    const Vector3d step = (eye / voxel_ - start).normalized();
    // The voxel's own layer does not hide it.
    for (double t = 2;; t += 0.9) {
      const Vector3i at =
          (start + t * step).array().round().cast<int>().matrix();
      if (!Contains(at)) return true;
      if (occupied(IdOf(at))) return false;
    }
  }

 private:
  double voxel_;
  Vector3i first_, size_;
  std::array<std::int64_t, 3> stride_;
  std::vector<std::uint8_t> occupied_;
};

struct SeenColor {
  Vector3d color;   // 8 bit, smoothed to the size of a voxel
  double variance;  // of a channel within the voxel's image
};

// One picture, smoothed to the size of a voxel, and how many voxels support
// each of its elements: squares about as large as a voxel's image.
class GreedyView {
 public:
  GreedyView(const View& view, double voxel, const Vector3d& middle)
      : camera_(view.camera), center_in_world_(view.camera.CenterInWorld()) {
    const double pixels =
        voxel * camera_.FocalLength() / (middle - center_in_world_).norm();
    element_ = std::max(1.0, pixels);
    const double sigma = std::max(0.5, 0.4 * pixels);
    cv::Mat3f image;
    view.image.convertTo(image, CV_32F);
    cv::GaussianBlur(image, image_, {}, sigma);
    // Texture finer than a voxel is no disagreement.
    const cv::Mat3f deviation = image - image_;
    cv::Mat3f squares = deviation.mul(deviation);
    cv::GaussianBlur(squares, squares, {}, 2 * sigma);
    cv::transform(squares, variance_, cv::Matx13f(1 / 3.f, 1 / 3.f, 1 / 3.f));
    columns_ = static_cast<int>(camera_.width / element_) + 1;
    rows_ = static_cast<int>(camera_.height / element_) + 1;
    support_.assign(static_cast<size_t>(columns_) * rows_, 0);
  }

  // The element in which a point lies, or -1.
  int ElementOf(const Vector3d& point) const {
    const Vector3d in_camera = camera_.PointInCamera(point);
    if (!(in_camera.z() > 0)) return -1;
    const Vector2d pixel =
        camera_.Distort((camera_.K * in_camera).hnormalized());
    if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= camera_.width - 1 &&
          pixel.y() <= camera_.height - 1)) {
      return -1;
    }
    return static_cast<int>(pixel.y() / element_) * columns_ +
           static_cast<int>(pixel.x() / element_);
  }
  // The point must lie in an element.
  SeenColor ColorAt(const Vector3d& point) const {
    const Vector2d pixel = camera_.Project(point);
    const auto u = static_cast<int>(std::lround(pixel.x()));
    const auto v = static_cast<int>(std::lround(pixel.y()));
    const cv::Vec3f& c = image_(v, u);
    return {{c[0], c[1], c[2]}, variance_(v, u)};
  }
  std::vector<int>& support() { return support_; }
  const std::vector<int>& support() const { return support_; }
  const Vector3d& center_in_world() const { return center_in_world_; }

 private:
  Camera camera_;
  Vector3d center_in_world_;
  cv::Mat3f image_;
  cv::Mat1f variance_;
  double element_;
  int columns_, rows_;
  std::vector<int> support_;
};

class GreedyCarver {
 public:
  GreedyCarver(const std::vector<View>& views,
               const Volume& hull,
               const GreedyOptions& options)
      : options_(options), voxel_(hull.voxel_size()), box_(hull.impl().blocks) {
    const Vector3d middle = 0.5 * (hull.BoxMin() + hull.BoxMax());
    for (const View& view : views) views_.emplace_back(view, voxel_, middle);
    tbb::parallel_for(size_t{0}, views_.size(), [&](size_t i) {
      for (std::int64_t id = 0; id < box_.count(); ++id) {
        if (!box_.occupied(id)) continue;
        const int element = views_[i].ElementOf(box_.PointOf(id));
        if (element >= 0) ++views_[i].support()[element];
      }
    });
  }

  void Run();
  // The surface between carved voxels and the rest.
  TriangleMesh Mesh(const Volume& hull) const;
  std::int64_t num_carved() const { return num_carved_; }

 private:
  struct Entry {
    double ratio;
    std::int64_t id;
    int depth;  // voxels below the hull's surface
    bool operator<(const Entry& other) const {
      // The least likely comes out of the queue first.
      return ratio != other.ratio ? ratio > other.ratio : id > other.id;
    }
  };
  double LogRatio(std::int64_t id) const;
  bool MayGo(const Entry& entry) const;
  void Carve(std::int64_t id);

  const GreedyOptions& options_;
  double voxel_;
  OccupancyBox box_;
  std::vector<GreedyView> views_;
  std::int64_t num_carved_ = 0;
};

double GreedyCarver::LogRatio(std::int64_t id) const {
  const Vector3d point = box_.PointOf(id);
  std::vector<SeenColor> colors;
  for (const GreedyView& view : views_) {
    if (view.ElementOf(point) < 0) continue;
    if (!box_.IsVisibleFrom(id, view.center_in_world())) continue;
    colors.push_back(view.ColorAt(point));
  }
  if (colors.size() < 2) return 0;
  // Median of every channel: one wrong view does not move it.
  Vector3d middle;
  std::vector<double> channel(colors.size());
  for (int c = 0; c < 3; ++c) {
    for (size_t i = 0; i < colors.size(); ++i) channel[i] = colors[i].color[c];
    middle[c] = MedianInPlace(&channel);
  }
  // Against a density of 1 / 256 per channel.
  double ratio = 0;
  for (const SeenColor& seen : colors) {
    const double variance =
        options_.sigma_color * options_.sigma_color + seen.variance;
    ratio += 3 * std::log(256.0) -
             1.5 * std::log(2 * std::numbers::pi * variance) -
             0.5 * (seen.color - middle).squaredNorm() / variance;
  }
  return ratio;
}

bool GreedyCarver::MayGo(const Entry& entry) const {
  if (entry.depth * voxel_ > options_.max_depth) return false;
  int neighbors = 0;
  box_.ForEachNeighbor(
      entry.id, [&](std::int64_t next) { neighbors += box_.occupied(next); });
  if (neighbors > kMostNeighbors) return false;
  const Vector3d point = box_.PointOf(entry.id);
  for (const GreedyView& view : views_) {
    const int element = view.ElementOf(point);
    if (element >= 0 && view.support()[element] < 2) {
      return false;
    }
  }
  return true;
}

void GreedyCarver::Carve(std::int64_t id) {
  const Vector3d point = box_.PointOf(id);
  for (GreedyView& view : views_) {
    const int element = view.ElementOf(point);
    if (element >= 0) --view.support()[element];
  }
  box_.Clear(id);
  ++num_carved_;
}

void GreedyCarver::Run() {
  std::vector<Entry> entries;
  for (std::int64_t id = 0; id < box_.count(); ++id) {
    if (box_.IsSurface(id)) entries.push_back({0, id, 1});
  }
  tbb::parallel_for(tbb::blocked_range<size_t>(0, entries.size(), 64),
                    [&](const tbb::blocked_range<size_t>& part) {
                      for (size_t i = part.begin(); i < part.end(); ++i) {
                        entries[i].ratio = LogRatio(entries[i].id);
                      }
                    });
  std::priority_queue<Entry> queue;
  for (const Entry& entry : entries) {
    if (entry.ratio < options_.threshold) queue.push(entry);
  }
  while (!queue.empty()) {
    const Entry entry = queue.top();
    queue.pop();
    if (!box_.occupied(entry.id)) continue;
    // What was in front of it may have gone since.
    const double ratio = LogRatio(entry.id);
    if (ratio != entry.ratio) {
      if (ratio < options_.threshold)
        queue.push({ratio, entry.id, entry.depth});
      continue;
    }
    if (!MayGo(entry)) continue;
    Carve(entry.id);
    box_.ForEachNeighbor(entry.id, [&](std::int64_t next) {
      if (!box_.IsSurface(next)) return;
      const double next_ratio = LogRatio(next);
      if (next_ratio < options_.threshold) {
        queue.push({next_ratio, next, entry.depth + 1});
      }
    });
  }
}

TriangleMesh GreedyCarver::Mesh(const Volume& hull) const {
  // Carved voxels lie half a voxel outside, their neighbours at most half a
  // voxel inside.
  std::vector<BlockGrid::Block> blocks = hull.impl().blocks.blocks();
  const auto half = static_cast<float>(0.5 * voxel_);
  for (BlockGrid::Block& block : blocks) {
    for (int o = 0; o < BlockGrid::kBlockSize; ++o) {
      float& value = block.values[o];
      if (value >= 0) continue;
      const std::int64_t id = box_.IdOf(block.index * BlockGrid::kSide +
                                        Vector3i(o >> 6, o >> 3 & 7, o & 7));
      if (!box_.occupied(id)) {
        value = half;
      } else if (box_.IsSurface(id)) {
        value = std::max(value, -half);
      }
    }
  }
  const Volume carved = MakeVolume(
      BlockGrid(hull.voxel_size(), hull.band_half_width(), std::move(blocks)));
  TriangleMesh mesh = carved.ExtractMesh();
  // Only where voxels have gone: the hull itself is smooth enough.
  const VertexRings rings(mesh);
  std::vector<bool> moves(mesh.vertices.size());
  for (size_t v = 0; v < moves.size(); ++v) {
    moves[v] = hull.Sample(mesh.vertices[v]) < -0.25 * voxel_;
  }
  for (int pass = 0; pass < kSmoothingPasses; ++pass) {
    std::vector<Vector3d> next = mesh.vertices;
    for (int v = 0; v < rings.size(); ++v) {
      if (!moves[v] || rings[v].empty()) continue;
      Vector3d mean = Vector3d::Zero();
      for (const int w : rings[v]) mean += mesh.vertices[w];
      next[v] = 0.5 * (next[v] + mean / static_cast<double>(rings[v].size()));
    }
    mesh.vertices.swap(next);
  }
  return mesh;
}

}  // namespace

std::optional<std::string> GreedyOptions::Check() const {
  if (!(max_depth >= 0.001 && max_depth <= 0.2)) {
    return "volume.greedy.max_depth: must lie between 0.001 and 0.2 m";
  }
  if (!(sigma_color >= 1 && sigma_color <= 60)) {
    return "volume.greedy.sigma_color: must lie between 1 and 60";
  }
  if (!(threshold <= 0)) return "volume.greedy.threshold: must not be positive";
  return std::nullopt;
}

Volume CarveGreedily(const std::vector<View>& views,
                     Volume hull,
                     const GreedyOptions& options,
                     StageSummary* summary) {
  GreedyCarver carver(views, hull, options);
  carver.Run();
  if (summary != nullptr) {
    summary->figures["carved_voxels"] = carver.num_carved();
    summary->figures["hull_volume"] = hull.EnclosedVolume();
  }
  if (carver.num_carved() == 0) return hull;
  Volume carved = IntersectWithMesh(hull, carver.Mesh(hull));
  if (summary != nullptr) summary->figures["volume"] = carved.EnclosedVolume();
  return carved;
}

}  // namespace sweepfit
