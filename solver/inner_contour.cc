// SPDX-License-Identifier: Apache-2.0
#include "solver/inner_contour.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "capture/colour.h"
#include "model/median.h"
#include "volume/sub_step.h"
#include "volume/surface_labels.h"

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// What lies behind the rim is farther away by this much, metres: less is a
// fold.
constexpr double kLeastGap = 0.03;
// Where the rim's background is looked up, pixels beyond it.
constexpr double kBeyond = 4;
// The rim proper lies a little outside a vertex that faces away, metres.
constexpr double kLift = 0.003;
// The outline of the whole person is an edge too, and the strongest.
constexpr double kOutlineMargin = 6;  // pixels
// The profile across the rim is a mean over so many pixels to either side.
constexpr int kHalfLength = 4;
// Derivative of a Gaussian of one pixel, sampled at 1, 2 and 3 pixels.
constexpr std::array<float, 3> kDerivative = {0.242f, 0.108f, 0.013f};
constexpr int kHalfWidth = static_cast<int>(kDerivative.size());
// Farthest and nearest that an edge is looked for, pixels.
constexpr int kMostReach = 40;
constexpr int kLeastReach = 3;

// Texture and noise are at least this strong, CIELAB units per pixel.
constexpr float kLeastClutter = 0.3f;
// An edge is as likely as clutter at this multiple of the median strength.
constexpr float kEvenStrength = 2.5f;
constexpr float kMostEvidence = 4;
constexpr float kLeastEvidence = 1;
constexpr float kNoEvidence = -1;  // the outline is too near
constexpr float kForbidden = 20;
// Any other place must be less likely by this much.
constexpr float kLeastMargin = 1;
constexpr int kDistinct = 3;  // pixels
// Evidence does not grow with strength for ever: the strongest place is looked
// for so near the most likely one, pixels.
constexpr int kSnap = 2;

constexpr int kBeliefIterations = 12;
constexpr float kSmoothness = 0.6f;  // cost of a difference of one pixel
constexpr float kTruncation = 5;     // pixels

cv::Vec3f SampleColor(const cv::Mat3f& image, const Vector2d& pixel) {
  const double x = std::clamp(pixel.x(), 0.0, image.cols - 1.001);
  const double y = std::clamp(pixel.y(), 0.0, image.rows - 1.001);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const auto fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
  const cv::Vec3f* top = image[y0] + x0;
  const cv::Vec3f* bottom = image[y0 + 1] + x0;
  return (1 - fy) * ((1 - fx) * top[0] + fx * top[1]) +
         fy * ((1 - fx) * bottom[0] + fx * bottom[1]);
}

// Log likelihood of an edge against clutter, from the strengths of one profile.
std::vector<float> EdgeEvidence(const std::vector<float>& strength) {
  std::vector<float> seen;
  for (const float g : strength) {
    if (g >= 0) seen.push_back(g);
  }
  std::vector<float> evidence(strength.size(), kNoEvidence);
  if (seen.empty()) return evidence;
  const float clutter = std::max(kLeastClutter, MedianInPlace(&seen));
  for (size_t k = 0; k < strength.size(); ++k) {
    if (strength[k] < 0) continue;
    evidence[k] =
        std::clamp(strength[k] / clutter - kEvenStrength, 0.0f, kMostEvidence);
  }
  return evidence;
}

// Where the edge lies, in labels: near the least cost, if it is clear there.
std::optional<double> ClearEdge(const float* belief,
                                const std::vector<float>& evidence,
                                const std::vector<float>& strength) {
  const int count = static_cast<int>(strength.size());
  const int likely =
      static_cast<int>(std::min_element(belief, belief + count) - belief);
  for (int k = 0; k < count; ++k) {
    if (std::abs(k - likely) >= kDistinct &&
        belief[k] - belief[likely] < kLeastMargin) {
      return std::nullopt;
    }
  }
  int best = likely;
  for (int k = std::max(1, likely - kSnap);
       k <= std::min(count - 2, likely + kSnap);
       ++k) {
    if (strength[k] > strength[best]) best = k;
  }
  if (best == 0 || best + 1 == count) return std::nullopt;
  const float before = strength[best - 1], after = strength[best + 1];
  const float middle = strength[best];
  if (evidence[best] < kLeastEvidence || before < 0 || after < 0 ||
      middle < before || middle < after) {
    return std::nullopt;
  }
  return best + SubStep(before, middle, after);
}

}  // namespace

std::optional<std::string> InnerContourOptions::Check() const {
  if (!(weight > 0)) return "inner_contours.weight must be positive";
  return std::nullopt;
}

InnerContour::InnerContour(const View& view, const InnerContourOptions& options)
    : view_(&view), options_(options) {
  constexpr int kMargin = 8;  // pixels
  box_ = BoxAround(view.coverage > 0.5f, kMargin);
  if (box_.empty()) return;
  color_ = PictureToLab(view.image(box_));
}

double InnerContour::Outside(const Vector2d& pixel) const {
  return SampleBilinear(view_->signed_distance, pixel).value;
}

std::vector<RimPoint> InnerContour::FindCandidates(const PosedBody& body,
                                                   const BodyTopology& topology,
                                                   const RayScene& scene,
                                                   int view_index) const {
  const Camera& camera = view_->camera;
  const Vector3d center = camera.CenterInWorld();
  std::vector<RimPoint> candidates;
  for (const int v : ContourGenerator(body, topology.quads, center)) {
    const Vector3d& x = body.mesh.vertices[v];
    const auto point = SeeRim(body, v, *view_, view_index);
    if (!point || Outside(point->pixel) > -kOutlineMargin) continue;
    constexpr double kTolerance = 0.002;  // metres
    if (!scene.IsVisible(x + kLift * body.normals[v], center, kTolerance)) {
      continue;
    }
    const double beyond = kLift + kBeyond * point->depth / camera.FocalLength();
    const RayScene::Hit hit = scene.Intersect(
        center, (x + beyond * body.normals[v] - center).normalized());
    if (hit.triangle < 0 || hit.distance < (x - center).norm() + kLeastGap) {
      continue;
    }
    const int behind = body.mesh.triangles[hit.triangle][0];
    if (topology.part[behind] == topology.part[v]) continue;
    candidates.push_back(*point);
  }
  return candidates;
}

std::vector<float> InnerContour::EdgeStrength(const RimPoint& candidate,
                                              int half) const {
  const Camera& camera = view_->camera;
  const Vector2d& normal = candidate.normal;
  const Vector2d tangent(-normal.y(), normal.x());
  // In the picture as taken; the neighbourhood is small, its image affine.
  const Vector2d at =
      camera.Distort(candidate.pixel) - Vector2d(box_.x, box_.y);
  const auto step = [&](const Vector2d& direction) -> Vector2d {
    constexpr double kStep = 4;
    return (camera.Distort(candidate.pixel + kStep * direction) -
            camera.Distort(candidate.pixel - kStep * direction)) /
           (2 * kStep);
  };
  const Vector2d across = step(normal), beside = step(tangent);
  const int profile_half = half + kHalfWidth;
  std::vector<cv::Vec3f> profile;
  for (int s = -profile_half; s <= profile_half; ++s) {
    cv::Vec3f sum(0, 0, 0);
    float total = 0;
    for (int t = -kHalfLength; t <= kHalfLength; ++t) {
      const float weight =
          std::exp(-2.0f * t * t / (kHalfLength * kHalfLength));
      sum += weight * SampleColor(color_, at + s * across + t * beside);
      total += weight;
    }
    profile.push_back(sum / total);
  }
  std::vector<float> strength;
  for (int s = -half; s <= half; ++s) {
    cv::Vec3f change(0, 0, 0);
    const int middle = s + profile_half;
    for (int j = 1; j <= kHalfWidth; ++j) {
      change +=
          kDerivative[j - 1] * (profile[middle + j] - profile[middle - j]);
    }
    const bool inside = Outside(candidate.pixel + s * normal) < -kOutlineMargin;
    strength.push_back(inside ? static_cast<float>(cv::norm(change)) : -1);
  }
  return strength;
}

std::vector<ContourPair> InnerContour::Match(const PosedBody& body,
                                             const BodyTopology& topology,
                                             const RayScene& scene,
                                             int view_index,
                                             double reach) const {
  if (box_.empty()) return {};
  const std::vector<RimPoint> candidates =
      FindCandidates(body, topology, scene, view_index);
  if (candidates.empty()) return {};
  const int n = static_cast<int>(candidates.size());

  // Places along the normals are the labels of a graph of vertices.
  double pixels_per_metre = 0;
  for (const RimPoint& candidate : candidates) {
    pixels_per_metre += view_->camera.FocalLength() / candidate.depth / n;
  }
  const int half =
      std::clamp(static_cast<int>(std::lround(reach * pixels_per_metre)),
                 kLeastReach,
                 kMostReach);
  const int num_labels = 2 * half + 1;
  std::vector<std::vector<float>> strength(n), evidence(n);
  std::vector<float> cost;
  for (int i = 0; i < n; ++i) {
    strength[i] = EdgeStrength(candidates[i], half);
    evidence[i] = EdgeEvidence(strength[i]);
    for (int k = 0; k < num_labels; ++k) {
      // The body nearly fits: half the reach is a standard deviation.
      const auto offset = static_cast<float>(2.0 * (k - half) / half);
      const float e = evidence[i][k];
      cost.push_back(e == kNoEvidence ? kForbidden
                                      : 0.5f * offset * offset - e);
    }
  }

  std::vector<int> candidate_of(body.mesh.vertices.size(), -1);
  for (int i = 0; i < n; ++i) candidate_of[candidates[i].vertex] = i;
  std::vector<std::pair<int, int>> edges;
  for (const Quad& quad : topology.quads) {
    for (int a = 0; a < 4; ++a) {
      for (int b = a + 1; b < 4; ++b) {
        const int i = candidate_of[quad[a]], j = candidate_of[quad[b]];
        constexpr double kSameRim = 0.5;  // cosine of the normals
        if (i >= 0 && j >= 0 && i != j &&
            candidates[i].normal.dot(candidates[j].normal) > kSameRim) {
          edges.emplace_back(std::minmax(i, j));
        }
      }
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  std::vector<double> spacing(n, 0);
  std::vector<int> degree(n, 0);
  for (const auto& [i, j] : edges) {
    const double distance = (candidates[i].pixel - candidates[j].pixel).norm();
    for (const int end : {i, j}) {
      spacing[end] += distance;
      ++degree[end];
    }
  }
  const std::vector<float> belief = PropagateBeliefs(
      num_labels, cost, edges, kSmoothness, kTruncation, kBeliefIterations);

  std::vector<ContourPair> pairs;
  for (int i = 0; i < n; ++i) {
    // A vertex alone is not a rim.
    if (degree[i] == 0) continue;
    const auto edge = ClearEdge(
        &belief[static_cast<size_t>(i) * num_labels], evidence[i], strength[i]);
    if (!edge) continue;
    const RimPoint& c = candidates[i];
    const double independent =
        std::min(1.0, spacing[i] / degree[i] / kContourCorrelationPixels);
    pairs.push_back({c.vertex,
                     view_index,
                     c.pixel + (*edge - half) * c.normal,
                     c.normal,
                     c.depth,
                     options_.weight * independent});
  }
  return pairs;
}

std::vector<ContourPair> MatchInnerContours(
    const std::vector<InnerContour>& views,
    const PosedBody& body,
    const BodyTopology& topology,
    const RayScene& scene,
    double reach) {
  std::vector<std::vector<ContourPair>> per_view(views.size());
  tbb::parallel_for(size_t{0}, views.size(), [&](size_t v) {
    per_view[v] =
        views[v].Match(body, topology, scene, static_cast<int>(v), reach);
  });
  std::vector<ContourPair> pairs;
  for (const auto& of_view : per_view) {
    pairs.insert(pairs.end(), of_view.begin(), of_view.end());
  }
  return pairs;
}

}  // namespace sweepfit
