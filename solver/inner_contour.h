// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "capture/render.h"
#include "capture/silhouette.h"
#include "solver/rim_evidence.h"

namespace sweepfit {

struct InnerContourOptions {
  bool enabled = true;
  double weight = 0.5;  // against an outline's: an edge may be a seam
  std::optional<std::string> Check() const;
};

// What one picture shows inside the silhouette: the edges of limbs in front of
// the trunk or of each other. Few cameras see such limbs against the
// background, and nothing else says how thick a leg is that stands before the
// other.
class InnerContour {
 public:
  // `view` must outlive it.
  InnerContour(const View& view, const InnerContourOptions& options);

  // Rim vertices of the posed body that end in front of another part of it,
  // each with the edge in the picture that lies within `reach` metres along its
  // normal (algorithm: derivative of Gaussian across the rim, mean along it;
  // belief propagation between neighbouring vertices). Vertices without a clear
  // edge are left out. `scene` is the body's mesh; `view_index` goes into the
  // pairs.
  std::vector<ContourPair> Match(const PosedBody& body,
                                 const BodyTopology& topology,
                                 const RayScene& scene,
                                 int view_index,
                                 double reach) const;

 private:
  // Vertices of the rim in front of another part.
  std::vector<RimPoint> FindCandidates(const PosedBody& body,
                                       const BodyTopology& topology,
                                       const RayScene& scene,
                                       int view_index) const;
  // How strongly the colour changes at whole pixels from -half to half along
  // the candidate's normal, CIELAB units per pixel; negative where the outline
  // is too near.
  std::vector<float> EdgeStrength(const RimPoint& candidate, int half) const;
  // Distance to the silhouette, pinhole pixels.
  double Outside(const Eigen::Vector2d& pixel) const;

  const View* view_;
  InnerContourOptions options_;
  cv::Rect box_;     // around the person, in the picture as taken
  cv::Mat3f color_;  // CIELAB there
};

// The same in all views of a pose, one InnerContour for each.
std::vector<ContourPair> MatchInnerContours(
    const std::vector<InnerContour>& views,
    const PosedBody& body,
    const BodyTopology& topology,
    const RayScene& scene,
    double reach);

}  // namespace sweepfit
