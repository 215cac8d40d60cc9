// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "capture/render.h"
#include "volume/patch_match.h"

namespace sweepfit {

// A point of a surface whose depth is to be found along its normal.
struct DepthQuery {
  Eigen::Vector3d point_in_world;
  Eigen::Vector3d unit_normal;
  double thickness;    // of what lies below, metres
  double least_depth;  // metres below the point; negative is above
};

// Depths at equal steps and how they are judged, metres.
struct DepthSearch {
  double from = 0, to = 0, step = 0;
  // What is in front of a point by less than this does not hide it.
  double visible_tolerance = 0.008;
  // Mean of an exponential prior of the depth; 0: none.
  double mean_depth = 0;
  // Log likelihood that a difference of one pixel between neighbours costs.
  double smoothness = 0.7;
  double sigma_match = 0.35;  // the most precise match, pixels
  // Evidence of a match (log likelihood ratio), and how much it must exceed
  // that of most depths.
  double least_evidence = 1.5;
  double least_contrast = 1.5;
};

struct DepthMatch {
  int query;
  double depth;   // metres below the point
  double weight;  // 1 / variance, 1 / m^2
};

struct DepthMatches {
  std::vector<DepthMatch> matches;
  // Share of the points that two views see that found a match.
  double supported_share = 0;
  // LightnessAgreement::sigma; 0 where lightness does not count.
  double lightness_sigma = 0;
};

// Where below their points the pictures agree (algorithm: correlations and
// lightness of tangent-plane patches at every depth; belief propagation over
// `edges`, pairs of queries; a parabola between the steps; the bend of the log
// likelihood is the precision). Points without texture, or where a depth is no
// better than most others, get no match. `scene` is the surface the points lie
// on.
DepthMatches MatchDepths(const PatchMatcher& matcher,
                         const RayScene& scene,
                         const std::vector<DepthQuery>& queries,
                         const std::vector<std::pair<int, int>>& edges,
                         const DepthSearch& search);

}  // namespace sweepfit
