// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace sweepfit {

// What one view says of the brightness of a place.
struct LogBrightness {
  int view;
  double value;  // ln
  double weight = 1;
};

// What to add to the log brightnesses of every view so that views that see the
// same place agree: the a that minimise
//   sum w_i w_j rho((a_i + v_i - a_j - v_j) / sigma) + sum a_i^2 / prior^2
// over all pairs of views of all places, rho Huber's with threshold 1.
Eigen::VectorXd SolveLogGains(
    const std::vector<std::vector<LogBrightness>>& places,
    int num_views,
    double sigma,
    double prior);

}  // namespace sweepfit
