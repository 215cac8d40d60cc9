// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <array>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "model/anthropometry.h"
#include "model/joint_angles.h"
#include "residuals/kinematic_cache.h"
#include "residuals/pose_point_cost.h"
#include "solver/joints.h"
#include "solver/landmarks.h"

namespace sweepfit {

// The unknowns of one person in one or more poses.
struct PersonParameters {
  std::vector<std::vector<double>> pose;  // per pose, see JointAngles
  std::array<double, kNumLengthGroups> log_length{};  // against a base skeleton
  std::array<double, 2> person{1.7, 0.5};             // stature (m), sex
  std::vector<double> girth;  // coarse girths, log ratios; may be empty
};

// Families of residuals, as they are weighted and reported.
enum class Family {
  kLandmark,
  kTemplate,
  kAnthropometric,
  kStature,
  kPose,
  kSilhouette,
  kPhoto,
  kHull,
  kGirth
};
inline constexpr int kNumFamilies = 9;
inline constexpr std::array<const char*, kNumFamilies> kFamilyNames = {
    "landmark",
    "template",
    "anthropometric",
    "stature",
    "pose",
    "silhouette",
    "photo",
    "hull",
    "girth"};

// Assembles and solves one least-squares problem over PersonParameters. Weights
// multiply squared residuals; a weight of 0 leaves the family out.
class PersonProblem {
 public:
  PersonProblem(const Skeleton& base,
                const JointAngles* angles,
                PersonParameters* parameters);

  void AddLandmark(int pose,
                   int joint,
                   const Eigen::Vector3d& point_in_world,
                   const Eigen::Matrix3d& covariance,
                   double weight,
                   double loss_scale);
  void AddAnthropometric(const Anthropometry& tables, double weight);
  void AddTemplateRatio(const Skeleton& skeleton,
                        double stature,
                        double sigma,
                        double weight);
  void AddPosePrior(double weight);
  void AddPersonPrior(double stature, double stature_sigma, double weight);
  void AddGirthPrior(const std::vector<double>& sigma, double weight);

  template <typename Measurement>
  void AddPoint(Family family,
                int pose,
                Measurement measurement,
                std::shared_ptr<const ShapedPoint> point,
                double weight,
                ceres::LossFunction* loss) {
    std::vector<double*> blocks = {parameters_->pose[pose].data(),
                                   parameters_->log_length.data()};
    if (!parameters_->girth.empty())
      blocks.push_back(parameters_->girth.data());
    Add(family,
        new PosePointCost<Measurement>(
            std::move(measurement),
            std::move(point),
            caches_[pose].get(),
            static_cast<int>(parameters_->girth.size())),
        weight,
        loss,
        blocks);
  }

  // Keeps bone lengths where they are, but for those of the end bones (crown,
  // fingers, toes) when `ends_free`, and stature and sex.
  void HoldLengths(bool ends_free);

  // Solves on one thread with dense Cholesky (EIGEN), so that results repeat.
  // False when no usable solution was found.
  bool Solve(int max_iterations);

  // Notes the costs before Solve, which Report tells; that costs.
  void NoteStart();
  // Iterations and termination of the last Solve, and per family its cost
  // before and after, and its effective parameters trace((J^T J)^-1 J_f^T J_f):
  // how many of the unknowns the family decides; over all families they sum to
  // the number of unknowns.
  nlohmann::ordered_json Report() const;

  // J^T J of each family at the solution, over the unknowns: poses, lengths,
  // person, girth, without what is held.
  using Information = std::array<Eigen::MatrixXd, kNumFamilies>;
  Information InformationByFamily() const;
  // 3 x (number of unknowns) derivative of a joint in the same order.
  Eigen::Matrix3Xd JointDerivative(int pose, int joint) const;

  int num_unknowns() const;
  Skeleton CurrentSkeleton() const;

 private:
  struct Block {
    Family family;
    ceres::ResidualBlockId id;
  };
  void Add(Family family,
           ceres::CostFunction* cost,
           double weight,
           ceres::LossFunction* loss,
           const std::vector<double*>& blocks);
  std::vector<double*> FreeBlocks() const;
  double Cost(int family) const;

  Skeleton base_;
  const JointAngles* angles_;
  PersonParameters* parameters_;
  std::vector<int> free_lengths_;  // groups that are not held, in order
  std::vector<std::unique_ptr<KinematicCache>> caches_;
  mutable ceres::Problem problem_;
  std::vector<Block> blocks_;
  ceres::Solver::Summary summary_;
  std::optional<std::array<double, kNumFamilies>> cost_at_start_;
};

// Copies the solution into `result`; covariances and reliabilities only when
// asked for.
void FillJointResult(const PersonProblem& problem,
                     const JointAngles& angles,
                     const PersonParameters& parameters,
                     bool with_covariance,
                     JointResult* result);

}  // namespace sweepfit
