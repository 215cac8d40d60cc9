// SPDX-License-Identifier: Apache-2.0
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "model/input_error.h"
#include "volume/components.h"
#include "volume/silhouette_cones.h"
#include "volume/volume.h"
#include "volume/volume_impl.h"

namespace sweepfit {
namespace {

// Voxels along the cells at which work is handed to threads.
constexpr int kCoarseSide = 64;
// More cells than a person can need: the units must be wrong.
constexpr size_t kMaxCoarseCells = 8000;
// A point must be seen by this many cameras to count as inside.
constexpr int kMinViews = 2;
// phi changes by at most this much per metre, perspective included.
constexpr double kLipschitz = 1.25;

// A cube of voxels and the cones that may still cut it.
struct Cell {
  Eigen::Vector3i first;   // index of the voxel with the lowest coordinates
  int side = 0;            // voxels
  std::vector<int> cones;  // those that may pass through or see only a part
  int num_inside = 0;      // other cones, which hold all of the cube
};

enum class Verdict { kOutside, kInside, kMixed };

class HullBuilder {
 public:
  HullBuilder(const std::vector<SilhouetteCone>& cones, double voxel_size)
      : cones_(cones),
        voxel_size_(voxel_size),
        band_(kBandVoxels * voxel_size) {}

  // The 64^3 cells near or inside the hull, in a fixed order.
  std::vector<Cell> CoarseCells() const;
  // Blocks of 8^3 voxels of one cell.
  void Refine(Cell cell, std::vector<BlockGrid::Block>* blocks) const;

 private:
  // Sorts the cell's cones into those that still matter and the rest.
  Verdict Judge(Cell* cell) const;
  void AddInside(const Cell& cell, std::vector<BlockGrid::Block>* blocks) const;
  void AddEvaluated(const Cell& cell,
                    std::vector<BlockGrid::Block>* blocks) const;
  static std::vector<Cell> Split(const Cell& cell);

  const std::vector<SilhouetteCone>& cones_;
  const double voxel_size_;
  const double band_;
};

Verdict HullBuilder::Judge(Cell* cell) const {
  const double half = 0.5 * (cell->side - 1);
  const Eigen::Vector3d center =
      voxel_size_ * (cell->first.cast<double>().array() + half).matrix();
  // Voxel centres lie within the ball; the surface of the cube of whole voxels
  // too, but for half a voxel that the band takes in.
  const double radius = voxel_size_ * std::sqrt(3.0) * (half + 0.5);
  const double clear = kLipschitz * radius + band_;
  std::vector<int> open;
  open.reserve(cell->cones.size());
  for (const int c : cell->cones) {
    double phi = 0;
    switch (cones_[c].EvaluateBall(center, radius, &phi)) {
      case SilhouetteCone::Sees::kNothing:
        break;
      case SilhouetteCone::Sees::kPart:
        open.push_back(c);
        break;
      case SilhouetteCone::Sees::kAll:
        if (phi > clear) return Verdict::kOutside;
        if (phi < -clear) {
          ++cell->num_inside;
        } else {
          open.push_back(c);
        }
    }
  }
  cell->cones = std::move(open);
  if (cell->num_inside + static_cast<int>(cell->cones.size()) < kMinViews) {
    return Verdict::kOutside;
  }
  return cell->cones.empty() ? Verdict::kInside : Verdict::kMixed;
}

std::vector<Cell> HullBuilder::Split(const Cell& cell) {
  std::vector<Cell> parts(8, cell);
  for (int i = 0; i < 8; ++i) {
    parts[i].side = cell.side / 2;
    parts[i].first +=
        parts[i].side * Eigen::Vector3i(i >> 2, i >> 1 & 1, i & 1);
  }
  return parts;
}

std::vector<Cell> HullBuilder::CoarseCells() const {
  const Eigen::Vector3d middle = MeetingPoint(cones_);
  double reach = 0;
  for (const SilhouetteCone& cone : cones_) {
    reach = std::max(reach, (cone.center_in_world() - middle).norm());
  }
  const double cells = 2 * reach / (kCoarseSide * voxel_size_);
  constexpr double kMaxSide = 1 << 20;
  if (!(cells < kMaxSide)) {
    throw FitError(
        "the cameras are too far from the person for the voxel size: check "
        "the units of the calibration");
  }
  Cell all;
  all.side = kCoarseSide;
  while (all.side < kCoarseSide * cells) all.side *= 2;
  for (int axis = 0; axis < 3; ++axis) {
    // Aligned to whole blocks so that every split is.
    all.first[axis] =
        static_cast<int>(std::floor(
            (middle[axis] / voxel_size_ - 0.5 * all.side) / kCoarseSide)) *
        kCoarseSide;
  }
  all.side += kCoarseSide;  // what the alignment cut off
  int side = kCoarseSide;
  while (side < all.side) side *= 2;
  all.side = side;
  for (size_t c = 0; c < cones_.size(); ++c) {
    all.cones.push_back(static_cast<int>(c));
  }

  std::vector<Cell> level = {all};
  while (true) {
    std::vector<Cell> next;
    for (Cell& cell : level) {
      if (Judge(&cell) == Verdict::kOutside) continue;
      next.push_back(std::move(cell));
    }
    if (next.size() > kMaxCoarseCells) {
      throw FitError(
          "the common part of the silhouettes is too large for a person: "
          "check the units of the calibration");
    }
    if (next.empty() || next[0].side == kCoarseSide) return next;
    level.clear();
    for (const Cell& cell : next) {
      for (Cell& part : Split(cell)) level.push_back(std::move(part));
    }
  }
}

void HullBuilder::Refine(Cell cell,
                         std::vector<BlockGrid::Block>* blocks) const {
  switch (Judge(&cell)) {
    case Verdict::kOutside:
      return;
    case Verdict::kInside:
      AddInside(cell, blocks);
      return;
    case Verdict::kMixed:
      break;
  }
  if (cell.side == BlockGrid::kSide) {
    AddEvaluated(cell, blocks);
    return;
  }
  for (Cell& part : Split(cell)) Refine(std::move(part), blocks);
}

void HullBuilder::AddInside(const Cell& cell,
                            std::vector<BlockGrid::Block>* blocks) const {
  const Eigen::Vector3i first = cell.first / BlockGrid::kSide;
  const int side = cell.side / BlockGrid::kSide;
  for (int x = 0; x < side; ++x) {
    for (int y = 0; y < side; ++y) {
      for (int z = 0; z < side; ++z) {
        BlockGrid::Block& block = blocks->emplace_back();
        block.index = first + Eigen::Vector3i(x, y, z);
        block.values.fill(static_cast<float>(-band_));
      }
    }
  }
}

void HullBuilder::AddEvaluated(const Cell& cell,
                               std::vector<BlockGrid::Block>* blocks) const {
  BlockGrid::Block block;
  block.index = cell.first / BlockGrid::kSide;
  bool empty = true;
  for (int o = 0; o < BlockGrid::kBlockSize; ++o) {
    const Eigen::Vector3i voxel =
        cell.first + Eigen::Vector3i(o >> 6, o >> 3 & 7, o & 7);
    const Eigen::Vector3d point = voxel_size_ * voxel.cast<double>();
    double value = -band_;
    int num_views = cell.num_inside;
    for (const int c : cell.cones) {
      double phi = 0;
      if (!cones_[c].Evaluate(point, &phi)) continue;
      ++num_views;
      value = std::max(value, phi);
      if (value >= band_) break;
    }
    if (num_views < kMinViews || value >= band_) value = band_;
    block.values[o] = static_cast<float>(value);
    empty = empty && value >= band_;
  }
  if (!empty) blocks->push_back(block);
}

BlockGrid BuildBlocks(const std::vector<SilhouetteCone>& cones,
                      double voxel_size) {
  const HullBuilder builder(cones, voxel_size);
  const std::vector<Cell> cells = builder.CoarseCells();
  // Every cell has its own place, so the order does not depend on threads.
  std::vector<std::vector<BlockGrid::Block>> parts(cells.size());
  tbb::parallel_for(tbb::blocked_range<size_t>(0, cells.size(), 1),
                    [&](const tbb::blocked_range<size_t>& range) {
                      for (size_t i = range.begin(); i < range.end(); ++i) {
                        builder.Refine(cells[i], &parts[i]);
                      }
                    });
  std::vector<BlockGrid::Block> blocks;
  for (const auto& part : parts) {
    blocks.insert(blocks.end(), part.begin(), part.end());
  }
  return BlockGrid(voxel_size, kBandVoxels * voxel_size, std::move(blocks));
}

}  // namespace

std::optional<std::string> HullOptions::Check() const {
  if (mode != "hull") return "volume.mode: must be hull, not '" + mode + "'";
  if (!(voxel_size >= 0.001 && voxel_size <= 0.05)) {
    return "volume.voxel_size: must lie between 0.001 and 0.05 m";
  }
  return std::nullopt;
}

Volume BuildVisualHull(const std::vector<View>& views,
                       const HullOptions& options,
                       Progress* progress,
                       StageSummary* summary) {
  const auto start = std::chrono::steady_clock::now();
  if (const auto error = options.Check()) throw InputError(*error);
  const std::vector<SilhouetteCone> cones = MakeSilhouetteCones(views);
  BlockGrid blocks = BuildBlocks(cones, options.voxel_size);
  const ComponentCount components = KeepLargestComponent(&blocks);
  if (components.num_components == 0) {
    throw FitError(
        "the silhouettes have no common part: check the calibration, the "
        "masks and their order");
  }
  auto vdb = MakeVdbGrid(blocks);
  Volume volume(
      std::make_unique<Volume::Impl>(std::move(blocks), std::move(vdb)));

  if (summary != nullptr) {
    summary->stage = "volume";
    summary->status = "ok";
    auto& figures = summary->figures;
    figures["mode"] = options.mode;
    figures["voxel_size"] = options.voxel_size;
    figures["num_views"] = views.size();
    figures["volume"] = volume.EnclosedVolume();
    const Eigen::Vector3d size = volume.BoxMax() - volume.BoxMin();
    figures["box_size"] = {size.x(), size.y(), size.z()};
    figures["num_components"] = components.num_components;
    figures["dropped_volume"] = components.dropped_volume;
  }
  // A stray limb is news, a few stray voxels are not.
  if (components.dropped_volume > 0.01 * volume.EnclosedVolume()) {
    char text[160];
    std::snprintf(text,
                  sizeof text,
                  "the hull has %d parts; %.1f l outside the largest (%.1f l) "
                  "were dropped",
                  components.num_components,
                  1e3 * components.dropped_volume,
                  1e3 * volume.EnclosedVolume());
    if (progress != nullptr) progress->Warning(text);
    if (summary != nullptr) {
      summary->status = "weak";
      summary->warnings.push_back(text);
    }
  }
  if (summary != nullptr) {
    summary->seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
            .count();
  }
  return volume;
}

}  // namespace sweepfit
