// SPDX-License-Identifier: Apache-2.0
#include "volume/photo.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <utility>

#include "volume/cut_plane.h"
#include "volume/depth_match.h"
#include "volume/intersect.h"
#include "volume/patch_match.h"
#include "volume/rim_contacts.h"
#include "volume/surface_offsets.h"
#include "volume/vertex_rings.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// Creases of a hull are no features: normals are averaged this often.
constexpr int kNormalPasses = 3;
// Curvature in terms of the inverse of half the thickness: a fingertip may bend
// more than a back.
constexpr double kCurvatureShare = 1;
// What is in front of a point by less than this is the hull's own error.
constexpr double kVisibleVoxels = 2;
// Mean of the hull's depth below which the body lies, metres: exponential.
constexpr double kMeanDepth = 0.01;
// Far from the surface every hint counts, shading too.
constexpr double kLeastEvidence = 1;
constexpr double kLeastContrast = 0.7;

// Depths below the current surface at equal steps.
struct Depths {
  double from, to, step;
};
// The first search runs over all depths; the second is finer and about the
// surface that the first one found. In pixels at the person's distance.
constexpr double kCoarseStep = 0.85;
constexpr Depths kFine = {-3.4, 4.25, 0.425};
constexpr int kMaxCoarseSteps = 40;
// Spacing of samples: at least this many pixels, and coarser at first.
constexpr double kLeastSpacing = 2.5;
constexpr double kCoarseSpacing = 1.5;

// Vertices that stand for the surface around them.
struct Samples {
  std::vector<int> vertex;
  std::vector<std::pair<int, int>> edges;  // between neighbouring samples
};

Samples MakeSamples(const std::vector<Vector3d>& vertices,
                    const VertexRings& rings,
                    double spacing) {
  Samples samples;
  std::vector<int> sample_of_vertex(vertices.size());
  std::map<std::array<int, 3>, int> cells;
  for (size_t v = 0; v < vertices.size(); ++v) {
    const Eigen::Vector3i cell =
        (vertices[v] / spacing).array().floor().cast<int>();
    const auto [it, is_new] =
        cells.try_emplace({cell.x(), cell.y(), cell.z()},
                          static_cast<int>(samples.vertex.size()));
    if (is_new) samples.vertex.push_back(static_cast<int>(v));
    sample_of_vertex[v] = it->second;
  }
  for (int v = 0; v < rings.size(); ++v) {
    for (const int w : rings[v]) {
      const int a = sample_of_vertex[v];
      const int b = sample_of_vertex[w];
      if (a < b) samples.edges.emplace_back(a, b);
    }
  }
  std::sort(samples.edges.begin(), samples.edges.end());
  samples.edges.erase(std::unique(samples.edges.begin(), samples.edges.end()),
                      samples.edges.end());
  return samples;
}

// The least extent of the volume below and around every vertex, metres.
std::vector<double> LocalThickness(const Volume& volume,
                                   const TriangleMesh& mesh,
                                   const std::vector<Vector3d>& normals,
                                   const VertexRings& rings) {
  constexpr double kMost = 0.2;
  constexpr double kSkin = 0.002;
  constexpr int kRings = 4;
  std::vector<double> thickness(normals.size());
  tbb::parallel_for(size_t{0}, normals.size(), [&](size_t v) {
    const double exit = RayExit(
        volume, mesh.vertices[v] - kSkin * normals[v], -normals[v], kMost);
    thickness[v] = exit > 0 ? exit + kSkin : kMost;
  });
  for (int pass = 0; pass < kRings; ++pass) {
    std::vector<double> least = thickness;
    for (int v = 0; v < rings.size(); ++v) {
      for (const int w : rings[v]) least[v] = std::min(least[v], thickness[w]);
    }
    thickness.swap(least);
  }
  return thickness;
}

class PhotoRefiner {
 public:
  PhotoRefiner(const std::vector<View>& views,
               const Volume& hull,
               const PhotoOptions& options)
      : views_(views),
        hull_(hull),
        options_(options),
        pixel_(PixelSize(views, 0.5 * (hull.BoxMin() + hull.BoxMax()))),
        mesh_(hull.ExtractMesh()),
        rings_(mesh_),
        matcher_(views, MakePatchOptions(options, pixel_)) {
    const auto normals = SmoothNormals(mesh_, rings_, kNormalPasses);
    thickness_ = LocalThickness(hull, mesh_, normals, rings_);
    for (const double t : thickness_) {
      sigma_curvature_.push_back(
          std::max(options.sigma_curvature, kCurvatureShare / (0.5 * t)));
    }
  }

  // False when there is too little texture; the surface has not moved then.
  bool Run();

  const TriangleMesh& mesh() const { return mesh_; }
  double pixel_size() const { return pixel_; }
  double supported_share() const { return supported_share_; }
  int num_samples() const { return num_samples_; }

 private:
  static PatchOptions MakePatchOptions(const PhotoOptions& options,
                                       double pixel) {
    PatchOptions patch;
    patch.spacing = pixel;
    patch.side = options.patch_side;
    return patch;
  }
  // Where the pictures agree, as targets for the offsets of the vertices.
  std::vector<OffsetTarget> FindMatches(const std::vector<Vector3d>& normals,
                                        const Depths& range,
                                        bool from_hull);
  std::vector<OffsetTarget> Contacts(
      const std::vector<Vector3d>& normals) const;
  void MoveTo(const std::vector<Vector3d>& normals,
              const std::vector<OffsetTarget>& targets);

  const std::vector<View>& views_;
  const Volume& hull_;
  const PhotoOptions& options_;
  const double pixel_;  // metres
  TriangleMesh mesh_;
  VertexRings rings_;
  PatchMatcher matcher_;
  std::vector<double> thickness_;
  std::vector<double> sigma_curvature_;
  double supported_share_ = 0;
  int num_samples_ = 0;
};

std::vector<OffsetTarget> PhotoRefiner::FindMatches(
    const std::vector<Vector3d>& normals, const Depths& range, bool from_hull) {
  const RayScene scene(mesh_);
  const double spacing =
      (from_hull ? kCoarseSpacing : 1) *
      std::max(options_.sample_spacing, kLeastSpacing * pixel_);
  const Samples samples = MakeSamples(mesh_.vertices, rings_, spacing);
  std::vector<DepthQuery> queries;
  for (const int v : samples.vertex) {
    // Not above the hull.
    const double least = hull_.Sample(mesh_.vertices[v]) - 1e-9;
    queries.push_back({mesh_.vertices[v], normals[v], thickness_[v], least});
  }
  DepthSearch search;
  search.from = range.from;
  search.to = range.to;
  search.step = range.step;
  search.visible_tolerance = kVisibleVoxels * hull_.voxel_size();
  search.mean_depth = from_hull ? kMeanDepth : 0;
  search.smoothness = options_.smoothness;
  search.sigma_match = options_.sigma_match;
  search.least_evidence = kLeastEvidence;
  search.least_contrast = kLeastContrast;
  const DepthMatches found =
      MatchDepths(matcher_, scene, queries, samples.edges, search);
  num_samples_ = static_cast<int>(queries.size());
  supported_share_ = found.supported_share;
  std::vector<OffsetTarget> targets;
  for (const DepthMatch& match : found.matches) {
    targets.push_back(
        {samples.vertex[match.query], 1, -match.depth, match.weight});
  }
  return targets;
}

std::vector<OffsetTarget> PhotoRefiner::Contacts(
    const std::vector<Vector3d>& normals) const {
  std::vector<std::vector<OffsetTarget>> of_view(views_.size());
  tbb::parallel_for(size_t{0}, views_.size(), [&](size_t i) {
    of_view[i] = FindRimContacts(
        views_[i], mesh_.vertices, normals, options_.sigma_rim * pixel_);
  });
  std::vector<OffsetTarget> all;
  for (const auto& part : of_view) {
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

void PhotoRefiner::MoveTo(const std::vector<Vector3d>& normals,
                          const std::vector<OffsetTarget>& targets) {
  std::vector<double> upper(mesh_.vertices.size());
  tbb::parallel_for(size_t{0}, upper.size(), [&](size_t v) {
    upper[v] = std::max(0.0, -hull_.Sample(mesh_.vertices[v]));
  });
  const std::vector<double> offsets = SolveOffsets(
      mesh_.vertices, normals, rings_, targets, upper, sigma_curvature_);
  for (size_t v = 0; v < upper.size(); ++v) {
    mesh_.vertices[v] += offsets[v] * normals[v];
  }
}

bool PhotoRefiner::Run() {
  for (int round = 0; round < options_.rounds; ++round) {
    const auto normals = SmoothNormals(mesh_, rings_, kNormalPasses);
    const Depths range =
        round == 0
            ? Depths{0,
                     options_.max_depth,
                     std::max(kCoarseStep * pixel_,
                              options_.max_depth / kMaxCoarseSteps)}
            : Depths{
                  kFine.from * pixel_, kFine.to * pixel_, kFine.step * pixel_};
    const std::vector<OffsetTarget> matches =
        FindMatches(normals, range, round == 0);
    if (round == 0 && supported_share_ < options_.min_support) return false;
    std::vector<OffsetTarget> targets = Contacts(normals);
    targets.insert(targets.end(), matches.begin(), matches.end());
    MoveTo(normals, targets);
  }
  return true;
}

}  // namespace

std::optional<std::string> PhotoOptions::Check() const {
  if (!(max_depth >= 0.004 && max_depth <= 0.2)) {
    return "volume.photo.max_depth: must lie between 0.004 and 0.2 m";
  }
  if (!(sample_spacing >= 0.002 && sample_spacing <= 0.05)) {
    return "volume.photo.sample_spacing: must lie between 0.002 and 0.05 m";
  }
  if (!(rounds >= 1 && rounds <= 5)) {
    return "volume.photo.rounds: must lie between 1 and 5";
  }
  if (!(patch_side >= 3 && patch_side <= 21 && patch_side % 2 == 1)) {
    return "volume.photo.patch_side: must be odd, 3 to 21";
  }
  if (!(smoothness > 0)) return "volume.photo.smoothness: must be positive";
  if (!(sigma_match > 0)) return "volume.photo.sigma_match: must be positive";
  if (!(sigma_rim > 0)) return "volume.photo.sigma_rim: must be positive";
  if (!(sigma_curvature > 0)) {
    return "volume.photo.sigma_curvature: must be positive";
  }
  if (!(min_support >= 0 && min_support <= 1)) {
    return "volume.photo.min_support: must lie between 0 and 1";
  }
  return std::nullopt;
}

Volume RefineByPhotoConsistency(const std::vector<View>& views,
                                Volume hull,
                                const PhotoOptions& options,
                                Progress* progress,
                                StageSummary* summary) {
  PhotoRefiner refiner(views, hull, options);
  const bool moved = refiner.Run();
  if (summary != nullptr) {
    auto& figures = summary->figures;
    figures["pixel_size"] = refiner.pixel_size();
    figures["photo_samples"] = refiner.num_samples();
    figures["photo_supported_share"] = refiner.supported_share();
  }
  if (!moved) {
    char text[160];
    std::snprintf(text,
                  sizeof text,
                  "photo-consistency is off: only %.1f %% of the surface has "
                  "texture that two views agree on; the visual hull is kept",
                  100 * refiner.supported_share());
    if (progress != nullptr) progress->Warning(text);
    if (summary != nullptr) {
      summary->figures["photo"] = "off: too little texture";
      summary->warnings.push_back(text);
    }
    return hull;
  }
  Volume refined = IntersectWithMesh(hull, refiner.mesh());
  if (summary != nullptr) {
    summary->figures["photo"] = "on";
    summary->figures["hull_volume"] = hull.EnclosedVolume();
    summary->figures["volume"] = refined.EnclosedVolume();
  }
  return refined;
}

}  // namespace sweepfit
