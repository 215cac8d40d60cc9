// SPDX-License-Identifier: Apache-2.0
#include "solver/radius_problem.h"

#include <ceres/crs_matrix.h>
#include <ceres/solver.h>
#include <glog/logging.h>
#include <tbb/parallel_for.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace sweepfit {
namespace {

using SparseRows = Eigen::SparseMatrix<double, Eigen::RowMajor>;

// Ceres stores whole blocks, of which most entries are zero.
SparseRows WithoutZeros(const ceres::CRSMatrix& crs) {
  SparseRows matrix(crs.num_rows, crs.num_cols);
  std::vector<int> counts(crs.num_rows);
  for (int row = 0; row < crs.num_rows; ++row) {
    for (int i = crs.rows[row]; i < crs.rows[row + 1]; ++i) {
      counts[row] += crs.values[i] != 0;
    }
  }
  matrix.reserve(counts);
  for (int row = 0; row < crs.num_rows; ++row) {
    for (int i = crs.rows[row]; i < crs.rows[row + 1]; ++i) {
      if (crs.values[i] != 0) matrix.insert(row, crs.cols[i]) = crs.values[i];
    }
  }
  matrix.makeCompressed();
  return matrix;
}

}  // namespace

RadiusProblem::RadiusProblem(const Body& body) : rows_(body.sweeps.size()) {
  for (size_t s = 0; s < body.sweeps.size(); ++s) {
    const Sweep& sweep = body.sweeps[s];
    rows_[s].resize(sweep.num_rows());
    for (int r = 0; r < sweep.num_rows(); ++r) {
      for (int c = 0; c < sweep.num_columns(); ++c) {
        rows_[s][r].push_back(sweep.log_ratio(r, c));
      }
    }
  }
}

void RadiusProblem::Add(RadiusFamily family,
                        ceres::CostFunction* cost,
                        ceres::LossFunction* loss,
                        const std::vector<double*>& rows) {
  blocks_[static_cast<int>(family)].push_back(
      problem_.AddResidualBlock(cost, loss, rows));
}

nlohmann::ordered_json RadiusProblem::Solve(int max_iterations) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  solver.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  solver.num_threads = 1;
  // A point hangs on four samples of each of four rows: the products of whole
  // rows, of which most entries are zero, would take most of the time.
  solver.dynamic_sparsity = true;
  solver.max_num_iterations = max_iterations;
  solver.function_tolerance = 5e-4;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem_, &summary);
  nlohmann::ordered_json report;
  report["iterations"] = static_cast<int>(summary.iterations.size()) - 1;
  report["termination"] =
      ceres::TerminationTypeToString(summary.termination_type);
  report["usable"] = summary.IsSolutionUsable();
  report["residuals"] = summary.num_residuals;
  report["parameters"] = summary.num_parameters;
  report["cost_start"] = summary.initial_cost;
  report["cost_end"] = summary.final_cost;
  return report;
}

void RadiusProblem::Store(Body* body) const {
  for (size_t s = 0; s < rows_.size(); ++s) {
    for (size_t r = 0; r < rows_[s].size(); ++r) {
      for (size_t c = 0; c < rows_[s][r].size(); ++c) {
        body->sweeps[s].log_ratio(r, c) =
            std::clamp(rows_[s][r][c], -kLargestLogRatio, kLargestLogRatio);
      }
    }
  }
}

std::vector<std::vector<SectionEvidence>> RadiusProblem::Evidence(
    const Body& body) {
  // Residuals in the order of their families, unknowns in that of the rows.
  ceres::Problem::EvaluateOptions options;
  std::array<int, kNumRadiusFamilies + 1> first{};
  for (int f = 0; f < kNumRadiusFamilies; ++f) {
    first[f + 1] = first[f];
    for (const ceres::ResidualBlockId id : blocks_[f]) {
      options.residual_blocks.push_back(id);
      first[f + 1] +=
          problem_.GetCostFunctionForResidualBlock(id)->num_residuals();
    }
  }
  struct Section {
    int sweep, row, first_unknown;
  };
  std::vector<Section> sections;
  int num_unknowns = 0;
  std::vector<std::vector<SectionEvidence>> evidence(rows_.size());
  for (size_t s = 0; s < rows_.size(); ++s) {
    evidence[s].resize(rows_[s].size());
    for (size_t r = 0; r < rows_[s].size(); ++r) {
      options.parameter_blocks.push_back(rows_[s][r].data());
      sections.push_back(
          {static_cast<int>(s), static_cast<int>(r), num_unknowns});
      num_unknowns += static_cast<int>(rows_[s][r].size());
    }
  }
  ceres::CRSMatrix crs;
  CHECK(problem_.Evaluate(options, nullptr, nullptr, nullptr, &crs));
  const SparseRows jacobian = WithoutZeros(crs);
  const Eigen::SparseMatrix<double> information =
      Eigen::SparseMatrix<double>(jacobian.transpose()) *
      Eigen::SparseMatrix<double>(jacobian);
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(information);
  CHECK(solver.info() == Eigen::Success) << "a row without residuals";

  tbb::parallel_for(size_t{0}, sections.size(), [&](size_t i) {
    const auto [s, r, first_unknown] = sections[i];
    const Sweep& sweep = body.sweeps[s];
    const int columns = sweep.num_columns();
    Eigen::VectorXd by_unknown = Eigen::VectorXd::Zero(num_unknowns);
    for (int c = 0; c < columns; ++c) {
      by_unknown[first_unknown + c] =
          sweep.radius(r, c) * std::exp(rows_[s][r][c]) / columns;
    }
    const Eigen::VectorXd w = solver.solve(by_unknown);
    const Eigen::VectorXd moved = jacobian * w;
    SectionEvidence& section = evidence[s][r];
    const double variance = moved.squaredNorm();
    section.sigma = std::sqrt(variance);
    for (int f = 0; f < kNumRadiusFamilies; ++f) {
      section.share[f] =
          moved.segment(first[f], first[f + 1] - first[f]).squaredNorm() /
          variance;
    }
  });
  return evidence;
}

nlohmann::ordered_json SectionsToJson(
    const Body& body,
    const std::vector<std::vector<SectionEvidence>>& sections) {
  const auto rounded = [](double value, double units) {
    return std::round(value * units) / units;
  };
  nlohmann::ordered_json json;
  for (size_t s = 0; s < sections.size(); ++s) {
    const Sweep& sweep = body.sweeps[s];
    auto& of_sweep = json[sweep.name];
    for (int r = 0; r < sweep.num_rows(); ++r) {
      const SectionEvidence& section = sections[s][r];
      const double mean =
          (sweep.radius.row(r).array() * sweep.log_ratio.row(r).array().exp())
              .mean();
      of_sweep["u"].push_back(sweep.key_u[r]);
      of_sweep["radius"].push_back(rounded(mean, 1e5));
      of_sweep["sigma"].push_back(rounded(section.sigma, 1e6));
      for (int f = 0; f < kNumRadiusFamilies; ++f) {
        of_sweep[kRadiusFamilyNames[f]].push_back(
            rounded(section.share[f], 1e3));
      }
    }
  }
  return json;
}

}  // namespace sweepfit
