// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_contours.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

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
constexpr double kHuber = 2.5;
constexpr int kIterations = 10;

bool IsInFrame(const View& view, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 &&
         pixel.x() <= view.signed_distance.cols - 1 &&
         pixel.y() <= view.signed_distance.rows - 1;
}

// Pixels from `start` (inside) along the direction to the edge; negative when
// there is none within `limit` or no `clearance` of background behind it.
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

// d pi / d X of the pinhole projection, 2 x 3.
Eigen::Matrix<double, 2, 3> ProjectionJacobian(const Camera& camera,
                                               const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = camera.PointInCamera(point);
  Eigen::Matrix<double, 2, 3> by_camera_point;
  by_camera_point << camera.K(0, 0) / p.z(), camera.K(0, 1) / p.z(),
      -(camera.K(0, 0) * p.x() + camera.K(0, 1) * p.y()) / (p.z() * p.z()), 0,
      camera.K(1, 1) / p.z(), -camera.K(1, 1) * p.y() / (p.z() * p.z());
  return by_camera_point * camera.camera_from_world;
}

Landmark2 MakePoint(const View& view,
                    const Landmark3& landmark,
                    const Eigen::Vector2d& pinhole_pixel,
                    const Eigen::Matrix2d& covariance) {
  Landmark2 point;
  point.camera_id = view.camera.id;
  point.name = landmark.name;
  point.pixel = view.camera.Distort(pinhole_pixel);
  point.covariance = covariance;
  return point;
}

struct Observation {
  const View* view;
  EdgeMidpoint edge;
  double Residual(const Eigen::Vector3d& point) const {
    return edge.across.dot(view->camera.ProjectPinhole(point) -
                           edge.pinhole_pixel) /
           edge.sigma;
  }
};

}  // namespace

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
  EdgeMidpoint result;
  result.across = Eigen::Vector2d(-along.y(), along.x()).normalized();
  const double limit = max_half_width * pixels_per_metre;
  const double clearance = std::max(3.0, kClearance * pixels_per_metre);
  const double plus =
      FindEdge(view, pixel, result.across, 2 * limit, clearance);
  const double minus =
      FindEdge(view, pixel, -result.across, 2 * limit, clearance);
  if (plus < 0 || minus < 0 || plus + minus > 2 * limit) return std::nullopt;
  result.pinhole_pixel = pixel + 0.5 * (plus - minus) * result.across;
  result.half_width = 0.5 * (plus + minus) / pixels_per_metre;
  result.sigma = std::hypot(kEdgeSigma, kMidpointSigma * pixels_per_metre);
  return result;
}

void RefineAcrossLimb(const std::vector<View>& views,
                      const Eigen::Vector3d& unit_limb_direction,
                      double max_half_width,
                      Landmark3* landmark,
                      std::vector<Landmark2>* points) {
  std::vector<Observation> observations;
  for (const View& view : views) {
    const auto edge = MeasureLimb(
        view, landmark->point_in_world, unit_limb_direction, max_half_width);
    if (edge) observations.push_back({&view, *edge});
  }
  if (observations.size() < 2) return;

  // The section's centroid came from the same silhouettes: it only holds what
  // the views leave open.
  constexpr double kPriorAcross = 0.03;
  const Eigen::Matrix3d along =
      unit_limb_direction * unit_limb_direction.transpose();
  const double along_variance =
      unit_limb_direction.dot(landmark->covariance * unit_limb_direction);
  const Eigen::Matrix3d prior =
      along / along_variance +
      (Eigen::Matrix3d::Identity() - along) / (kPriorAcross * kPriorAcross);
  Eigen::Vector3d x = landmark->point_in_world;
  Eigen::Matrix3d information = prior;
  for (int i = 0; i < kIterations; ++i) {
    information = prior;
    Eigen::Vector3d gradient = prior * (x - landmark->point_in_world);
    for (const Observation& observation : observations) {
      const double r = observation.Residual(x);
      const double weight = std::abs(r) > kHuber ? kHuber / std::abs(r) : 1;
      const Eigen::Vector3d row =
          (observation.edge.across.transpose() *
           ProjectionJacobian(observation.view->camera, x))
              .transpose() /
          observation.edge.sigma;
      information += weight * row * row.transpose();
      gradient += weight * r * row;
    }
    const Eigen::Vector3d step = information.ldlt().solve(gradient);
    x -= step;
    if (step.norm() < 1e-7) break;
  }
  int agreeing = 0;
  for (const Observation& observation : observations) {
    if (std::abs(observation.Residual(x)) <= kHuber) ++agreeing;
  }
  if (agreeing < 2) return;
  for (const Observation& observation : observations) {
    if (std::abs(observation.Residual(x)) > kHuber) continue;
    const Eigen::Vector2d across = observation.edge.across;
    const double scale = observation.view->camera.FocalLength() /
                         observation.view->camera.PointInCamera(x).z();
    const double sigma_along = std::sqrt(along_variance) * scale;
    const Eigen::Matrix2d projection = across * across.transpose();
    points->push_back(
        MakePoint(*observation.view,
                  *landmark,
                  observation.edge.pinhole_pixel,
                  observation.edge.sigma * observation.edge.sigma * projection +
                      sigma_along * sigma_along *
                          (Eigen::Matrix2d::Identity() - projection)));
  }
  // Anatomy: the joint lies a few millimetres off the middle of the limb.
  constexpr double kAnatomySigma = 0.006;
  landmark->point_in_world = x;
  landmark->covariance =
      information.inverse() +
      kAnatomySigma * kAnatomySigma * (Eigen::Matrix3d::Identity() - along);
  landmark->num_views = agreeing;
  landmark->source = "contour";
}

void MeasureTip(const std::vector<View>& views,
                const Landmark3& tip,
                const Eigen::Vector3d& base_in_world,
                std::vector<Landmark2>* points) {
  for (const View& view : views) {
    const double depth = view.camera.PointInCamera(tip.point_in_world).z();
    if (depth <= 0.1 || view.camera.PointInCamera(base_in_world).z() <= 0.1) {
      continue;
    }
    const double pixels_per_metre = view.camera.FocalLength() / depth;
    const Eigen::Vector2d base = view.camera.ProjectPinhole(base_in_world);
    const Eigen::Vector2d way =
        view.camera.ProjectPinhole(tip.point_in_world) - base;
    const double length = way.norm();
    if (!IsInFrame(view, base) || length < 0.02 * pixels_per_metre) continue;
    const double edge = FindEdge(view,
                                 base,
                                 way / length,
                                 length + 0.02 * pixels_per_metre,
                                 0.02 * pixels_per_metre);
    // An edge well before the tip belongs to something else.
    if (edge < length - 0.03 * pixels_per_metre) continue;
    const double sigma = std::hypot(1.0, 0.006 * pixels_per_metre);
    points->push_back(MakePoint(view,
                                tip,
                                base + edge / length * way,
                                sigma * sigma * Eigen::Matrix2d::Identity()));
  }
}

void MeasureCorner(const std::vector<View>& views,
                   const std::string& name,
                   const Eigen::Vector3d& limb_in_world,
                   const Eigen::Vector3d& other_limb_in_world,
                   const Eigen::Vector3d& joint_in_world,
                   double max_distance,
                   std::vector<Landmark2>* points) {
  constexpr double kStep = 0.5;  // pixels
  const Eigen::Vector3d between = 0.5 * (limb_in_world + other_limb_in_world);
  for (const View& view : views) {
    if (view.camera.PointInCamera(between).z() <= 0.1 ||
        view.camera.PointInCamera(joint_in_world).z() <= 0.1) {
      continue;
    }
    const Eigen::Vector2d start = view.camera.ProjectPinhole(between);
    const Eigen::Vector2d way =
        view.camera.ProjectPinhole(joint_in_world) - start;
    const double length = way.norm();
    if (length < 4 || !IsInFrame(view, start) ||
        !IsInFrame(view, start + way)) {
      continue;
    }
    // A gap of a pixel or two is noise of the silhouette.
    double before = SampleBilinear(view.signed_distance, start).value;
    if (before < 2) continue;
    for (double at = kStep; at <= length; at += kStep) {
      const Eigen::Vector2d pixel = start + at / length * way;
      const double distance = SampleBilinear(view.signed_distance, pixel).value;
      if (distance <= 0) {
        const double reach = max_distance * view.camera.FocalLength() /
                             view.camera.PointInCamera(joint_in_world).z();
        if (length - at > reach) break;
        const double back = kStep * distance / (distance - before);
        Landmark3 corner;
        corner.name = name;
        // Sharp along the way, wide across: the corner is rounded.
        const Eigen::Vector2d along = way / length;
        const Eigen::Matrix2d covariance =
            64 * Eigen::Matrix2d::Identity() - 63 * along * along.transpose();
        points->push_back(
            MakePoint(view, corner, pixel - back * along, covariance));
        break;
      }
      before = distance;
    }
  }
}

}  // namespace sweepfit
