// SPDX-License-Identifier: Apache-2.0
#include "solver/solve_person.h"

#include <ceres/loss_function.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "residuals/contour_match.h"
#include "residuals/hull_distance.h"
#include "residuals/silhouette_rim.h"
#include "residuals/surface_point.h"
#include "solver/person_problem.h"

namespace sweepfit {
namespace {

// Every n-th vertex is asked whether it lies inside the hull; vertices stand
// about 12 mm apart, so this many still see every part.
constexpr int kHullStride = 13;

void AddSurface(const PoseEvidence& evidence,
                int pose,
                const OutlineFit& outline,
                const PictureMatches* pictures,
                const JointOptions::Weights& weights,
                const Body& body,
                const JointEstimate& estimate,
                const GirthBasis* basis,
                const std::vector<RestDerivative>& rest_derivatives,
                const std::vector<double>& girth,
                PersonProblem* problem) {
  const PosedBody posed = PoseForFit(body, estimate.pose);
  const std::vector<View>& views = *evidence.views;
  RimEvidence rims = GatherRims(evidence, posed, body, outline.max_distance);
  if (pictures != nullptr) rims.AddPairs(pictures->inner);
  std::map<int, std::shared_ptr<const ShapedPoint>> carried;
  const auto carry = [&](int vertex) {
    auto& point = carried[vertex];
    if (point == nullptr) {
      point =
          CarryVertex(body,
                      estimate.frames,
                      posed,
                      vertex,
                      basis,
                      basis == nullptr ? nullptr : &rest_derivatives[vertex],
                      girth);
    }
    return point;
  };
  // Contour points stand farther apart than the vertices of the rim.
  const int stride = outline.stride;
  const int rim_stride = 2 * stride;
  for (size_t i = 0; i < rims.rim.size(); i += rim_stride) {
    const RimPoint& rim = rims.rim[i];
    const View& view = views[rim.view];
    problem->AddPoint(
        Family::kSilhouette,
        pose,
        SilhouetteRim(&view.camera, &view.signed_distance, outline.sigma),
        carry(rim.vertex),
        weights.silhouette * std::min(1.0, rim_stride * rim.weight),
        new ceres::HuberLoss(2));
  }
  for (size_t i = 0; i < rims.contour.size(); i += stride) {
    const ContourPair& pair = rims.contour[i];
    const View& view = views[pair.view];
    problem->AddPoint(Family::kSilhouette,
                      pose,
                      ContourMatch(&view.camera,
                                   pair.contour_pixel,
                                   pair.contour_normal,
                                   pair.depth,
                                   outline.sigma),
                      carry(pair.vertex),
                      weights.silhouette * std::min(1.0, stride * pair.weight),
                      new ceres::TukeyLoss(6));
  }
  if (pictures != nullptr) {
    for (size_t i = 0; i < pictures->photo.points.size(); i += stride) {
      const PhotoPoint& seen = pictures->photo.points[i];
      problem->AddPoint(
          Family::kPhoto,
          pose,
          SurfacePoint(seen.point_in_world,
                       seen.unit_normal,
                       std::max(outline.sigma, seen.sigma)),
          carry(seen.vertex),
          weights.photo * stride * evidence.photo->options().weight,
          new ceres::HuberLoss(2));
    }
  }
  HullDistance::Options hull;
  hull.margin = 0.5 * evidence.volume->voxel_size();
  hull.sigma_outside = outline.sigma;
  hull.sigma_inside = 10 * outline.sigma;
  for (size_t v = 0; v < posed.mesh.vertices.size(); v += kHullStride) {
    problem->AddPoint(Family::kHull,
                      pose,
                      HullDistance(evidence.volume, hull),
                      carry(static_cast<int>(v)),
                      0.5 * weights.silhouette,
                      new ceres::HuberLoss(2));
  }
}

}  // namespace

bool SolvePerson(const std::vector<PoseEvidence>& evidence,
                 const OutlineFit& outline,
                 const std::vector<PictureMatches>& pictures,
                 const JointOptions& options,
                 const GirthBasis* basis,
                 std::vector<double>* girth,
                 Body* body,
                 JointResult* joints,
                 nlohmann::ordered_json* report) {
  const JointAngles angles(joints->base);
  PersonParameters parameters;
  parameters.pose = joints->coordinates;
  parameters.log_length = joints->log_length;
  parameters.person = {joints->stature, joints->sex};
  if (basis != nullptr) parameters.girth = *girth;

  // The stretch terms of carried points count from the lengths the body has
  // now, so this problem starts there.
  const std::array<double, kNumLengthGroups> before = parameters.log_length;
  parameters.log_length.fill(0);
  PersonProblem problem(body->skeleton, &angles, &parameters);
  std::vector<RestDerivative> rest_derivatives;
  if (basis != nullptr) rest_derivatives = RestByLogRatio(*body);
  const double loss_scale = 2;
  const bool sigma_mode = options.mode == "sigma";
  const JointOptions::Weights weights = options.FamilyWeights();
  for (size_t p = 0; p < evidence.size(); ++p) {
    for (const Landmark3& landmark : evidence[p].landmarks->landmarks) {
      problem.AddLandmark(static_cast<int>(p),
                          landmark.joint,
                          landmark.point_in_world,
                          landmark.covariance,
                          weights.landmark,
                          loss_scale);
    }
    AddSurface(evidence[p],
               static_cast<int>(p),
               outline,
               pictures.empty() ? nullptr : &pictures[p],
               weights,
               *body,
               joints->poses[p],
               basis,
               rest_derivatives,
               parameters.girth,
               &problem);
  }
  problem.AddAnthropometric(Anthropometry::Default(), weights.anthropometric);
  problem.AddTemplateRatio(joints->base,
                           body->stature,
                           options.template_sigma,
                           weights.template_ratio);
  problem.AddPosePrior(weights.pose);
  problem.AddPersonPrior(
      joints->stature, joints->stature_sigma, weights.stature);
  if (basis != nullptr) problem.AddGirthPrior(basis->sigma(), 1.0);

  // Outlines say where limbs are and where they end, but little about where a
  // joint divides a limb: there the template's profile would speak, with a
  // confidence it does not deserve (sleeves, strong forearms). The lengths
  // between joints stay what landmarks and tables made them.
  problem.HoldLengths(sigma_mode);
  if (report != nullptr) problem.NoteStart();
  const bool usable = problem.Solve(outline.max_iterations);
  if (report != nullptr) *report = problem.Report();
  // Covariances stay those of landmarks and tables: with lengths held and an
  // outline whose errors are shared along whole limbs, this problem's own would
  // claim a millimetre.
  FillJointResult(problem, angles, parameters, false, joints);
  for (int g = 0; g < kNumLengthGroups; ++g) {
    joints->log_length[g] = before[g] + parameters.log_length[g];
  }
  SetBoneLengths(joints->skeleton.length, body);
  if (basis != nullptr) {
    *girth = parameters.girth;
    basis->Apply(*girth, body);
  }
  return usable;
}

}  // namespace sweepfit
