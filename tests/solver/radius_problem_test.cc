// SPDX-License-Identifier: Apache-2.0
#include "solver/radius_problem.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <nlohmann/json.hpp>

#include "model/template.h"
#include "residuals/prior.h"

namespace sweepfit {
namespace {

// A prior of one sigma on every row.
void AddPriors(const Body& body,
               RadiusFamily family,
               double sigma,
               RadiusProblem* problem) {
  for (size_t s = 0; s < body.sweeps.size(); ++s) {
    const Sweep& sweep = body.sweeps[s];
    const int n = sweep.num_columns();
    for (int r = 0; r < sweep.num_rows(); ++r) {
      problem->Add(family,
                   new PriorResidual(Eigen::VectorXd::Zero(n),
                                     Eigen::VectorXd::Constant(n, sigma)),
                   nullptr,
                   {problem->Row(static_cast<int>(s), r)});
    }
  }
}

double Share(const SectionEvidence& section, RadiusFamily family) {
  return section.share[static_cast<int>(family)];
}

TEST(RadiusProblem, SigmaIsThatOfTheMeanRadius) {
  const Body body = BuildTemplate({});
  RadiusProblem problem(body);
  AddPriors(body, RadiusFamily::kTemplate, 0.2, &problem);
  const auto sections = problem.Evidence(body);
  ASSERT_EQ(sections.size(), body.sweeps.size());
  for (size_t s = 0; s < sections.size(); ++s) {
    const Sweep& sweep = body.sweeps[s];
    ASSERT_EQ(sections[s].size(), static_cast<size_t>(sweep.num_rows()));
    for (int r = 0; r < sweep.num_rows(); ++r) {
      // Independent log ratios: the sigma of a mean of n radii.
      const double expected =
          0.2 * sweep.radius.row(r).norm() / sweep.num_columns();
      EXPECT_NEAR(sections[s][r].sigma, expected, 1e-9);
      EXPECT_NEAR(Share(sections[s][r], RadiusFamily::kTemplate), 1, 1e-12);
    }
  }
}

TEST(RadiusProblem, SharesAreThoseOfTheInformation) {
  const Body body = BuildTemplate({});
  RadiusProblem problem(body);
  AddPriors(body, RadiusFamily::kTemplate, 0.2, &problem);
  AddPriors(body, RadiusFamily::kSmoothness, 0.2, &problem);
  // One row has a measurement as strong as six of the priors.
  const Sweep& sweep = body.sweeps[1];
  const int n = sweep.num_columns();
  problem.Add(
      RadiusFamily::kPhoto,
      new PriorResidual(Eigen::VectorXd::Zero(n),
                        Eigen::VectorXd::Constant(n, 0.2 / std::sqrt(6.0))),
      nullptr,
      {problem.Row(1, 3)});
  const auto sections = problem.Evidence(body);
  EXPECT_NEAR(Share(sections[1][3], RadiusFamily::kPhoto), 0.75, 1e-9);
  EXPECT_NEAR(Share(sections[1][3], RadiusFamily::kTemplate), 0.125, 1e-9);
  EXPECT_NEAR(Share(sections[1][2], RadiusFamily::kPhoto), 0, 1e-12);
  EXPECT_NEAR(Share(sections[1][2], RadiusFamily::kTemplate), 0.5, 1e-9);
  EXPECT_NEAR(sections[1][3].sigma,
              0.2 / std::sqrt(8.0) * sweep.radius.row(3).norm() / n,
              1e-9);
}

TEST(RadiusProblem, SolvesAndStores) {
  Body body = BuildTemplate({});
  RadiusProblem problem(body);
  AddPriors(body, RadiusFamily::kTemplate, 0.2, &problem);
  const int n = body.sweeps[0].num_columns();
  problem.Add(RadiusFamily::kPhoto,
              new PriorResidual(Eigen::VectorXd::Constant(n, 0.3),
                                Eigen::VectorXd::Constant(n, 0.1)),
              nullptr,
              {problem.Row(0, 2)});
  EXPECT_TRUE(problem.Solve(6)["usable"].get<bool>());
  problem.Store(&body);
  // 0.3 with four fifths of the information, but for the solver's damping.
  EXPECT_NEAR(body.sweeps[0].log_ratio(2, 5), 0.24, 1e-4);
  EXPECT_NEAR(body.sweeps[0].log_ratio(3, 5), 0, 1e-9);
  EXPECT_NEAR(SectionsToJson(body, problem.Evidence(body))["trunk"]["photo"][2]
                  .get<double>(),
              0.8,
              1e-3);
}

}  // namespace
}  // namespace sweepfit
