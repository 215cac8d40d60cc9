// SPDX-License-Identifier: Apache-2.0
#include "model/template_binding.h"

#include <algorithm>
#include <array>
#include <set>

#include "model/template_sections.h"

namespace sweepfit {
namespace {

// Left-side sweeps in the order of the weights below.
constexpr std::array<int, 4> kLeftSweeps = {
    kTrunkSweep, kLArmSweep, kLLegSweep, kLFootSweep};
constexpr std::array<int, 4> kRightSweeps = {
    kTrunkSweep, kRArmSweep, kRLegSweep, kRFootSweep};
using Weights = Eigen::Vector4d;

constexpr double kBlendByStature = 0.04;
constexpr int kSmoothings = 10;
constexpr double kNegligible = 1e-3;

// The one sweep that a vertex must follow, or -1.
int OnlySweep(const HalfComplex& half, int v) {
  if (half.on_mid_plane[v] || half.part[v] == BodyPart::kHead) return 0;
  if (half.part[v] == BodyPart::kLHand) return 1;
  return -1;
}

Weights ByDistance(const TemplateSolid& solid, const Eigen::Vector3d& point) {
  const Eigen::Vector4d distance(solid.Trunk(point),
                                 solid.Arm(point),
                                 solid.Leg(point),
                                 solid.Foot(point));
  const double nearest = distance.minCoeff();
  const double width = kBlendByStature * solid.stature();
  Weights weights;
  for (int i = 0; i < 4; ++i) {
    const double t = std::clamp(1 - (distance[i] - nearest) / width, 0.0, 1.0);
    weights[i] = t * t * (3 - 2 * t);
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
      for (int n : neighbors[v]) mean += (*weights)[n];
      next[v] = ((*weights)[v] + mean / neighbors[v].size()) / 2;
    }
    *weights = next;
  }
}

std::vector<std::pair<int, double>> Heaviest(const Weights& weights,
                                             const std::array<int, 4>& sweeps) {
  std::vector<std::pair<int, double>> chosen;
  for (int i = 0; i < 4; ++i) {
    if (weights[i] > kNegligible) chosen.push_back({sweeps[i], weights[i]});
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
    bound[v] = Heaviest(weights[v], kLeftSweeps);
    const int mirror = topology.mirror_vertex[v];
    if (mirror != v) bound[mirror] = Heaviest(weights[v], kRightSweeps);
  }
  return bound;
}

}  // namespace sweepfit
