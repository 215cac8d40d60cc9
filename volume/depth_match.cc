// SPDX-License-Identifier: Apache-2.0
#include "volume/depth_match.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "model/median.h"
#include "volume/sub_step.h"
#include "volume/surface_labels.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// Depths beyond this share of the local thickness are not considered.
constexpr double kDepthShare = 0.35;
// A depth that no data supports costs this much more than any evidence.
constexpr float kForbidden = 50;
constexpr int kBeliefIterations = 10;
// Greater differences of depth cost no more than this, pixels.
constexpr double kTruncation = 5;
// A round surface may leave the plane of a patch at its edge by so many pixels.
constexpr double kMostSag = 1;
// The bend of the likelihood is measured over this distance, pixels.
constexpr double kBendReach = 0.85;
// Taps are less dependent near the maximum than far from it.
constexpr double kPrecision = 2;

std::vector<double> ListDepths(const DepthSearch& search) {
  std::vector<double> depths;
  const int count =
      static_cast<int>(std::lround((search.to - search.from) / search.step)) +
      1;
  for (int i = 0; i < count; ++i) {
    depths.push_back(search.from + i * search.step);
  }
  return depths;
}

}  // namespace

DepthMatches MatchDepths(const PatchMatcher& matcher,
                         const RayScene& scene,
                         const std::vector<DepthQuery>& queries,
                         const std::vector<std::pair<int, int>>& edges,
                         const DepthSearch& search) {
  const std::vector<double> depths = ListDepths(search);
  const size_t num_labels = depths.size();
  const int num_queries = static_cast<int>(queries.size());
  const double pixel = matcher.options().spacing;
  // A patch that the surface bends away from says nothing.
  const double half = 0.5 * (matcher.options().side - 1) * pixel;
  std::vector<SeenPoint> points(queries.size());
  tbb::parallel_for(size_t{0}, points.size(), [&](size_t i) {
    const DepthQuery& query = queries[i];
    points[i] = {query.point_in_world,
                 query.unit_normal,
                 matcher.VisibleViews(scene,
                                      query.point_in_world,
                                      query.unit_normal,
                                      search.visible_tolerance)};
  });
  // About the surface as it stands; nothing where lightness does not count.
  std::optional<LightnessAgreement> agreement;
  if (matcher.options().lightness > 0 ||
      matcher.options().lightness_two_views > 0) {
    agreement = matcher.MeasureLightness(points);
  }
  std::vector<float> evidence(num_queries * num_labels, kUnseen);
  std::vector<float> cost(evidence.size());
  tbb::parallel_for(
      tbb::blocked_range<int>(0, num_queries, 64),
      [&](const tbb::blocked_range<int>& part) {
        for (int i = part.begin(); i < part.end(); ++i) {
          const DepthQuery& query = queries[i];
          const double most = kDepthShare * query.thickness;
          const bool flat = half * half < kMostSag * pixel * query.thickness;
          std::vector<double> possible;
          for (const double depth : depths) {
            if (flat && depth >= query.least_depth && depth <= most) {
              possible.push_back(depth);
            }
          }
          const std::vector<float> found = matcher.Evidence(
              points[i], possible, agreement ? &*agreement : nullptr);
          size_t next = 0;
          for (size_t k = 0; k < num_labels; ++k) {
            float& e = evidence[i * num_labels + k];
            float& c = cost[i * num_labels + k];
            if (next < possible.size() && possible[next] == depths[k]) {
              e = found[next++];
              c = -std::max(e, 0.f);
            } else {
              c = kForbidden;
            }
            if (search.mean_depth > 0) {
              c += static_cast<float>(depths[k] / search.mean_depth);
            }
          }
        }
      });
  const std::vector<float> belief = PropagateBeliefs(
      static_cast<int>(num_labels),
      cost,
      edges,
      static_cast<float>(search.smoothness * search.step / pixel),
      static_cast<float>(kTruncation * pixel / search.step),
      kBeliefIterations);

  DepthMatches result;
  if (agreement) result.lightness_sigma = agreement->sigma;
  int num_seen = 0;
  std::vector<float> sorted;
  const double sigma = search.sigma_match * pixel;
  const double most_precise = 1 / (sigma * sigma);
  const auto reach = std::max<size_t>(
      1, static_cast<size_t>(std::lround(kBendReach * pixel / search.step)));
  for (int i = 0; i < num_queries; ++i) {
    num_seen += points[i].views.size() >= 2;
    const float* b = &belief[i * num_labels];
    const float* e = &evidence[i * num_labels];
    const auto k = static_cast<size_t>(std::min_element(b, b + num_labels) - b);
    if (k + 1 == num_labels || e[k] < search.least_evidence) continue;
    // A maximum next to what cannot be judged is none.
    if ((k > 0 && e[k - 1] < 0) || e[k + 1] < 0) continue;
    // Depths that the pictures cannot judge are no contrast.
    sorted.clear();
    std::copy_if(e, e + num_labels, std::back_inserter(sorted), [](float x) {
      return x >= 0;
    });
    const float contrast = e[k] - MedianInPlace(&sorted);
    if (contrast < search.least_contrast) continue;
    double depth = depths[k];
    if (k > 0) depth += search.step * SubStep(e[k - 1], e[k], e[k + 1]);
    // The likelihood as a normal distribution about its maximum: its precision
    // is the bend of its logarithm. Shading bends it less than texture does.
    const size_t before = k >= reach ? k - reach : k + reach;
    const size_t after = k + reach < num_labels ? k + reach : k - reach;
    const double width = search.step * static_cast<double>(reach);
    const double precision =
        kPrecision *
        (2 * e[k] - std::max(e[before], 0.f) - std::max(e[after], 0.f)) /
        (width * width);
    if (!(precision > 0)) continue;
    result.matches.push_back({i, depth, std::min(precision, most_precise)});
  }
  result.supported_share =
      num_seen > 0 ? static_cast<double>(result.matches.size()) / num_seen : 0;
  return result;
}

}  // namespace sweepfit
