// SPDX-License-Identifier: Apache-2.0
#include "solver/person_problem.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/test_person.h"

namespace sweepfit {
namespace {

// A person in one pose with priors, tables and two landmarks; families such as
// the outlines' have no residuals.
class PriorsAndLandmarks : public ::testing::Test {
 protected:
  PriorsAndLandmarks() : base_(TestSkeleton()), angles_(base_) {
    parameters_.pose = {std::vector<double>(angles_.num_parameters(), 0.0)};
    problem_ = std::make_unique<PersonProblem>(base_, &angles_, &parameters_);
    for (const int joint : {kLWrist, kRWrist}) {
      problem_->AddLandmark(
          0, joint, {0, 1, 0}, 1e-4 * Eigen::Matrix3d::Identity(), 1, 0);
    }
    problem_->AddAnthropometric(Anthropometry::Default(), 1);
    problem_->AddPosePrior(1);
    problem_->AddPersonPrior(1.7, 0.02, 1);
  }

  // The families decide all unknowns and nothing else.
  void ExpectUnknowns(int expected) {
    const auto report = problem_->Report();
    EXPECT_EQ(report["parameters"].get<int>(), expected);
    double sum = 0;
    for (const auto& family : report["families"]) {
      sum += family["effective_parameters"].get<double>();
    }
    // The ridge of the covariance takes a little of what is hardly known.
    EXPECT_NEAR(sum, expected, 1e-3);
    for (const Eigen::MatrixXd& information : problem_->InformationByFamily()) {
      EXPECT_EQ(information.rows(), expected);
      EXPECT_EQ(information.cols(), expected);
    }
    EXPECT_EQ(problem_->JointDerivative(0, kLWrist).cols(), expected);
  }

  Skeleton base_;
  JointAngles angles_;
  PersonParameters parameters_;
  std::unique_ptr<PersonProblem> problem_;
};

TEST_F(PriorsAndLandmarks, DecideAllUnknowns) {
  problem_->NoteStart();
  EXPECT_TRUE(problem_->Solve(10));
  ExpectUnknowns(angles_.num_parameters() + kNumLengthGroups + 2);
}

TEST_F(PriorsAndLandmarks, DecideTheEndBonesWhenTheOthersAreHeld) {
  problem_->HoldLengths(true);
  problem_->NoteStart();
  EXPECT_TRUE(problem_->Solve(10));
  ExpectUnknowns(angles_.num_parameters() + 3);
  // The crown moves with the length of its own bone; the wrist is held.
  EXPECT_GT(problem_->JointDerivative(0, kHeadEnd).rightCols(3).norm(), 0.01);
  EXPECT_EQ(problem_->JointDerivative(0, kLWrist).rightCols(3).norm(), 0);
}

TEST_F(PriorsAndLandmarks, DecideThePoseAloneWhenAllLengthsAreHeld) {
  problem_->HoldLengths(false);
  problem_->NoteStart();
  EXPECT_TRUE(problem_->Solve(10));
  ExpectUnknowns(angles_.num_parameters());
}

}  // namespace
}  // namespace sweepfit
