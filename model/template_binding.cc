// SPDX-License-Identifier: Apache-2.0
#include "model/template_binding.h"

#include <algorithm>
#include <array>
#include <set>

#include "model/smooth_step.h"
#include "model/template_sections.h"

namespace sweepfit {
namespace {

// Sweeps of a vertex on the left or right in the order of the weights below.
constexpr std::array<int, 4> kLeftSweeps = {
    kTrunkSweep, kLArmSweep, kLLegSweep, kLFootSweep};
constexpr std::array<int, 4> kRightSweeps = {
    kTrunkSweep, kRArmSweep, kRLegSweep, kRFootSweep};
constexpr int kTrunk = 0;
constexpr int kLeg = 2;
using Weights = Eigen::Vector4d;

// How far apart, in statures, sweeps still blend. Wider zones have more room
// for folds, but let the shape say less about the joint.
constexpr double kBlendByStature = 0.055;
// So near to the middle plane, in statures, both legs pull at the crotch.
constexpr double kBothLegsByStature = 0.015;
constexpr int kSmoothings = 10;
constexpr double kNegligible = 1e-3;

// The one sweep that a vertex must follow, or -1.
int OnlySweep(const HalfComplex& half, int v) {
  if (half.part[v] == BodyPart::kHead) return 0;
  if (half.part[v] == BodyPart::kLHand) return 1;
  return -1;
}

Weights ByDistance(const TemplateSolid& solid, const Eigen::Vector3d& point) {
  const std::array<double, 4> distance = {solid.Trunk(point),
                                          solid.Arm(point),
                                          solid.Leg(point),
                                          solid.Foot(point)};
  const double nearest = *std::min_element(distance.begin(), distance.end());
  const double width = kBlendByStature * solid.stature();
  Weights weights;
  for (int i = 0; i < 4; ++i) {
    weights[i] = SmoothStep(1 - (distance[i] - nearest) / width);
  }
  return weights / weights.sum();
}

void Smooth(const HalfComplex& half, std::vector<Weights>* weights) {
  std::vector<std::set<int>> neighbors(half.num_vertices);
  for (const Quad& quad : half.quads) {
    for (int i = 0; i < 4; ++i) {
      neighbors[quad[i]].insert(quad[(i + 1) % 4]);
      neighbors[quad[(i + 1) % 4]].insert(quad[i]);
    }
  }
  for (int pass = 0; pass < kSmoothings; ++pass) {
    std::vector<Weights> next = *weights;
    for (int v = 0; v < half.num_vertices; ++v) {
      if (OnlySweep(half, v) >= 0) continue;
      Weights mean = Weights::Zero();
      double count = 0;
      for (int n : neighbors[v]) {
        // Those beside the middle plane have a mirror image.
        const double times =
            half.on_mid_plane[v] && !half.on_mid_plane[n] ? 2 : 1;
        mean += times * (*weights)[n];
        count += times;
      }
      next[v] = ((*weights)[v] + mean / count) / 2;
    }
    *weights = next;
  }
}

// How much of the weight of the leg the other leg has: half of it on the middle
// plane, nothing further away or down the thighs, which are close to each
// other.
double ShareOfOtherLeg(const Weights& weights, double x, double stature) {
  return 0.5 * SmoothStep(1 - std::abs(x) / (kBothLegsByStature * stature)) *
         std::min(1.0, 2 * weights[kTrunk]);
}

std::vector<std::pair<int, double>> Heaviest(const Weights& weights,
                                             double share_of_other_leg,
                                             const std::array<int, 4>& sweeps,
                                             int other_leg) {
  std::vector<std::pair<int, double>> all;
  for (int i = 0; i < 4; ++i) all.push_back({sweeps[i], weights[i]});
  all.push_back({other_leg, share_of_other_leg * weights[kLeg]});
  all[kLeg].second *= 1 - share_of_other_leg;
  std::vector<std::pair<int, double>> chosen;
  for (const auto& entry : all) {
    if (entry.second > kNegligible) chosen.push_back(entry);
  }
  std::stable_sort(chosen.begin(), chosen.end(), [](auto& a, auto& b) {
    return a.second > b.second;
  });
  if (chosen.size() > 3) chosen.resize(3);
  double sum = 0;
  for (const auto& [sweep, weight] : chosen) sum += weight;
  for (auto& [sweep, weight] : chosen) weight /= sum;
  return chosen;
}

}  // namespace

std::vector<std::vector<std::pair<int, double>>> TemplateWeights(
    const HalfComplex& half,
    const std::vector<Eigen::Vector3d>& half_vertices,
    const BodyTopology& topology,
    const TemplateSolid& solid) {
  std::vector<Weights> weights(half.num_vertices);
  for (int v = 0; v < half.num_vertices; ++v) {
    const int only = OnlySweep(half, v);
    weights[v] = only >= 0 ? Weights(Weights::Unit(only))
                           : ByDistance(solid, half_vertices[v]);
  }
  Smooth(half, &weights);
  std::vector<std::vector<std::pair<int, double>>> bound(
      topology.mirror_vertex.size());
  for (int v = 0; v < half.num_vertices; ++v) {
    double share =
        ShareOfOtherLeg(weights[v], half_vertices[v].x(), solid.stature());
    if (half.on_mid_plane[v]) {
      share = 0.5;
      // Nothing but the legs has two sides here.
      const double trunk = weights[v][kTrunk];
      const double leg = weights[v][kLeg];
      weights[v].setZero();
      weights[v][kTrunk] = trunk;
      weights[v][kLeg] = leg;
    }
    bound[v] = Heaviest(weights[v], share, kLeftSweeps, kRLegSweep);
    const int mirror = topology.mirror_vertex[v];
    if (mirror != v) {
      bound[mirror] = Heaviest(weights[v], share, kRightSweeps, kLLegSweep);
    }
  }
  return bound;
}

}  // namespace sweepfit
