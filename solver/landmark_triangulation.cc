// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_triangulation.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "residuals/point_prior.h"
#include "residuals/reprojection.h"

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Observations = std::vector<PointObservation>;

double ResidualNorm(const PointObservation& observation,
                    const Vector3d& point) {
  const ReprojectionResidual cost(
      *observation.camera, observation.pinhole_pixel, observation.Whitening());
  const double* parameters[] = {point.data()};
  Eigen::Vector2d residual;
  cost.Evaluate(parameters, residual.data(), nullptr);
  return residual.norm();
}

// Two rows per view of the linear system  m x (K (R X + t)) = 0.
std::optional<Vector3d> TriangulateLinearly(const PointObservation& a,
                                            const PointObservation& b) {
  Eigen::Matrix4d system;
  int row = 0;
  for (const PointObservation* observation : {&a, &b}) {
    const Camera& camera = *observation->camera;
    Eigen::Matrix<double, 3, 4> projection;
    projection << camera.camera_from_world, camera.world_in_camera;
    projection = camera.K * projection;
    for (int i = 0; i < 2; ++i) {
      system.row(row) =
          observation->pinhole_pixel[i] * projection.row(2) - projection.row(i);
      system.row(row) /= system.row(row).norm();
      ++row;
    }
  }
  const Eigen::JacobiSVD<Eigen::Matrix4d> svd(system, Eigen::ComputeFullV);
  const Eigen::Vector4d x = svd.matrixV().col(3);
  if (std::abs(x.w()) < 1e-9) return std::nullopt;
  return Vector3d(x.hnormalized());
}

// The start: what most views agree with, over all pairs.
std::optional<Vector3d> StartFromPairs(const Observations& observations,
                                       double reject) {
  constexpr double kMinAngle = 20 * std::numbers::pi / 180;
  std::optional<Vector3d> best;
  double best_score = 0;
  for (size_t i = 0; i < observations.size(); ++i) {
    for (size_t k = i + 1; k < observations.size(); ++k) {
      const PointObservation& a = observations[i];
      const PointObservation& b = observations[k];
      if (a.sigma_across_axis == 0 || b.sigma_across_axis == 0) continue;
      const double cosine =
          std::abs(a.camera->RayInWorld(a.pinhole_pixel)
                       .dot(b.camera->RayInWorld(b.pinhole_pixel)));
      if (cosine > std::cos(kMinAngle)) continue;
      const auto point = TriangulateLinearly(a, b);
      if (!point) continue;
      // Views count by how well they agree, so that ties have a winner.
      double score = 0;
      for (const PointObservation& observation : observations) {
        const double r = ResidualNorm(observation, *point) / reject;
        score += std::max(0.0, 1 - r * r);
      }
      if (score > best_score) {
        best_score = score;
        best = point;
      }
    }
  }
  return best;
}

class PointProblem {
 public:
  PointProblem(const Observations& observations,
               const std::optional<PointPrior>& prior)
      : observations_(observations), prior_(prior) {}

  bool Solve(const std::vector<bool>& use, double huber, Vector3d* point) {
    ceres::Problem problem;
    problem.AddParameterBlock(point->data(), 3);
    for (size_t i = 0; i < observations_.size(); ++i) {
      if (!use[i]) continue;
      problem.AddResidualBlock(
          Cost(i), new ceres::HuberLoss(huber), point->data());
    }
    if (prior_) {
      problem.AddResidualBlock(
          new PointPriorResidual(prior_->point_in_world, prior_->covariance),
          nullptr,
          point->data());
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.dense_linear_algebra_library_type = ceres::EIGEN;
    options.num_threads = 1;
    options.max_num_iterations = 30;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    return summary.IsSolutionUsable() && point->allFinite();
  }

  // J^T J of the views in use.
  Matrix3d Information(const std::vector<bool>& use,
                       const Vector3d& point) const {
    Matrix3d information = Matrix3d::Zero();
    for (size_t i = 0; i < observations_.size(); ++i) {
      if (!use[i]) continue;
      const std::unique_ptr<ceres::CostFunction> cost(Cost(i));
      const double* parameters[] = {point.data()};
      Eigen::Vector2d residual;
      Eigen::Matrix<double, 2, 3, Eigen::RowMajor> jacobian;
      double* jacobians[] = {jacobian.data()};
      cost->Evaluate(parameters, residual.data(), jacobians);
      information += jacobian.transpose() * jacobian;
    }
    return information;
  }

 private:
  ceres::CostFunction* Cost(size_t i) const {
    return new ReprojectionResidual(*observations_[i].camera,
                                    observations_[i].pinhole_pixel,
                                    observations_[i].Whitening());
  }

  const Observations& observations_;
  const std::optional<PointPrior>& prior_;
};

}  // namespace

Eigen::Matrix2d PointObservation::Whitening() const {
  Eigen::Matrix2d whitening;
  whitening.row(0) = axis.transpose() / sigma_along_axis;
  whitening.row(1) = Eigen::RowVector2d(-axis.y(), axis.x()) *
                     (sigma_across_axis > 0 ? 1 / sigma_across_axis : 0);
  return whitening;
}

Eigen::Matrix2d PointObservation::Covariance() const {
  const Eigen::Matrix2d projection = axis * axis.transpose();
  return sigma_along_axis * sigma_along_axis * projection +
         sigma_across_axis * sigma_across_axis *
             (Eigen::Matrix2d::Identity() - projection);
}

std::optional<Triangulation> TriangulatePoint(
    const std::vector<PointObservation>& observations,
    const std::optional<PointPrior>& prior,
    const TriangulationOptions& options) {
  if (static_cast<int>(observations.size()) < options.min_views) {
    return std::nullopt;
  }
  std::optional<Vector3d> start;
  if (prior) {
    start = prior->point_in_world;
  } else {
    start = StartFromPairs(observations, options.reject);
  }
  if (!start) return std::nullopt;

  Triangulation result;
  result.point_in_world = *start;
  result.agrees.assign(observations.size(), true);
  PointProblem problem(observations, prior);
  // Dropping one view may move the point into the reach of another.
  constexpr int kMaxRounds = 5;
  for (int round = 0; round < kMaxRounds; ++round) {
    if (!problem.Solve(result.agrees, options.huber, &result.point_in_world)) {
      return std::nullopt;
    }
    std::vector<bool> agrees(observations.size());
    for (size_t i = 0; i < observations.size(); ++i) {
      agrees[i] = ResidualNorm(observations[i], result.point_in_world) <=
                  options.reject;
    }
    const bool settled = agrees == result.agrees;
    result.agrees = std::move(agrees);
    result.num_views = static_cast<int>(
        std::count(result.agrees.begin(), result.agrees.end(), true));
    if (result.num_views < options.min_views) return std::nullopt;
    if (settled) break;
  }

  const Matrix3d seen =
      problem.Information(result.agrees, result.point_in_world);
  Matrix3d information = seen;
  if (prior) information += prior->covariance.inverse();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(information);
  if (!(eigen.eigenvalues()[0] > 1 / (options.max_sigma * options.max_sigma))) {
    return std::nullopt;
  }
  result.covariance = eigen.eigenvectors() *
                      eigen.eigenvalues().cwiseInverse().asDiagonal() *
                      eigen.eigenvectors().transpose();
  result.contour_share = (result.covariance * seen).trace() / 3;
  double chi_square = 0;
  int measurements = 0;
  for (size_t i = 0; i < observations.size(); ++i) {
    if (!result.agrees[i]) continue;
    const double r = ResidualNorm(observations[i], result.point_in_world);
    chi_square += r * r;
    measurements += observations[i].sigma_across_axis > 0 ? 2 : 1;
  }
  const int freedom = measurements - (prior ? 0 : 3);
  if (freedom > 0) result.covariance *= std::max(1.0, chi_square / freedom);
  return result;
}

}  // namespace sweepfit
