// SPDX-License-Identifier: Apache-2.0
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <unordered_map>
#include <utility>
#include <vector>

#include "model/input_error.h"
#include "model/median.h"
#include "volume/components.h"
#include "volume/coverage.h"
#include "volume/silhouette_cones.h"
#include "volume/volume.h"
#include "volume/volume_impl.h"

namespace sweepfit {
namespace {

// Voxels along the cells among which the person is looked for.
constexpr int kCoarseSide = 16;
// More cells than a person can need: the units must be wrong.
constexpr size_t kMaxCells = 400000;
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
  int num_hopeful = 0;     // of `cones`, those that may hold some of it
};

enum class Verdict { kOutside, kInside, kMixed };

class HullBuilder {
 public:
  HullBuilder(const std::vector<SilhouetteCone>& cones, double voxel_size)
      : cones_(cones),
        voxel_size_(voxel_size),
        band_(kBandVoxels * voxel_size) {}

  // The smallest coarse cells near or inside the hull, in a fixed order.
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
  cell->num_hopeful = 0;
  for (const int c : cell->cones) {
    double phi = 0;
    switch (cones_[c].EvaluateBall(center, radius, &phi)) {
      case SilhouetteCone::Sees::kNothing:
        break;
      case SilhouetteCone::Sees::kPart:
        open.push_back(c);
        if (phi < band_) ++cell->num_hopeful;
        break;
      case SilhouetteCone::Sees::kAll:
        if (phi > clear) return Verdict::kOutside;
        if (phi < -clear) {
          ++cell->num_inside;
        } else {
          open.push_back(c);
          ++cell->num_hopeful;
        }
    }
  }
  cell->cones = std::move(open);
  if (cell->num_inside + cell->num_hopeful < kMinViews) {
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
    // Aligned to whole cells so that every split is.
    all.first[axis] =
        static_cast<int>(std::round(
            (middle[axis] / voxel_size_ - 0.5 * all.side) / kCoarseSide)) *
        kCoarseSide;
  }
  for (size_t c = 0; c < cones_.size(); ++c) {
    all.cones.push_back(static_cast<int>(c));
  }

  std::vector<Cell> level = {all};
  while (true) {
    std::vector<Verdict> verdict(level.size());
    tbb::parallel_for(tbb::blocked_range<size_t>(0, level.size(), 64),
                      [&](const tbb::blocked_range<size_t>& range) {
                        for (size_t i = range.begin(); i < range.end(); ++i) {
                          verdict[i] = Judge(&level[i]);
                        }
                      });
    std::vector<Cell> next;
    for (size_t i = 0; i < level.size(); ++i) {
      if (verdict[i] != Verdict::kOutside) next.push_back(std::move(level[i]));
    }
    if (next.size() > kMaxCells) {
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
  const auto band = static_cast<float>(band_);
  BlockField field;
  field.values.fill(-band);
  field.num_views.fill(static_cast<std::uint16_t>(cell.num_inside));
  for (const int c : cell.cones) {
    cones_[c].RaiseBlock(
        voxel_size_ * cell.first.cast<double>(), voxel_size_, band, &field);
  }
  bool empty = true;
  for (int o = 0; o < BlockGrid::kBlockSize; ++o) {
    const bool outside =
        field.num_views[o] < kMinViews || field.values[o] >= band;
    block.values[o] = outside ? band : field.values[o];
    empty = empty && outside;
  }
  if (!empty) blocks->push_back(block);
}

// Whether so many views are nearly as many as look at the place that most do.
bool IsNearlyAll(int num_views, int most_views) {
  return 5 * num_views >= 4 * most_views;
}

// Keeps the connected part with most cells that more than half of the views
// vouch for, as compared with the cell that most do, and some that nearly as
// many do. Where only few cameras look, as just before another camera,
// silhouettes leave phantoms that may be large; the person is where many look.
std::vector<Cell> KeepBestSeen(std::vector<Cell> cells) {
  // A place as one number; CoarseCells keeps coordinates small enough.
  const auto key = [](const Eigen::Vector3i& first) {
    constexpr int kBits = 21;
    constexpr std::int64_t kHalf = std::int64_t{1} << (kBits - 1);
    return ((first.x() / kCoarseSide + kHalf) << kBits |
            (first.y() / kCoarseSide + kHalf))
               << kBits |
           (first.z() / kCoarseSide + kHalf);
  };
  std::unordered_map<std::int64_t, int> position;
  position.reserve(2 * cells.size());
  for (size_t i = 0; i < cells.size(); ++i) {
    position[key(cells[i].first)] = static_cast<int>(i);
  }
  int most_views = 0;
  for (const Cell& cell : cells) {
    most_views = std::max(most_views, cell.num_inside + cell.num_hopeful);
  }
  std::vector<int> part(cells.size(), -1);
  std::int64_t best_count = 0;
  int best_part = -1;
  int num_parts = 0;
  std::vector<int> stack;
  for (size_t seed = 0; seed < cells.size(); ++seed) {
    if (part[seed] >= 0) continue;
    std::int64_t count = 0;
    int most_in_part = 0;
    part[seed] = num_parts;
    stack.push_back(static_cast<int>(seed));
    while (!stack.empty()) {
      const Cell& cell = cells[stack.back()];
      stack.pop_back();
      const int views = cell.num_inside + cell.num_hopeful;
      most_in_part = std::max(most_in_part, views);
      if (2 * views > most_views) ++count;
      for (int n = 0; n < 27; ++n) {
        const Eigen::Vector3i next =
            cell.first +
            cell.side * Eigen::Vector3i(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
        const auto found = position.find(key(next));
        if (found == position.end() || part[found->second] >= 0) continue;
        part[found->second] = num_parts;
        stack.push_back(found->second);
      }
    }
    if (IsNearlyAll(most_in_part, most_views) && count > best_count) {
      best_count = count;
      best_part = num_parts;
    }
    ++num_parts;
  }
  std::vector<Cell> kept;
  for (size_t i = 0; i < cells.size(); ++i) {
    if (part[i] == best_part) kept.push_back(std::move(cells[i]));
  }
  return kept;
}

BlockGrid BuildBlocks(const std::vector<SilhouetteCone>& cones,
                      double voxel_size) {
  const HullBuilder builder(cones, voxel_size);
  const std::vector<Cell> cells = KeepBestSeen(builder.CoarseCells());
  // Every cell has its own place, so the order does not depend on threads.
  std::vector<std::vector<BlockGrid::Block>> parts(cells.size());
  tbb::parallel_for(tbb::blocked_range<size_t>(0, cells.size(), 16),
                    [&](const tbb::blocked_range<size_t>& range) {
                      for (size_t i = range.begin(); i < range.end(); ++i) {
                        builder.Refine(cells[i], &parts[i]);
                      }
                    });
  size_t count = 0;
  for (const auto& part : parts) count += part.size();
  std::vector<BlockGrid::Block> blocks;
  blocks.reserve(count);
  for (const auto& part : parts) {
    blocks.insert(blocks.end(), part.begin(), part.end());
  }
  return BlockGrid(voxel_size, kBandVoxels * voxel_size, std::move(blocks));
}

// Keeps the largest part, by the volume of the blocks that nearly as many views
// look at as at the block that most do: see KeepBestSeen, which cells of many
// large voxels can defeat.
ComponentCount KeepBestSeenPart(const std::vector<SilhouetteCone>& cones,
                                BlockGrid* grid) {
  const std::vector<BlockGrid::Block>& blocks = grid->blocks();
  const double voxel = grid->voxel_size();
  constexpr double kHalf = 0.5 * (BlockGrid::kSide - 1);
  std::vector<int> num_views(blocks.size(), 0);
  tbb::parallel_for(size_t{0}, blocks.size(), [&](size_t b) {
    const BlockGrid::BlockValues& values = blocks[b].values;
    if (*std::min_element(values.begin(), values.end()) >= 0) return;
    const Eigen::Vector3d center =
        voxel *
        (BlockGrid::kSide * blocks[b].index.cast<double>().array() + kHalf)
            .matrix();
    for (const SilhouetteCone& cone : cones) {
      double phi = 0;
      num_views[b] +=
          cone.EvaluateBall(center, std::sqrt(3.0) * kHalf * voxel, &phi) !=
          SilhouetteCone::Sees::kNothing;
    }
  });
  int most_views = 0;
  for (const int count : num_views) most_views = std::max(most_views, count);
  std::vector<char> counts(blocks.size());
  for (size_t b = 0; b < blocks.size(); ++b) {
    counts[b] = IsNearlyAll(num_views[b], most_views);
  }
  return KeepLargestComponent(grid, counts);
}

// A volume that explains little of most silhouettes is a phantom of some.
void CheckCoverage(std::vector<double> coverage) {
  constexpr double kLeast = 0.5;
  const double middle = MedianInPlace(&coverage);
  if (middle >= kLeast) return;
  char text[160];
  std::snprintf(text,
                sizeof text,
                "the silhouettes have no common part that explains them (%.0f "
                "%% covered): check the calibration, the masks and their order",
                100 * middle);
  throw FitError(text);
}

void WarnOfPoorViews(const std::vector<View>& views,
                     const std::vector<double>& coverage,
                     Progress* progress,
                     StageSummary* summary) {
  constexpr double kPoor = 0.85;  // sound captures reach 0.93 and more
  for (size_t i = 0; i < views.size(); ++i) {
    if (coverage[i] >= kPoor) continue;
    char text[160];
    std::snprintf(text,
                  sizeof text,
                  "camera %s: the volume covers only %.0f %% of the silhouette",
                  views[i].camera.id.c_str(),
                  100 * coverage[i]);
    if (progress != nullptr) progress->Warning(text);
    if (summary != nullptr) {
      summary->status = "weak";
      summary->warnings.push_back(text);
    }
  }
}

}  // namespace

std::optional<std::string> HullOptions::Check() const {
  if (!(voxel_size >= 0.001 && voxel_size <= 0.05)) {
    return "volume.voxel_size: must lie between 0.001 and 0.05 m";
  }
  return std::nullopt;
}

Volume BuildVisualHull(const std::vector<View>& views,
                       const HullOptions& options,
                       Progress* progress,
                       StageSummary* summary) {
  if (const auto error = options.Check()) throw InputError(*error);
  const std::vector<SilhouetteCone> cones = MakeSilhouetteCones(views);
  BlockGrid blocks = BuildBlocks(cones, options.voxel_size);
  const ComponentCount components = KeepBestSeenPart(cones, &blocks);
  if (components.num_components == 0) {
    throw FitError(
        "the silhouettes have no common part: check the calibration, the "
        "masks and their order");
  }
  Volume volume = MakeVolume(std::move(blocks));

  const std::vector<double> coverage = SilhouetteCoverage(views, volume);
  CheckCoverage(coverage);

  if (summary != nullptr) {
    summary->status = "ok";
    auto& figures = summary->figures;
    figures["voxel_size"] = options.voxel_size;
    figures["num_views"] = views.size();
    figures["volume"] = volume.EnclosedVolume();
    const Eigen::Vector3d size = volume.BoxMax() - volume.BoxMin();
    figures["box_size"] = {size.x(), size.y(), size.z()};
    auto& covered = figures["silhouette_coverage"];
    covered = nlohmann::ordered_json::object();
    for (size_t i = 0; i < views.size(); ++i) {
      covered[views[i].camera.id] = coverage[i];
    }
    figures["num_components"] = components.num_components;
    figures["dropped_volume"] = components.dropped_volume;
  }
  // A stray limb is news, a few stray voxels are not.
  if (components.dropped_volume > 0.01 * volume.EnclosedVolume()) {
    char text[160];
    std::snprintf(text,
                  sizeof text,
                  "the hull has %d parts; %.1f l outside the person's (%.1f l) "
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
  WarnOfPoorViews(views, coverage, progress, summary);
  return volume;
}

}  // namespace sweepfit
