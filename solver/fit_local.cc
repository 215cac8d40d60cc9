// SPDX-License-Identifier: Apache-2.0
#include <ceres/ceres.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <string>

#include "residuals/contour_match.h"
#include "residuals/hull_distance.h"
#include "residuals/prior.h"
#include "residuals/radius_point_cost.h"
#include "residuals/radius_smoothness.h"
#include "residuals/silhouette_rim.h"
#include "residuals/surface_point.h"
#include "solver/carried_surface.h"
#include "solver/fit_body.h"
#include "solver/radius_problem.h"
#include "solver/solve_person.h"
#include "volume/cut_plane.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

constexpr int kHullStride = 5;
constexpr double kRimReach = 20;  // pixels
// Outlines move the pose less than the radii: a body of wrong radii errs.
constexpr double kPoseRimSigma = 0.004;  // metres
// Outlines this far off on average mean a wrong posture, not a rough surface.
constexpr double kSoundRimError = 0.015;  // metres

// The photographs are matched this far about the body, metres, in steps of so
// many pixels.
constexpr double kPhotoReach = 0.035;
constexpr double kPhotoReachLast = 0.018;
constexpr double kPhotoStep = 0.85;
// And the edges of limbs in front of others, metres.
constexpr double kInnerReach = 0.025;
constexpr double kInnerReachLast = 0.015;

// The radii of every round but the last take one step: the rims are found anew
// after it.
constexpr int kMaxIterationsLast = 2;

// The feature weight (paper IV.B) where a vertex sits.
double FeatureWeight(const Body& body, int vertex) {
  double weight = 0;
  for (const SweepAttachment& a : body.binding[vertex].attachment) {
    if (a.sweep < 0 || a.weight <= 0) continue;
    const Sweep& sweep = body.sweeps[a.sweep];
    const auto above =
        std::upper_bound(sweep.key_u.begin(), sweep.key_u.end(), a.u);
    const int hi = std::clamp<int>(
        static_cast<int>(above - sweep.key_u.begin()), 1, sweep.num_rows() - 1);
    const double span = sweep.key_u[hi] - sweep.key_u[hi - 1];
    const double f = std::clamp((a.u - sweep.key_u[hi - 1]) / span, 0.0, 1.0);
    weight += a.weight * ((1 - f) * sweep.feature_weight[hi - 1] +
                          f * sweep.feature_weight[hi]);
  }
  return weight;
}

// A posed vertex as a linear function of the rows, and the rows it needs.
struct RowPoint {
  std::shared_ptr<const RadiusPoint> point;
  std::vector<double*> blocks;
};

RowPoint MakeRowPoint(const Body& body,
                      const PosedBody& posed,
                      const RestDerivative& rest_derivative,
                      int vertex,
                      RadiusProblem* problem) {
  auto point = std::make_shared<RadiusPoint>();
  RowPoint result;
  point->point_in_world = posed.mesh.vertices[vertex];
  std::map<std::pair<int, int>, int> block_of_row;
  for (const auto& term : rest_derivative.terms) {
    const int columns = body.sweeps[term.sweep].num_columns();
    const int row = term.sample / columns, column = term.sample % columns;
    const auto [it, inserted] = block_of_row.try_emplace(
        {term.sweep, row}, static_cast<int>(result.blocks.size()));
    if (inserted) {
      result.blocks.push_back(problem->Row(term.sweep, row));
      point->block_sizes.push_back(columns);
    }
    point->terms.push_back(
        {it->second,
         column,
         problem->Row(term.sweep, row)[column],
         posed.motions[vertex].rotation * term.direction_at_rest});
  }
  result.point = std::move(point);
  return result;
}

template <typename Measurement>
void AddPoint(RadiusFamily family,
              Measurement measurement,
              const RowPoint& point,
              double weight,
              ceres::LossFunction* loss,
              RadiusProblem* problem) {
  problem->Add(
      family,
      new RadiusPointCost<Measurement>(std::move(measurement), point.point),
      new ceres::ScaledLoss(loss, weight, ceres::TAKE_OWNERSHIP),
      point.blocks);
}

// Returns the mean rim error of the body as it stands, metres.
double AddEvidence(const PoseEvidence& evidence,
                   const LocalOptions& options,
                   double sigma_rim,
                   const Body& body,
                   const Pose& pose,
                   const std::vector<RestDerivative>& rest_derivatives,
                   const PictureMatches& pictures,
                   RadiusProblem* problem) {
  const PosedBody posed = PoseForFit(body, pose);
  const std::vector<View>& views = *evidence.views;
  RimEvidence rims = GatherRims(evidence, posed, body, kRimReach);
  rims.AddPairs(pictures.inner);
  std::map<int, RowPoint> points;
  const auto at = [&](int vertex) -> const RowPoint& {
    auto [it, inserted] = points.try_emplace(vertex);
    if (inserted) {
      it->second =
          MakeRowPoint(body, posed, rest_derivatives[vertex], vertex, problem);
    }
    return it->second;
  };
  for (const RimPoint& rim : rims.rim) {
    const double weight = rim.weight * FeatureWeight(body, rim.vertex);
    const View& view = views[rim.view];
    if (weight <= 0 || at(rim.vertex).blocks.empty()) continue;
    AddPoint(RadiusFamily::kSilhouette,
             SilhouetteRim(&view.camera, &view.signed_distance, sigma_rim),
             at(rim.vertex),
             weight,
             new ceres::HuberLoss(2),
             problem);
  }
  for (const ContourPair& pair : rims.contour) {
    const double weight = pair.weight * FeatureWeight(body, pair.vertex);
    const View& view = views[pair.view];
    if (weight <= 0 || at(pair.vertex).blocks.empty()) continue;
    AddPoint(RadiusFamily::kSilhouette,
             ContourMatch(&view.camera,
                          pair.contour_pixel,
                          pair.contour_normal,
                          pair.depth,
                          sigma_rim),
             at(pair.vertex),
             weight,
             new ceres::TukeyLoss(6),
             problem);
  }
  for (const PhotoPoint& seen : pictures.photo.points) {
    const double weight =
        evidence.photo->options().weight * FeatureWeight(body, seen.vertex);
    if (weight <= 0 || at(seen.vertex).blocks.empty()) continue;
    AddPoint(RadiusFamily::kPhoto,
             SurfacePoint(seen.point_in_world, seen.unit_normal, seen.sigma),
             at(seen.vertex),
             weight,
             new ceres::HuberLoss(2),
             problem);
  }
  HullDistance::Options hull;
  hull.margin = 0.5 * evidence.volume->voxel_size();
  hull.sigma_outside = options.sigma_hull;
  for (int v = 0; v < body.num_vertices(); v += kHullStride) {
    const double weight = 0.3 * FeatureWeight(body, v);
    if (weight <= 0) continue;
    // Deep inside and far outside the hull says nothing about a radius.
    const double phi = evidence.volume->Sample(posed.mesh.vertices[v]);
    if (std::abs(phi) >= 0.99 * evidence.volume->band_half_width() && phi < 0) {
      continue;
    }
    if (at(v).blocks.empty()) continue;
    AddPoint(RadiusFamily::kHull,
             HullDistance(evidence.volume, hull),
             at(v),
             weight,
             new ceres::HuberLoss(2),
             problem);
  }
  return MeanRimError(rims, views);
}

// Column of the mirrored sweep that lies opposite to each column. Reference
// directions are either mirrored (theta -> -theta) or kept (theta -> pi -
// theta) by x -> -x.
std::vector<int> MirrorColumns(const Sweep& left, const Sweep& right) {
  const int n = left.num_columns();
  const Vector3d mirrored(-left.rest_reference.x(),
                          left.rest_reference.y(),
                          left.rest_reference.z());
  const bool same = mirrored.dot(right.rest_reference) > 0;
  std::vector<int> columns(n);
  for (int k = 0; k < n; ++k) {
    columns[k] = same ? (n - k) % n : (n / 2 - k + n) % n;
  }
  return columns;
}

void AddRegularisation(const Body& body,
                       const LocalOptions& options,
                       RadiusProblem* problem) {
  for (size_t i = 0; i < body.sweeps.size(); ++i) {
    const int s = static_cast<int>(i);
    const Sweep& sweep = body.sweeps[s];
    const int n = sweep.num_columns();
    const int mirror = MirrorSweep(body, s);
    for (int r = 0; r < sweep.num_rows(); ++r) {
      problem->Add(RadiusFamily::kSmoothness,
                   SmoothAroundSection(n, options.sigma_around),
                   nullptr,
                   {problem->Row(s, r)});
      problem->Add(RadiusFamily::kTemplate,
                   new PriorResidual(
                       Eigen::VectorXd::Zero(n),
                       Eigen::VectorXd::Constant(n, options.sigma_magnitude)),
                   nullptr,
                   {problem->Row(s, r)});
      if (r > 0 && r + 1 < sweep.num_rows()) {
        problem->Add(RadiusFamily::kSmoothness,
                     SmoothAlongSweep(n,
                                      sweep.key_u[r] - sweep.key_u[r - 1],
                                      sweep.key_u[r + 1] - sweep.key_u[r],
                                      options.sigma_along),
                     nullptr,
                     {problem->Row(s, r - 1),
                      problem->Row(s, r),
                      problem->Row(s, r + 1)});
      }
      if (mirror == s) {
        problem->Add(RadiusFamily::kSymmetry,
                     SectionSymmetry(MirrorColumns(sweep, sweep),
                                     options.sigma_symmetry),
                     nullptr,
                     {problem->Row(s, r)});
      } else if (mirror > s) {
        problem->Add(RadiusFamily::kSymmetry,
                     RowSymmetry(MirrorColumns(sweep, body.sweeps[mirror]),
                                 options.sigma_symmetry),
                     nullptr,
                     {problem->Row(s, r), problem->Row(mirror, r)});
      }
    }
  }
}

// Solves for the radii and stores them. Returns the problem, which knows how
// well each section is known.
std::unique_ptr<RadiusProblem> SolveRadii(
    const std::vector<PoseEvidence>& evidence,
    const LocalOptions& options,
    double sigma_rim,
    int max_iterations,
    const JointResult& joints,
    const std::vector<PictureMatches>& pictures,
    Body* body,
    nlohmann::ordered_json* report) {
  auto problem = std::make_unique<RadiusProblem>(*body);
  const std::vector<RestDerivative> rest_derivatives = RestByLogRatio(*body);
  double rim_error = 0;
  for (size_t p = 0; p < evidence.size(); ++p) {
    rim_error += AddEvidence(evidence[p],
                             options,
                             sigma_rim,
                             *body,
                             joints.poses[p].pose,
                             rest_derivatives,
                             pictures[p],
                             problem.get()) /
                 static_cast<double>(evidence.size());
  }
  AddRegularisation(*body, options, problem.get());
  *report = problem->Solve(max_iterations);
  (*report)["rim_error_start_mm"] = 1000 * rim_error;
  problem->Store(body);
  return problem;
}

// With cameras in opposite pairs (a ring of four) what one outline leaves open
// the pictures must close, and pose and radii take longer to agree.
int NumRounds(const std::vector<PoseEvidence>& evidence,
              const LocalOptions& options) {
  constexpr int kPlenty = 3;
  const bool few = std::any_of(
      evidence.begin(), evidence.end(), [](const PoseEvidence& pose) {
        return NumOutlines(*pose.views) < kPlenty;
      });
  return few ? options.rounds_two_outlines : options.rounds;
}

// Radii read off the hull along rays in the section planes, averaged over the
// poses: the paper's local fit. Rays that run into another limb are left out.
void SampleHullRadii(const std::vector<PoseEvidence>& evidence,
                     bool feature_weighted,
                     const JointResult& joints,
                     Body* body) {
  constexpr double kLargestRatio = 1.6;
  for (Sweep& sweep : body->sweeps) {
    const Eigen::MatrixXd before = sweep.log_ratio;
    for (int r = 0; r < sweep.num_rows(); ++r) {
      for (int c = 0; c < sweep.num_columns(); ++c) {
        const double theta = 2 * std::numbers::pi * c / sweep.num_columns();
        const double fitted = sweep.radius(r, c) * std::exp(before(r, c));
        double sum = 0;
        int count = 0;
        for (size_t p = 0; p < evidence.size(); ++p) {
          const SweepAxis axis(sweep, body->skeleton, joints.poses[p].frames);
          const SectionFrame frame = axis.At(sweep.key_u[r]);
          const Vector3d direction =
              frame.world_from_section *
              Vector3d(std::cos(theta), std::sin(theta), 0);
          const double exit = RayExit(*evidence[p].volume,
                                      frame.center_in_world,
                                      direction,
                                      kLargestRatio * fitted);
          if (exit <= 0) continue;
          sum += exit;
          ++count;
        }
        if (count == 0) continue;
        const double ratio = sum / count / sweep.radius(r, c);
        const double w = feature_weighted ? sweep.feature_weight[r] : 1.0;
        sweep.log_ratio(r, c) =
            std::clamp(std::log(std::max(0.05, 1 + w * (ratio - 1))),
                       -kLargestLogRatio,
                       kLargestLogRatio);
      }
    }
  }
}

}  // namespace

std::optional<std::string> LocalOptions::Check() const {
  if (mode != "rim" && mode != "hull" && mode != "paper") {
    return "local.mode must be rim, hull or paper, not '" + mode + "'";
  }
  if (rounds < 1 || rounds > 50) return "local.rounds must be 1 to 50";
  if (rounds_two_outlines < 1 || rounds_two_outlines > 50) {
    return "local.rounds_two_outlines must be 1 to 50";
  }
  for (const double sigma : {sigma_rim,
                             sigma_hull,
                             sigma_around,
                             sigma_along,
                             sigma_magnitude,
                             sigma_symmetry}) {
    if (!(sigma > 0)) return "local.sigma_* must be positive";
  }
  return std::nullopt;
}

void FitLocal(const std::vector<PoseEvidence>& evidence,
              const LocalOptions& options,
              const JointOptions& joint_options,
              Body* body,
              JointResult* joints,
              StageSummary* summary) {
  summary->figures["mode"] = options.mode;
  summary->status = "ok";
  double error = 0;
  const auto rim_error = [&] {
    return Stand(evidence, *joints, *body, kRimReach).rim_error;
  };
  if (options.mode != "rim") {
    summary->figures["rim_error_start_mm"] = 1000 * rim_error();
    SampleHullRadii(evidence, options.mode == "paper", *joints, body);
    error = rim_error();
  } else {
    nlohmann::ordered_json report, person_report, sections;
    std::unique_ptr<RadiusProblem> problem;
    std::vector<PictureMatches> pictures(evidence.size());
    bool pose_is_usable = true;
    const auto solve_pose = [&](nlohmann::ordered_json* pose_report) {
      pose_is_usable = SolvePerson(evidence,
                                   {kPoseRimSigma, kRimReach, 3, 3},
                                   pictures,
                                   joint_options,
                                   nullptr,
                                   nullptr,
                                   body,
                                   joints,
                                   pose_report);
    };
    const int rounds = NumRounds(evidence, options);
    summary->figures["rounds"] = rounds;
    const bool by_pictures = evidence.front().photo != nullptr;
    for (int round = 0; round < rounds; ++round) {
      const bool first = round == 0, last = round + 1 == rounds;
      // Outlines first: photographs are matched about what nearly fits.
      if (!first) {
        const bool wide = round == 1 && !last;
        pictures = MatchPictures(evidence,
                                 PoseAll(*joints, *body),
                                 *body,
                                 {wide ? kPhotoReach : kPhotoReachLast,
                                  kPhotoStep,
                                  wide ? kInnerReach : kInnerReachLast});
        // What the turn of a limb explains, the radii shall not.
        if (by_pictures) solve_pose(last ? &person_report : nullptr);
      }
      problem.reset();  // large
      problem = SolveRadii(evidence,
                           options,
                           (first ? 2 : 1) * options.sigma_rim,
                           last ? kMaxIterationsLast : 1,
                           *joints,
                           pictures,
                           body,
                           &report);
      if (first) {
        summary->figures["rim_error_start_mm"] = report["rim_error_start_mm"];
      }
      // With better radii the outline says more about the pose. Later rounds
      // begin with it where there are pictures.
      if (last || (by_pictures && !first)) continue;
      const bool is_reported = round + 2 == rounds && !by_pictures;
      solve_pose(is_reported ? &person_report : nullptr);
    }
    // How well each section is known is told beside the last look at the rims.
    tbb::parallel_invoke(
        [&] { error = rim_error(); },
        [&] { sections = SectionsToJson(*body, problem->Evidence(*body)); });
    summary->figures["radii"] = report;
    summary->figures["pose"] = person_report;
    summary->figures["sections"] = sections;
    if (!pose_is_usable || !report["usable"].get<bool>()) {
      summary->status = "failed";
    }
  }
  summary->figures["rim_error_end_mm"] = 1000 * error;
  if (error > kSoundRimError && summary->status == "ok") {
    summary->status = "weak";
    summary->warnings.push_back(
        "the body's outline is " + std::to_string(std::lround(1000 * error)) +
        " mm off the silhouettes on average: this is not a sound fit");
  }
}

}  // namespace sweepfit
