// SPDX-License-Identifier: Apache-2.0
#include "capture/exposure.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace sweepfit {

Eigen::VectorXd SolveLogGains(
    const std::vector<std::vector<LogBrightness>>& places,
    int num_views,
    double sigma,
    double prior) {
  constexpr int kReweightings = 10;
  Eigen::VectorXd gain = Eigen::VectorXd::Zero(num_views);
  for (int iteration = 0; iteration < kReweightings; ++iteration) {
    Eigen::MatrixXd A =
        Eigen::MatrixXd::Identity(num_views, num_views) / (prior * prior);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(num_views);
    for (const std::vector<LogBrightness>& place : places) {
      for (std::size_t m = 0; m < place.size(); ++m) {
        for (std::size_t n = m + 1; n < place.size(); ++n) {
          const int i = place[m].view, j = place[n].view;
          const double difference = place[n].value - place[m].value;
          const double residual =
              std::abs(gain[i] - gain[j] - difference) / sigma;
          const double weight = place[m].weight * place[n].weight /
                                (sigma * sigma) / std::max(1.0, residual);
          A(i, i) += weight;
          A(j, j) += weight;
          A(i, j) -= weight;
          A(j, i) -= weight;
          b[i] += weight * difference;
          b[j] -= weight * difference;
        }
      }
    }
    gain = A.ldlt().solve(b);
  }
  return gain;
}

}  // namespace sweepfit
