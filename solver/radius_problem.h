// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/problem.h>

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "model/body.h"

namespace sweepfit {

// Radii may not leave the template by more than a factor of e^0.9.
inline constexpr double kLargestLogRatio = 0.9;

// Families of residuals of the radius functions, as they are reported.
enum class RadiusFamily {
  kSilhouette,
  kPhoto,
  kHull,
  kSymmetry,
  kSmoothness,
  kTemplate
};
inline constexpr int kNumRadiusFamilies = 6;
inline constexpr std::array<const char*, kNumRadiusFamilies>
    kRadiusFamilyNames = {
        "silhouette", "photo", "hull", "symmetry", "smoothness", "template"};

// How well the mean radius of one cross-section is known, and by what.
struct SectionEvidence {
  // Standard deviation, metres, were all measurements independent. Neighbours
  // on an outline are not: compare sections with each other.
  double sigma = 0;
  // What part of what is known each family brings; they sum to 1.
  std::array<double, kNumRadiusFamilies> share{};
};

// A least-squares problem whose unknowns are the log ratios of a body's radius
// functions, one parameter block per key row.
class RadiusProblem {
 public:
  explicit RadiusProblem(const Body& body);
  // Ceres keeps pointers to the rows.
  RadiusProblem(const RadiusProblem&) = delete;
  RadiusProblem& operator=(const RadiusProblem&) = delete;

  // The log ratios of one key row, all columns.
  double* Row(int sweep, int row) { return rows_[sweep][row].data(); }

  // `loss` may be null; the problem owns it and `cost`.
  void Add(RadiusFamily family,
           ceres::CostFunction* cost,
           ceres::LossFunction* loss,
           const std::vector<double*>& rows);

  // Solves on one thread with sparse Cholesky (EIGEN_SPARSE), so that results
  // repeat. Returns how it went.
  nlohmann::ordered_json Solve(int max_iterations);

  // Copies the log ratios to the body, within kLargestLogRatio.
  void Store(Body* body) const;

  // Per sweep and key row, linearised at the present rows. With w = H^-1 a, H =
  // J^T J and a the derivative of the mean radius by the unknowns, the variance
  // is a^T w and a family's share of it |J_f w|^2 / a^T w. All rows must have
  // residuals that determine them.
  std::vector<std::vector<SectionEvidence>> Evidence(const Body& body);

 private:
  std::vector<std::vector<std::vector<double>>> rows_;  // sweep, row, column
  ceres::Problem problem_;
  std::array<std::vector<ceres::ResidualBlockId>, kNumRadiusFamilies> blocks_;
};

// One object per sweep: its key rows, lists of equal length of u, mean radius
// and sigma (metres), and the share of each family.
nlohmann::ordered_json SectionsToJson(
    const Body& body,
    const std::vector<std::vector<SectionEvidence>>& sections);

}  // namespace sweepfit
