// SPDX-License-Identifier: Apache-2.0
#include "solver/photo_evidence.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "model/vertex_neighbours.h"
#include "solver/surface_thickness.h"
#include "volume/depth_match.h"

namespace sweepfit {

std::optional<std::string> PhotoEvidenceOptions::Check() const {
  if (!(sigma > 0)) return "photo.sigma must be positive";
  if (!(weight > 0)) return "photo.weight must be positive";
  for (const double share : {lightness, lightness_two_views}) {
    if (!(share >= 0)) return "photo.lightness* must not be negative";
  }
  return std::nullopt;
}

struct PhotoEvidence::Impl {
  const Volume* hull;
  PhotoEvidenceOptions options;
  PatchMatcher matcher;
};

PhotoEvidence::PhotoEvidence(const std::vector<View>& views,
                             const Volume& hull,
                             const PhotoEvidenceOptions& options) {
  PatchOptions patch;
  patch.spacing = PixelSize(views, 0.5 * (hull.BoxMin() + hull.BoxMax()));
  patch.with_slope = false;
  patch.lightness = options.lightness;
  patch.lightness_two_views = options.lightness_two_views;
  // Between cameras far apart the surface is seen at a slant.
  patch.min_facing = 0.2;
  impl_ =
      std::make_unique<Impl>(Impl{&hull, options, PatchMatcher(views, patch)});
}

PhotoEvidence::~PhotoEvidence() = default;
PhotoEvidence::PhotoEvidence(PhotoEvidence&&) noexcept = default;

const PhotoEvidenceOptions& PhotoEvidence::options() const {
  return impl_->options;
}

PhotoMatches PhotoEvidence::Match(const PosedBody& posed,
                                  const RayScene& scene,
                                  const std::vector<Quad>& quads,
                                  double reach,
                                  double step_pixels) const {
  const std::vector<Eigen::Vector3d>& vertices = posed.mesh.vertices;
  const std::vector<double> thickness =
      SurfaceThickness(scene, vertices, posed.normals);
  std::vector<DepthQuery> queries(vertices.size());
  for (size_t v = 0; v < vertices.size(); ++v) {
    // The hull's own surface lies between its voxels.
    const double outside =
        impl_->hull->Sample(vertices[v]) - 0.5 * impl_->hull->voxel_size();
    queries[v] = {vertices[v], posed.normals[v], thickness[v], outside};
  }
  std::vector<std::pair<int, int>> edges;
  const auto neighbours = VertexNeighbours(quads, vertices.size());
  for (int v = 0; v < static_cast<int>(neighbours.size()); ++v) {
    for (const int n : neighbours[v]) {
      if (v < n) edges.emplace_back(v, n);
    }
  }

  DepthSearch search;
  search.step = step_pixels * impl_->matcher.options().spacing;
  const double steps = std::max(2.0, std::ceil(reach / search.step));
  search.from = -steps * search.step;
  search.to = steps * search.step;
  const DepthMatches found =
      MatchDepths(impl_->matcher, scene, queries, edges, search);
  PhotoMatches matches;
  matches.lightness_sigma = found.lightness_sigma;
  for (const DepthMatch& match : found.matches) {
    const DepthQuery& query = queries[match.query];
    matches.points.push_back(
        {match.query,
         query.point_in_world - match.depth * query.unit_normal,
         query.unit_normal,
         std::max(impl_->options.sigma, 1 / std::sqrt(match.weight))});
  }
  return matches;
}

}  // namespace sweepfit
