// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/render.h"
#include "capture/silhouette.h"
#include "model/body.h"
#include "solver/rim_evidence.h"
#include "volume/volume.h"

namespace sweepfit {

struct PhotoEvidenceOptions {
  bool enabled = true;
  double sigma = 0.0015;  // of a matched point, metres
  double weight = 0.3;    // neighbouring patches overlap
  // How much equal lightness counts (PatchOptions).
  double lightness = 0.4;
  double lightness_two_views = 1;
  std::optional<std::string> Check() const;
};

// Where the photographs see the surface that a vertex belongs to.
struct PhotoPoint {
  int vertex;
  Eigen::Vector3d point_in_world;
  Eigen::Vector3d unit_normal;
  double sigma;  // along the normal, metres
};

struct PhotoMatches {
  std::vector<PhotoPoint> points;
  // How far the views differ about the ln of the lightness of one place, their
  // exposures apart; 0 where lightness does not count.
  double lightness_sigma = 0;
};

// Finds the surface by matching the photographs about a body that nearly fits:
// unlike the outlines it sees hollows, and unlike the hull it is not biased.
class PhotoEvidence {
 public:
  // `views` and `hull` must outlive it.
  PhotoEvidence(const std::vector<View>& views,
                const Volume& hull,
                const PhotoEvidenceOptions& options);
  ~PhotoEvidence();
  PhotoEvidence(PhotoEvidence&&) noexcept;

  // Points within `reach` metres of the posed body, along the normals of its
  // vertices, in steps of `step_pixels` pixels. Never outside the hull. Parts
  // that are thinner than a patch, and plain ones, get no points.
  // `scene` is the body's mesh.
  PhotoMatches Match(const PosedBody& posed,
                     const RayScene& scene,
                     const std::vector<Quad>& quads,
                     double reach,
                     double step_pixels) const;

  const PhotoEvidenceOptions& options() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sweepfit
