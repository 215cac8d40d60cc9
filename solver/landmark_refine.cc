// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_refine.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "solver/landmark_contours.h"
#include "solver/landmark_triangulation.h"

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

const View& ViewOf(const std::vector<View>& views,
                   const PointObservation& observation) {
  return *std::find_if(views.begin(), views.end(), [&](const View& view) {
    return &view.camera == observation.camera;
  });
}

// Takes over what was triangulated, and the pictures' part in it.
void Store(const std::vector<View>& views,
           const Triangulation& found,
           const std::vector<PointObservation>& observations,
           Landmark3* landmark,
           std::vector<Landmark2>* points) {
  landmark->point_in_world = found.point_in_world;
  landmark->covariance = found.covariance;
  landmark->num_views = found.num_views;
  constexpr double kDecides = 0.85;
  landmark->source = found.contour_share > kDecides ? "contour" : "both";
  for (size_t i = 0; i < observations.size(); ++i) {
    if (!found.agrees[i]) continue;
    PointObservation observation = observations[i];
    if (observation.sigma_across_axis == 0) {
      // A limb's middle: along the limb the picture shows what the landmark
      // is known to.
      const Vector3d p =
          observation.camera->PointInCamera(found.point_in_world);
      observation.sigma_across_axis = std::sqrt(found.covariance.trace()) *
                                      observation.camera->FocalLength() / p.z();
    }
    const View& view = ViewOf(views, observation);
    points->push_back({view.camera.id,
                       landmark->name,
                       view.camera.Distort(observation.pinhole_pixel),
                       observation.Covariance(),
                       "contour"});
  }
}

class Refiner {
 public:
  Refiner(const std::vector<View>& views,
          const BodyTrace& body,
          LandmarkResult* result)
      : views_(views), body_(body), result_(result) {}

  void Run() {
    for (const BodyTrace::LimbPlace& place : body_.limb_places) {
      if (Landmark3* landmark = Joint(place.joint)) RefineLimb(place, landmark);
    }
    for (const TipPlace& place : body_.tip_places) {
      if (Landmark3* landmark = Joint(place.joint)) RefineTip(place, landmark);
    }
    if (body_.neck) RefineNeck(*body_.neck);
  }

 private:
  Landmark3* Joint(int joint) {
    for (Landmark3& landmark : result_->landmarks) {
      if (landmark.joint == joint) return &landmark;
    }
    return nullptr;
  }

  void RefineLimb(const BodyTrace::LimbPlace& place, Landmark3* landmark);
  void RefineTip(const TipPlace& place, Landmark3* landmark);
  void RefineNeck(const BodyTrace::NeckPlace& place);
  const std::vector<View>& views_;
  const BodyTrace& body_;
  LandmarkResult* result_;
};

void Refiner::RefineLimb(const BodyTrace::LimbPlace& place,
                         Landmark3* landmark) {
  std::vector<EdgeMidpoint> edges;
  for (const View& view : views_) {
    const auto edge = MeasureLimb(
        view, place.point_in_world, place.direction, place.max_half_width);
    if (edge) edges.push_back(*edge);
  }
  const std::vector<PointObservation> observations = AllowForNeighbours(edges);
  // The section's centroid came from the same silhouettes: across the limb it
  // only holds what the views leave open.
  constexpr double kPriorAcross = 0.03;
  // Anatomy: the joint lies a few millimetres off the middle of the limb.
  constexpr double kAnatomySigma = 0.005;
  const double along =
      std::sqrt(place.direction.dot(landmark->covariance * place.direction));
  const PointPrior prior{
      place.point_in_world,
      AlongAcross(place.direction, along, kPriorAcross) + place.slack};
  const auto found = TriangulatePoint(observations, prior);
  if (!found) return;
  const Vector3d joint_from_place =
      landmark->point_in_world - place.point_in_world;
  Store(views_, *found, observations, landmark, &result_->points);
  landmark->point_in_world += joint_from_place;
  landmark->source = "contour";
  landmark->covariance += AlongAcross(place.direction, 0, kAnatomySigma);
}

void Refiner::RefineTip(const TipPlace& place, Landmark3* landmark) {
  const PointPrior prior{landmark->point_in_world, landmark->covariance};
  std::vector<PointObservation> observations;
  std::optional<Triangulation> found;
  Vector3d tip = landmark->point_in_world;
  // The second look follows the direction found in the first.
  for (int pass = 0; pass < 2; ++pass) {
    observations.clear();
    for (const View& view : views_) {
      if (const auto seen = MeasureTip(view, place, tip)) {
        observations.push_back(*seen);
      }
    }
    const auto next = TriangulatePoint(observations, prior);
    if (!next) break;
    found = next;
    tip = next->point_in_world;
  }
  if (!found || found->agrees.size() != observations.size()) return;
  const Vector3d along = (tip - place.base_in_world).normalized();
  Store(views_, *found, observations, landmark, &result_->points);
  landmark->covariance +=
      AlongAcross(along, place.anatomy_along, place.anatomy_across);
}

void Refiner::RefineNeck(const BodyTrace::NeckPlace& place) {
  Landmark3* neck = Joint(kNeck);
  if (neck == nullptr || !place.is_clear) return;
  // Every view is measured where it shows the neck narrowest: from above, the
  // chin hides what is below it. Necks lean, so that these levels do not have
  // one middle; what they say is carried along the neck's axis.
  const double reach = 0.025 * result_->stature;
  constexpr double kStep = 0.004;  // metres
  std::vector<PointObservation> observations;
  for (const View& view : views_) {
    std::optional<EdgeMidpoint> narrowest;
    Vector3d from_center = Vector3d::Zero();
    for (double along = -reach; along <= reach; along += kStep) {
      const Vector3d way = along * place.axis / place.axis.dot(place.down);
      const auto edge = MeasureLimb(
          view, place.center_in_world + way, place.down, place.max_half_width);
      if (!edge || (narrowest && edge->half_width >= narrowest->half_width)) {
        continue;
      }
      narrowest = edge;
      from_center = way;
    }
    if (!narrowest) continue;
    PointObservation observation = narrowest->observation;
    observation.pinhole_pixel -=
        view.camera.ProjectPinhole(place.center_in_world + from_center) -
        view.camera.ProjectPinhole(place.center_in_world);
    observations.push_back(observation);
  }
  constexpr double kPriorAlong = 0.015;
  constexpr double kPriorAcross = 0.015;
  const PointPrior prior{place.center_in_world,
                         AlongAcross(place.down, kPriorAlong, kPriorAcross)};
  const auto found = TriangulatePoint(observations, prior);
  if (!found) return;
  const Vector3d joint_from_middle =
      neck->point_in_world - place.center_in_world;
  Landmark3 middle;
  middle.name = "neck_middle";
  Store(views_, *found, observations, &middle, &result_->points);
  middle.source = "contour";
  neck->point_in_world = middle.point_in_world + joint_from_middle;
  neck->num_views = middle.num_views;
  neck->source = "both";
  result_->features.push_back(std::move(middle));
}

}  // namespace

std::vector<Landmark3> TriangulateCorners(const std::vector<View>& views,
                                          const std::vector<Landmark3>& rough,
                                          double stature,
                                          std::vector<Landmark2>* points) {
  // Corners of the outline lie this close to the joint behind them, of stature.
  constexpr double kReach = 0.09;
  std::vector<Landmark3> corners;
  const auto find = [&](int joint) -> const Landmark3* {
    for (const Landmark3& landmark : rough) {
      if (landmark.joint == joint) return &landmark;
    }
    return nullptr;
  };
  struct Corner {
    const char* name;
    int limb, other_limb, joint;
  };
  for (const Corner& corner :
       {Corner{"crotch", kLAnkle, kRAnkle, kRoot},
        Corner{"l_armpit", kLWrist, kLHip, kLShoulder},
        Corner{"r_armpit", kRWrist, kRHip, kRShoulder}}) {
    const Landmark3* a = find(corner.limb);
    const Landmark3* b = find(corner.other_limb);
    const Landmark3* joint = find(corner.joint);
    if (a == nullptr || b == nullptr || joint == nullptr) continue;
    std::vector<PointObservation> observations;
    for (const View& view : views) {
      const auto seen = MeasureCorner(view,
                                      a->point_in_world,
                                      b->point_in_world,
                                      joint->point_in_world,
                                      kReach * stature,
                                      stature);
      if (seen) observations.push_back(*seen);
    }
    const auto found = TriangulatePoint(observations, std::nullopt);
    if (!found) continue;
    Landmark3 feature;
    feature.name = corner.name;
    Store(views, *found, observations, &feature, points);
    corners.push_back(std::move(feature));
  }
  return corners;
}

void RefineInViews(const std::vector<View>& views,
                   const BodyTrace& body,
                   LandmarkResult* result) {
  Refiner(views, body, result).Run();
}

}  // namespace sweepfit
