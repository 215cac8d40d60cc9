// SPDX-License-Identifier: Apache-2.0
#include "model/simplex.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <random>

namespace sweepfit {
namespace {

constexpr double kRidge = 0.05;

struct Problem {
  int n = 0;
  SimplexMatrix A{};
  SimplexVector b{};
};

// A is a Gram matrix of fewer rows than columns: only the ridge makes it
// definite.
Problem RandomProblem(int n, unsigned seed) {
  std::mt19937 generator(seed);
  const auto uniform = [&generator] {
    return generator() / 4294967296.0 * 2 - 1;
  };
  Problem problem;
  problem.n = n;
  const int rows = std::max(1, n / 2);
  Eigen::MatrixXd factor(rows, n);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < n; ++c) factor(r, c) = uniform();
  }
  for (int r = 0; r < n; ++r) {
    for (int c = 0; c < n; ++c) {
      problem.A[r][c] = factor.col(r).dot(factor.col(c));
    }
    problem.b[r] = 0.3 * uniform();
  }
  return problem;
}

double Cost(const Problem& problem, const SimplexVector& w) {
  double cost = 0;
  for (int r = 0; r < problem.n; ++r) {
    cost += w[r] * (0.5 * kRidge * w[r] - problem.b[r]);
    for (int c = 0; c < problem.n; ++c) {
      cost += 0.5 * w[r] * problem.A[r][c] * w[c];
    }
  }
  return cost;
}

SimplexSet All() {
  SimplexSet all;
  all.fill(true);
  return all;
}

// The least cost over all choices of entries that are not zero.
double LeastCost(const Problem& problem, const SimplexSet& allowed) {
  double least = std::numeric_limits<double>::infinity();
  for (int set = 1; set < 1 << problem.n; ++set) {
    std::vector<int> index;
    bool is_allowed = true;
    for (int i = 0; i < problem.n; ++i) {
      if ((set >> i & 1) == 0) continue;
      is_allowed = is_allowed && allowed[i];
      index.push_back(i);
    }
    if (!is_allowed) continue;
    const int m = static_cast<int>(index.size());
    Eigen::MatrixXd kkt = Eigen::MatrixXd::Zero(m + 1, m + 1);
    Eigen::VectorXd rhs = Eigen::VectorXd::Ones(m + 1);
    for (int r = 0; r < m; ++r) {
      for (int c = 0; c < m; ++c) kkt(r, c) = problem.A[index[r]][index[c]];
      kkt(r, r) += kRidge;
      kkt(r, m) = kkt(m, r) = 1;
      rhs[r] = problem.b[index[r]];
    }
    const Eigen::VectorXd solution = kkt.fullPivLu().solve(rhs);
    if (solution.head(m).minCoeff() < 0) continue;
    SimplexVector w{};
    for (int r = 0; r < m; ++r) w[index[r]] = solution[r];
    least = std::min(least, Cost(problem, w));
  }
  return least;
}

void ExpectOnSimplex(const SimplexVector& w, const SimplexSet& allowed, int n) {
  double sum = 0;
  for (int i = 0; i < kMaxSimplexSize; ++i) {
    EXPECT_GE(w[i], 0);
    if (i >= n || !allowed[i]) {
      EXPECT_EQ(w[i], 0) << i;
    }
    sum += w[i];
  }
  EXPECT_NEAR(sum, 1, 1e-12);
}

TEST(SolveOnSimplex, FindsTheLeastCost) {
  int at_bound = 0;
  for (int n = 1; n <= 7; ++n) {
    for (unsigned seed = 0; seed < 20; ++seed) {
      const Problem problem = RandomProblem(n, seed);
      SimplexVector w{};
      const double cost =
          SolveOnSimplex(problem.A, kRidge, problem.b, n, All(), &w);
      ExpectOnSimplex(w, All(), n);
      EXPECT_NEAR(cost, Cost(problem, w), 1e-12);
      EXPECT_NEAR(cost, LeastCost(problem, All()), 1e-10) << n << " " << seed;
      for (int i = 0; i < n; ++i) at_bound += w[i] == 0;
    }
  }
  EXPECT_GT(at_bound, 100);
}

TEST(SolveOnSimplex, DoesNotDependOnTheStart) {
  const Problem problem = RandomProblem(12, 3);
  SimplexVector from_all{};
  SolveOnSimplex(problem.A, kRidge, problem.b, 12, All(), &from_all);
  for (int corner = 0; corner < 12; ++corner) {
    SimplexVector w{};
    w[corner] = 5;
    SolveOnSimplex(problem.A, kRidge, problem.b, 12, All(), &w);
    for (int i = 0; i < 12; ++i) EXPECT_NEAR(w[i], from_all[i], 1e-7) << corner;
  }
}

TEST(SolveOnSimplex, UsesAllowedEntriesOnly) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Problem problem = RandomProblem(6, seed);
    SimplexSet allowed{};
    allowed[1] = allowed[2] = allowed[5] = true;
    SimplexVector w{1, 0, 0, 0, 0, 0};  // nothing where it may be
    const double cost =
        SolveOnSimplex(problem.A, kRidge, problem.b, 6, allowed, &w);
    ExpectOnSimplex(w, allowed, 6);
    EXPECT_NEAR(cost, LeastCost(problem, allowed), 1e-10) << seed;
  }
}

}  // namespace
}  // namespace sweepfit
