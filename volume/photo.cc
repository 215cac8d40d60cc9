// SPDX-License-Identifier: Apache-2.0
#include "volume/photo.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <utility>

#include "volume/cut_plane.h"
#include "volume/intersect.h"
#include "volume/patch_match.h"
#include "volume/rim_contacts.h"
#include "volume/surface_labels.h"
#include "volume/surface_offsets.h"
#include "volume/vertex_rings.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// Creases of a hull are no features: normals are averaged this often.
constexpr int kNormalPasses = 3;
// Depths beyond this share of the local thickness are not considered.
constexpr double kDepthShare = 0.35;
// Curvature in terms of the inverse of half the thickness: a fingertip may bend
// more than a back.
constexpr double kCurvatureShare = 1;
// What is in front of a point by less than this is the hull's own error.
constexpr double kVisibleVoxels = 2;
// A depth that no data supports costs this much more than any evidence.
constexpr float kForbidden = 50;
// Mean of the hull's depth below which the body lies, metres: exponential.
constexpr double kMeanDepth = 0.01;
constexpr int kBeliefIterations = 30;
// Greater differences of depth cost no more than this, pixels.
constexpr double kTruncation = 5;
// Evidence of a sample, and how much it must exceed that of most depths.
// A round surface may leave the plane of a patch at its edge by so many pixels.
constexpr double kMostSag = 1;
// Taps are less dependent near the maximum than far from it.
constexpr double kPrecision = 2;
constexpr float kLeastEvidence = 1;
constexpr float kLeastContrast = 0.7f;

// Depths below the current surface at equal steps.
struct Depths {
  double from, to, step;
  std::vector<double> List() const {
    std::vector<double> list;
    const int count = static_cast<int>(std::lround((to - from) / step)) + 1;
    for (int i = 0; i < count; ++i) list.push_back(from + i * step);
    return list;
  }
};
// The first search runs over all depths; the second is finer and about the
// surface that the first one found. In pixels at the person's distance.
constexpr double kCoarseStep = 0.85;
constexpr Depths kFine = {-3.4, 4.25, 0.425};
constexpr int kMaxCoarseSteps = 40;
// Spacing of samples: at least this many pixels, and coarser at first.
constexpr double kLeastSpacing = 2.5;
constexpr double kCoarseSpacing = 1.5;

// What a pixel is wide at the person's distance, metres: median of the views.
double PixelSize(const std::vector<View>& views, const Volume& hull) {
  const Vector3d middle = 0.5 * (hull.BoxMin() + hull.BoxMax());
  std::vector<double> sizes;
  for (const View& view : views) {
    sizes.push_back((view.camera.CenterInWorld() - middle).norm() /
                    view.camera.FocalLength());
  }
  std::nth_element(
      sizes.begin(), sizes.begin() + sizes.size() / 2, sizes.end());
  return sizes[sizes.size() / 2];
}

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
        pixel_(PixelSize(views, hull)),
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
  std::vector<OffsetTarget> MatchDepths(const std::vector<Vector3d>& normals,
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

// Least of a parabola through three equidistant values, in steps from the
// middle one.
double SubStep(double before, double middle, double after) {
  const double bend = before - 2 * middle + after;
  if (!(bend < -1e-6)) return 0;
  return std::clamp(0.5 * (before - after) / bend, -0.5, 0.5);
}

std::vector<OffsetTarget> PhotoRefiner::MatchDepths(
    const std::vector<Vector3d>& normals, const Depths& range, bool from_hull) {
  const RayScene scene(mesh_);
  const double spacing =
      (from_hull ? kCoarseSpacing : 1) *
      std::max(options_.sample_spacing, kLeastSpacing * pixel_);
  const Samples samples = MakeSamples(mesh_.vertices, rings_, spacing);
  const std::vector<double> depths = range.List();
  const size_t num_labels = depths.size();
  const int num_samples = static_cast<int>(samples.vertex.size());
  std::vector<float> evidence(num_samples * num_labels, 0.f);
  std::vector<float> cost(evidence.size());
  std::vector<char> seen(num_samples, 0);
  tbb::parallel_for(
      tbb::blocked_range<int>(0, num_samples, 64),
      [&](const tbb::blocked_range<int>& part) {
        for (int i = part.begin(); i < part.end(); ++i) {
          const int v = samples.vertex[i];
          const Vector3d& point = mesh_.vertices[v];
          const std::vector<int> views = matcher_.VisibleViews(
              scene, point, normals[v], kVisibleVoxels * hull_.voxel_size());
          seen[i] = views.size() >= 2;
          // Not above the hull, and not too deep.
          const double least = hull_.Sample(point) - 1e-9;
          const double most = kDepthShare * thickness_[v];
          // A patch that the surface bends away from says nothing.
          const double half = 0.5 * (options_.patch_side - 1) * pixel_;
          const bool flat = half * half < kMostSag * pixel_ * thickness_[v];
          std::vector<double> possible;
          for (const double depth : depths) {
            if (flat && depth >= least && depth <= most) {
              possible.push_back(depth);
            }
          }
          const std::vector<float> found =
              matcher_.Evidence(views, point, normals[v], possible);
          size_t next = 0;
          for (size_t k = 0; k < num_labels; ++k) {
            float& e = evidence[i * num_labels + k];
            float& c = cost[i * num_labels + k];
            if (next < possible.size() && possible[next] == depths[k]) {
              e = found[next++];
              c = -e;
            } else {
              c = kForbidden;
            }
            if (from_hull) c += static_cast<float>(depths[k] / kMeanDepth);
          }
        }
      });
  const std::vector<float> belief = PropagateBeliefs(
      static_cast<int>(num_labels),
      cost,
      samples.edges,
      static_cast<float>(options_.smoothness * range.step / pixel_),
      static_cast<float>(kTruncation * pixel_ / range.step),
      kBeliefIterations);

  std::vector<OffsetTarget> targets;
  int num_seen = 0;
  std::vector<float> sorted;
  const double sigma = options_.sigma_match * pixel_;
  const double most_precise = 1 / (sigma * sigma);
  const auto reach =
      static_cast<size_t>(std::lround(kCoarseStep * pixel_ / range.step));
  for (int i = 0; i < num_samples; ++i) {
    num_seen += seen[i];
    const float* b = &belief[i * num_labels];
    const float* e = &evidence[i * num_labels];
    const auto k = static_cast<size_t>(std::min_element(b, b + num_labels) - b);
    if (k + 1 == num_labels || e[k] < kLeastEvidence) continue;
    sorted.assign(e, e + num_labels);
    const auto middle =
        sorted.begin() + static_cast<std::ptrdiff_t>(num_labels / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    const float contrast = e[k] - *middle;
    if (contrast < kLeastContrast) continue;
    double depth = depths[k];
    if (k > 0) depth += range.step * SubStep(e[k - 1], e[k], e[k + 1]);
    // The likelihood as a normal distribution about its maximum: its precision
    // is the bend of its logarithm. Shading bends it less than texture does.
    const size_t before = k >= reach ? k - reach : k + reach;
    const size_t after = k + reach < num_labels ? k + reach : k - reach;
    const double width = range.step * static_cast<double>(reach);
    const double precision =
        kPrecision * (2 * e[k] - e[before] - e[after]) / (width * width);
    if (!(precision > 0)) continue;
    targets.push_back(
        {samples.vertex[i], 1, -depth, std::min(precision, most_precise)});
  }
  num_samples_ = num_samples;
  supported_share_ =
      num_seen > 0 ? static_cast<double>(targets.size()) / num_seen : 0;
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
        MatchDepths(normals, range, round == 0);
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
