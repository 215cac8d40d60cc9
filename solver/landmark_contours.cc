// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_contours.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace sweepfit {
namespace {

// An edge must be followed by this much background, metres.
constexpr double kClearance = 0.015;
// Views that see the limb shortened to less than this share are left out.
constexpr double kMinForeshortening = 0.5;
// Spread of a midpoint about the limb's centre line, metres, and of an edge,
// pixels.
constexpr double kMidpointSigma = 0.004;
constexpr double kEdgeSigma = 0.3;

bool IsInFrame(const View& view, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 &&
         pixel.x() <= view.signed_distance.cols - 1 &&
         pixel.y() <= view.signed_distance.rows - 1;
}

}  // namespace

double FindEdge(const View& view,
                const Eigen::Vector2d& start,
                const Eigen::Vector2d& direction,
                double limit,
                double clearance) {
  constexpr double kStep = 0.5;
  double before = SampleBilinear(view.signed_distance, start).value;
  if (before >= 0) return -1;
  double edge = -1;
  for (double at = kStep; at <= limit + clearance; at += kStep) {
    const Eigen::Vector2d pixel = start + at * direction;
    if (!IsInFrame(view, pixel)) return -1;
    const double value = SampleBilinear(view.signed_distance, pixel).value;
    if (edge < 0) {
      if (value >= 0) {
        edge = at - kStep * value / (value - before);
        if (edge > limit) return -1;
      }
    } else {
      if (value < 0) return -1;
      if (at > edge + clearance) return edge;
    }
    before = value;
  }
  return edge >= 0 ? edge : -1;
}

std::optional<EdgeMidpoint> MeasureLimb(
    const View& view,
    const Eigen::Vector3d& point_in_world,
    const Eigen::Vector3d& unit_limb_direction,
    double max_half_width) {
  constexpr double kProbe = 0.02;  // metres along the limb
  const Eigen::Vector3d ahead = point_in_world + kProbe * unit_limb_direction;
  const double depth = view.camera.PointInCamera(point_in_world).z();
  if (depth <= 0.1 || view.camera.PointInCamera(ahead).z() <= 0.1) {
    return std::nullopt;
  }
  const double pixels_per_metre = view.camera.FocalLength() / depth;
  const Eigen::Vector2d pixel = view.camera.ProjectPinhole(point_in_world);
  const Eigen::Vector2d along = view.camera.ProjectPinhole(ahead) - pixel;
  if (!IsInFrame(view, pixel) ||
      along.norm() < kMinForeshortening * kProbe * pixels_per_metre) {
    return std::nullopt;
  }
  const Eigen::Vector2d across =
      Eigen::Vector2d(-along.y(), along.x()).normalized();
  const double limit = max_half_width * pixels_per_metre;
  const double clearance = std::max(3.0, kClearance * pixels_per_metre);
  const double plus = FindEdge(view, pixel, across, 2 * limit, clearance);
  const double minus = FindEdge(view, pixel, -across, 2 * limit, clearance);
  if (plus < 0 || minus < 0 || plus + minus > 2 * limit) return std::nullopt;
  EdgeMidpoint result;
  result.observation.camera = &view.camera;
  result.observation.pinhole_pixel = pixel + 0.5 * (plus - minus) * across;
  result.observation.axis = across;
  result.observation.sigma_along_axis =
      std::hypot(kEdgeSigma, kMidpointSigma * pixels_per_metre);
  result.observation.sigma_across_axis = 0;
  result.half_width = 0.5 * (plus + minus) / pixels_per_metre;
  result.pixels_per_metre = pixels_per_metre;
  return result;
}

std::vector<PointObservation> AllowForNeighbours(
    const std::vector<EdgeMidpoint>& edges) {
  constexpr double kUsualAspect = 1.15;
  double usual = std::numeric_limits<double>::infinity();
  for (const EdgeMidpoint& edge : edges) {
    usual = std::min(usual, kUsualAspect * edge.half_width);
  }
  const auto num_wider =
      std::count_if(edges.begin(), edges.end(), [&](const EdgeMidpoint& edge) {
        return edge.half_width > usual;
      });
  const double spread = std::sqrt(static_cast<double>(num_wider) / 3);
  std::vector<PointObservation> observations;
  for (const EdgeMidpoint& edge : edges) {
    PointObservation& seen = observations.emplace_back(edge.observation);
    const double slack = std::max(0.0, edge.half_width - usual);
    seen.sigma_along_axis = std::hypot(seen.sigma_along_axis,
                                       spread * slack * edge.pixels_per_metre);
  }
  return observations;
}

std::optional<PointObservation> MeasureTip(
    const View& view,
    const TipPlace& place,
    const Eigen::Vector3d& tip_in_world) {
  // Of the outline against the tip, and of the place on a blunt tip that is
  // farthest; metres.
  constexpr double kTipSigma = 0.003;
  constexpr double kBluntness = 0.3;  // of the half width
  constexpr double kReach = 0.03;     // metres
  const double depth = view.camera.PointInCamera(tip_in_world).z();
  if (depth <= 0.1 ||
      view.camera.PointInCamera(place.base_in_world).z() <= 0.1) {
    return std::nullopt;
  }
  const double pixels_per_metre = view.camera.FocalLength() / depth;
  const Eigen::Vector2d base = view.camera.ProjectPinhole(place.base_in_world);
  const Eigen::Vector2d way = view.camera.ProjectPinhole(tip_in_world) - base;
  const double length = way.norm();
  const double foreshortening = std::min(
      1.0,
      length /
          ((tip_in_world - place.base_in_world).norm() * pixels_per_metre));
  if (!IsInFrame(view, base) || !(foreshortening > kMinForeshortening)) {
    return std::nullopt;
  }
  const Eigen::Vector2d along = way / length;
  const Eigen::Vector2d across(-along.y(), along.x());
  const double reach = kReach * pixels_per_metre;
  const double clearance = kClearance * pixels_per_metre;
  if (place.widest > 0) {
    const double limit = place.widest * pixels_per_metre;
    const double plus = FindEdge(view, base, across, limit, clearance);
    const double minus = FindEdge(view, base, -across, limit, clearance);
    if (plus < 0 || minus < 0 || plus + minus > limit) return std::nullopt;
  }
  const int half_width =
      static_cast<int>(std::ceil(place.half_width * pixels_per_metre));
  std::vector<double> edges(2 * half_width + 1, -1);
  double farthest = -1;
  for (int i = -half_width; i <= half_width; ++i) {
    const Eigen::Vector2d start = base + i * across;
    if (!IsInFrame(view, start)) continue;
    edges[i + half_width] =
        FindEdge(view, start, along, length + reach, clearance);
    farthest = std::max(farthest, edges[i + half_width]);
  }
  // An edge well before the tip belongs to something else. Near the base there
  // may be no edge at all.
  if (farthest < 0 || farthest < length - reach) return std::nullopt;
  double sum = 0;
  int count = 0;
  for (int i = -half_width; i <= half_width; ++i) {
    if (edges[i + half_width] < farthest - 1) continue;
    sum += i;
    ++count;
  }
  const double tangent_excess =
      place.radius * (1 - foreshortening) * pixels_per_metre;
  PointObservation tip;
  tip.camera = &view.camera;
  tip.pinhole_pixel =
      base + (farthest - tangent_excess) * along + sum / count * across;
  tip.axis = along;
  tip.sigma_along_axis =
      std::sqrt(1 + std::pow(kTipSigma * pixels_per_metre, 2) +
                std::pow(0.5 * tangent_excess, 2));
  tip.sigma_across_axis =
      std::hypot(1.0, kBluntness * place.half_width * pixels_per_metre);
  return tip;
}

std::optional<PointObservation> MeasureCorner(
    const View& view,
    const Eigen::Vector3d& limb_in_world,
    const Eigen::Vector3d& other_limb_in_world,
    const Eigen::Vector3d& joint_in_world,
    double max_distance,
    double stature) {
  // Where views touch a fold of skin, of stature: towards the joint and beside.
  constexpr double kFoldDepth = 0.005;
  constexpr double kFoldWidth = 0.015;
  constexpr double kMinGap = 2;  // pixels; less is noise of the silhouette
  for (const auto& point :
       {limb_in_world, other_limb_in_world, joint_in_world}) {
    if (view.camera.PointInCamera(point).z() <= 0.1) return std::nullopt;
  }
  const Eigen::Vector2d a = view.camera.ProjectPinhole(limb_in_world);
  const Eigen::Vector2d b = view.camera.ProjectPinhole(other_limb_in_world);
  const Eigen::Vector2d joint = view.camera.ProjectPinhole(joint_in_world);
  const Eigen::Vector2d start = 0.5 * (a + b);
  const double length = (joint - start).norm();
  if (length < 4 || !IsInFrame(view, start) || !IsInFrame(view, joint)) {
    return std::nullopt;
  }
  const Eigen::Vector2d along = (joint - start) / length;
  const Eigen::Vector2d across(-along.y(), along.x());
  const double width = std::max(std::abs(across.dot(a - start)),
                                std::abs(across.dot(b - start)));
  if (width < 4 ||
      SampleBilinear(view.signed_distance, start).value < kMinGap) {
    return std::nullopt;
  }
  // Row by row towards the joint: what is background and joins background of
  // the row before, within the triangle.
  const int half = static_cast<int>(std::ceil(width));
  std::vector<char> before(2 * half + 1, 0), row;
  before[half] = 1;
  double reached = -1, middle = 0, run = 0;
  for (int at = 0; at < static_cast<int>(length); ++at) {
    row.assign(before.size(), 0);
    const double limit = width * (1 - at / length);
    bool any = false;
    double low = half, high = -half;
    const auto is_open = [&](int i) {
      if (std::abs(i) > limit) return false;
      const Eigen::Vector2d pixel = start + at * along + i * across;
      return IsInFrame(view, pixel) &&
             SampleBilinear(view.signed_distance, pixel).value > 0;
    };
    for (int i = -half; i <= half; ++i) {
      const int k = i + half;
      if (row[k] || !before[k] || !is_open(i)) continue;
      // The whole run of background around it.
      for (const int step : {-1, 1}) {
        for (int n = i; std::abs(n) <= half && is_open(n); n += step) {
          row[n + half] = 1;
          low = std::min<double>(low, n);
          high = std::max<double>(high, n);
        }
      }
      any = true;
    }
    if (!any) break;
    reached = at;
    middle = 0.5 * (low + high);
    run = high - low;
    before.swap(row);
  }
  const double pixels_per_metre =
      view.camera.FocalLength() / view.camera.PointInCamera(joint_in_world).z();
  if (reached < 1 || length - reached > max_distance * pixels_per_metre) {
    return std::nullopt;
  }
  PointObservation corner;
  corner.camera = &view.camera;
  corner.pinhole_pixel = start + reached * along + middle * across;
  corner.axis = along;
  corner.sigma_along_axis =
      std::hypot(1.0, kFoldDepth * stature * pixels_per_metre);
  corner.sigma_across_axis =
      std::hypot(0.5 * run, kFoldWidth * stature * pixels_per_metre);
  return corner;
}

}  // namespace sweepfit
