// SPDX-License-Identifier: Apache-2.0
#include "solver/person_problem.h"

#include <ceres/crs_matrix.h>
#include <ceres/manifold.h>
#include <glog/logging.h>

#include <Eigen/Cholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "residuals/bone_length.h"
#include "residuals/landmark.h"
#include "residuals/prior.h"

namespace sweepfit {
namespace {

// Share of a family's squared residuals that counts; a null loss is the plain
// square.
ceres::LossFunction* Weighted(ceres::LossFunction* loss, double weight) {
  return new ceres::ScaledLoss(loss, weight, ceres::TAKE_OWNERSHIP);
}

// The inverse of the sum of all families, with a tiny ridge.
Eigen::MatrixXd Covariance(const PersonProblem::Information& information) {
  Eigen::MatrixXd sum = information[0];
  for (int f = 1; f < kNumFamilies; ++f) sum += information[f];
  sum.diagonal().array() += 1e-9;
  return sum.ldlt().solve(Eigen::MatrixXd::Identity(sum.rows(), sum.cols()));
}

// Posterior against prior variance of a joint relative to its parent: 0 when
// the images add nothing, towards 1 when they decide.
double Reliability(const Eigen::MatrixXd& covariance,
                   const Eigen::Matrix3Xd& relative,
                   double prior_variance) {
  const double posterior =
      (relative * covariance * relative.transpose()).trace();
  return std::clamp(1 - posterior / prior_variance, 0.0, 1.0);
}

}  // namespace

PersonProblem::PersonProblem(const Skeleton& base,
                             const JointAngles* angles,
                             PersonParameters* parameters)
    : base_(base), angles_(angles), parameters_(parameters) {
  for (auto& pose : parameters_->pose) {
    CHECK_EQ(static_cast<int>(pose.size()), angles_->num_parameters());
    caches_.push_back(std::make_unique<KinematicCache>(base_, angles_));
    problem_.AddParameterBlock(pose.data(), angles_->num_parameters());
    for (size_t i = 0; i < angles_->angles().size(); ++i) {
      const JointAngle& angle = angles_->angles()[i];
      if (angle.kind != JointAngle::Kind::kHinge) continue;
      const int k = 3 + static_cast<int>(i);
      pose[k] = std::clamp(pose[k], angle.lower, angle.upper);
      problem_.SetParameterLowerBound(pose.data(), k, angle.lower);
      problem_.SetParameterUpperBound(pose.data(), k, angle.upper);
    }
  }
  problem_.AddParameterBlock(parameters_->log_length.data(), kNumLengthGroups);
  for (int g = 0; g < kNumLengthGroups; ++g) {
    free_lengths_.push_back(g);
    problem_.SetParameterLowerBound(parameters_->log_length.data(), g, -0.7);
    problem_.SetParameterUpperBound(parameters_->log_length.data(), g, 0.7);
  }
  problem_.AddParameterBlock(parameters_->person.data(), 2);
  problem_.SetParameterLowerBound(parameters_->person.data(), 0, 0.4);
  problem_.SetParameterUpperBound(parameters_->person.data(), 0, 2.6);
  problem_.SetParameterLowerBound(parameters_->person.data(), 1, 0);
  problem_.SetParameterUpperBound(parameters_->person.data(), 1, 1);
  if (!parameters_->girth.empty()) {
    problem_.AddParameterBlock(parameters_->girth.data(),
                               static_cast<int>(parameters_->girth.size()));
  }
}

void PersonProblem::Add(Family family,
                        ceres::CostFunction* cost,
                        double weight,
                        ceres::LossFunction* loss,
                        const std::vector<double*>& blocks) {
  if (weight <= 0) {
    delete cost;
    delete loss;
    return;
  }
  blocks_.push_back(
      {family,
       problem_.AddResidualBlock(cost, Weighted(loss, weight), blocks)});
}

void PersonProblem::AddLandmark(int pose,
                                int joint,
                                const Eigen::Vector3d& point_in_world,
                                const Eigen::Matrix3d& covariance,
                                double weight,
                                double loss_scale) {
  Add(Family::kLandmark,
      new LandmarkResidual(
          joint, point_in_world, covariance, caches_[pose].get()),
      weight,
      loss_scale > 0 ? new ceres::CauchyLoss(loss_scale) : nullptr,
      {parameters_->pose[pose].data(), parameters_->log_length.data()});
}

void PersonProblem::AddAnthropometric(const Anthropometry& tables,
                                      double weight) {
  for (int g = 0; g < kNumLengthGroups; ++g) {
    const int joint = LengthGroupJoint(g);
    Add(Family::kAnthropometric,
        AnthropometricResidual::Create(
            g, base_.length[joint], tables.bone[joint], parameters_->person[0]),
        weight,
        nullptr,
        {parameters_->log_length.data(), parameters_->person.data()});
  }
}

void PersonProblem::AddTemplateRatio(const Skeleton& skeleton,
                                     double stature,
                                     double sigma,
                                     double weight) {
  for (int g = 0; g < kNumLengthGroups; ++g) {
    const int joint = LengthGroupJoint(g);
    Add(Family::kTemplate,
        TemplateRatioResidual::Create(
            g, base_.length[joint], skeleton.length[joint] / stature, sigma),
        weight,
        nullptr,
        {parameters_->log_length.data(), parameters_->person.data()});
  }
}

void PersonProblem::AddPosePrior(double weight) {
  const int n = angles_->num_parameters();
  Eigen::VectorXd usual = Eigen::VectorXd::Zero(n);
  // The root may be anywhere: a prior of 100 m only keeps the normal equations
  // regular when a pose has no other residual.
  Eigen::VectorXd sigma = Eigen::VectorXd::Constant(n, 100.0);
  for (size_t i = 0; i < angles_->angles().size(); ++i) {
    usual[3 + i] = angles_->angles()[i].usual;
    sigma[3 + i] = angles_->angles()[i].sigma;
  }
  for (auto& pose : parameters_->pose) {
    Add(Family::kPose,
        new PriorResidual(usual, sigma),
        weight,
        nullptr,
        {pose.data()});
  }
}

void PersonProblem::AddPersonPrior(double stature,
                                   double stature_sigma,
                                   double weight) {
  Add(Family::kStature,
      new PriorResidual(Eigen::Vector2d(stature, 0.5),
                        Eigen::Vector2d(stature_sigma, 0.5)),
      weight,
      nullptr,
      {parameters_->person.data()});
}

void PersonProblem::AddGirthPrior(const std::vector<double>& sigma,
                                  double weight) {
  const auto n = static_cast<Eigen::Index>(parameters_->girth.size());
  if (n == 0) return;
  Add(Family::kGirth,
      new PriorResidual(Eigen::VectorXd::Zero(n),
                        Eigen::Map<const Eigen::VectorXd>(sigma.data(), n)),
      weight,
      nullptr,
      {parameters_->girth.data()});
}

void PersonProblem::HoldLengths(bool ends_free) {
  problem_.SetParameterBlockConstant(parameters_->person.data());
  free_lengths_.clear();
  if (!ends_free) {
    problem_.SetParameterBlockConstant(parameters_->log_length.data());
    return;
  }
  std::vector<int> held;
  for (int g = 0; g < kNumLengthGroups; ++g) {
    const int joint = LengthGroupJoint(g);
    const bool is_end =
        joint == kHeadEnd || joint == kLHandEnd || joint == kLFootEnd;
    (is_end ? free_lengths_ : held).push_back(g);
  }
  problem_.SetManifold(parameters_->log_length.data(),
                       new ceres::SubsetManifold(kNumLengthGroups, held));
}

std::vector<double*> PersonProblem::FreeBlocks() const {
  std::vector<double*> blocks;
  for (auto& pose : parameters_->pose) blocks.push_back(pose.data());
  blocks.push_back(parameters_->log_length.data());
  blocks.push_back(parameters_->person.data());
  if (!parameters_->girth.empty()) blocks.push_back(parameters_->girth.data());
  std::erase_if(blocks, [this](const double* block) {
    return problem_.IsParameterBlockConstant(block);
  });
  return blocks;
}

int PersonProblem::num_unknowns() const {
  int count = 0;
  for (const double* block : FreeBlocks()) {
    count += problem_.ParameterBlockTangentSize(block);
  }
  return count;
}

double PersonProblem::Cost(int family) const {
  ceres::Problem::EvaluateOptions options;
  for (const Block& block : blocks_) {
    if (static_cast<int>(block.family) == family) {
      options.residual_blocks.push_back(block.id);
    }
  }
  if (options.residual_blocks.empty()) return 0;
  double cost = 0;
  problem_.Evaluate(options, &cost, nullptr, nullptr, nullptr);
  return cost;
}

PersonProblem::Information PersonProblem::InformationByFamily() const {
  const int n = num_unknowns();
  Information information;
  for (int f = 0; f < kNumFamilies; ++f) {
    information[f] = Eigen::MatrixXd::Zero(n, n);
    ceres::Problem::EvaluateOptions options;
    options.parameter_blocks = FreeBlocks();
    for (const Block& block : blocks_) {
      if (static_cast<int>(block.family) == f) {
        options.residual_blocks.push_back(block.id);
      }
    }
    if (options.residual_blocks.empty()) continue;
    ceres::CRSMatrix crs;
    // A problem that failed may hold residuals that cannot be evaluated.
    if (!problem_.Evaluate(options, nullptr, nullptr, nullptr, &crs)) continue;
    // Nearly every residual is one of all the unknowns.
    const Eigen::MatrixXd jacobian =
        Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
            crs.num_rows,
            crs.num_cols,
            static_cast<Eigen::Index>(crs.values.size()),
            crs.rows.data(),
            crs.cols.data(),
            crs.values.data());
    information[f] = jacobian.transpose() * jacobian;
  }
  return information;
}

Eigen::Matrix3Xd PersonProblem::JointDerivative(int pose, int joint) const {
  const auto& entry = caches_[pose]->At(parameters_->pose[pose].data(),
                                        parameters_->log_length.data());
  const PointDerivative x = EvaluatePoint(
      JointAsPoint(joint), entry.state, *angles_, entry.length_change, true);
  Eigen::Matrix3Xd by_group = Eigen::Matrix3Xd::Zero(3, kNumLengthGroups);
  for (int j = 1; j < kNumJoints; ++j) {
    by_group.col(LengthGroup(j)) += x.by_length.col(j) * entry.length[j];
  }
  Eigen::Matrix3Xd result = Eigen::Matrix3Xd::Zero(3, num_unknowns());
  const int per_pose = angles_->num_parameters();
  result.middleCols(pose * per_pose, per_pose) = x.by_pose;
  int column = static_cast<int>(parameters_->pose.size()) * per_pose;
  for (const int g : free_lengths_) result.col(column++) = by_group.col(g);
  return result;
}

Skeleton PersonProblem::CurrentSkeleton() const {
  Skeleton skeleton = base_;
  for (int j = 1; j < kNumJoints; ++j) {
    skeleton.length[j] *= std::exp(parameters_->log_length[LengthGroup(j)]);
  }
  return skeleton;
}

void PersonProblem::NoteStart() {
  cost_at_start_.emplace();
  for (int f = 0; f < kNumFamilies; ++f) (*cost_at_start_)[f] = Cost(f);
}

bool PersonProblem::Solve(int max_iterations) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.dense_linear_algebra_library_type = ceres::EIGEN;
  options.num_threads = 1;
  options.max_num_iterations = max_iterations;
  // With bounds Ceres would search along every step that it has already taken
  // and found good: a fifth of the time, for the same solution.
  options.max_num_line_search_step_size_iterations = 0;
  options.function_tolerance = 1e-4;
  options.logging_type = ceres::SILENT;
  ceres::Solve(options, &problem_, &summary_);
  return summary_.IsSolutionUsable();
}

nlohmann::ordered_json PersonProblem::Report() const {
  CHECK(cost_at_start_.has_value()) << "NoteStart before Solve";
  nlohmann::ordered_json report;
  report["iterations"] = static_cast<int>(summary_.iterations.size()) - 1;
  report["termination"] =
      ceres::TerminationTypeToString(summary_.termination_type);
  report["residuals"] = summary_.num_residuals;
  report["parameters"] = num_unknowns();
  const Information information = InformationByFamily();
  const Eigen::MatrixXd covariance = Covariance(information);
  for (int f = 0; f < kNumFamilies; ++f) {
    auto& entry = report["families"][kFamilyNames[f]];
    entry["cost_start"] = (*cost_at_start_)[f];
    entry["cost_end"] = Cost(f);
    entry["effective_parameters"] =
        covariance.cwiseProduct(information[f]).sum();
  }
  return report;
}

// The landmarks of root and hips err together, as rigs place all of them
// farther back or lower: the solution, which takes their errors for
// independent, would know the root too well. Metres, per axis; with it the root
// of 8 captures of one family of rigs has a chi-square of 1.65 per degree of
// freedom (2.5 without), that of 18 of another 1.2 (1.8).
constexpr double kRootConvention = 0.007;

void FillJointResult(const PersonProblem& problem,
                     const JointAngles& angles,
                     const PersonParameters& parameters,
                     bool with_covariance,
                     JointResult* result) {
  const Anthropometry& tables = Anthropometry::Default();
  result->skeleton = problem.CurrentSkeleton();
  result->stature = parameters.person[0];
  result->sex = parameters.person[1];
  result->coordinates = parameters.pose;
  result->log_length = parameters.log_length;
  result->poses.resize(parameters.pose.size());
  for (size_t p = 0; p < parameters.pose.size(); ++p) {
    JointEstimate& estimate = result->poses[p];
    estimate.pose = angles.ToPose(parameters.pose[p].data());
    estimate.frames = ForwardKinematics(result->skeleton, estimate.pose);
  }
  if (!with_covariance) return;
  const PersonProblem::Information information = problem.InformationByFamily();
  const Eigen::MatrixXd covariance = Covariance(information);
  for (size_t p = 0; p < parameters.pose.size(); ++p) {
    JointEstimate& estimate = result->poses[p];
    for (int j = 0; j < kNumJoints; ++j) {
      const Eigen::Matrix3Xd by =
          problem.JointDerivative(static_cast<int>(p), j);
      estimate.covariance[j] = by * covariance * by.transpose();
      if (j == kRoot) {
        estimate.covariance[j].diagonal().array() +=
            kRootConvention * kRootConvention;
      }
      // The posterior is C = C (sum of H_f) C: each family's part of it.
      const Eigen::Matrix3Xd moved = by * covariance;
      std::array<double, kNumFamilies> part{};
      double whole = 0;
      for (int f = 0; f < kNumFamilies; ++f) {
        part[f] = (moved * information[f]).cwiseProduct(moved).sum();
        whole += part[f];
      }
      for (int f = 0; f < kNumFamilies; ++f) {
        if (part[f] > 0)
          estimate.evidence[j][kFamilyNames[f]] = part[f] / whole;
      }
      if (j == 0) continue;
      const Eigen::Matrix3Xd relative =
          by - problem.JointDerivative(static_cast<int>(p), kJointParents[j]);
      // Without images: the tables' length, and a direction that is off by
      // about 20 degrees.
      const double along = tables.bone[j].Sigma() * result->stature;
      const double across = 0.35 * result->skeleton.length[j];
      estimate.reliability[j] = Reliability(
          covariance, relative, along * along + 2 * across * across);
    }
  }
}

}  // namespace sweepfit
