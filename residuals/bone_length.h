// SPDX-License-Identifier: Apache-2.0
//
// Anthropometric: r = (l - (F + b (M - F)) H) / (sigma H0)
// Template ratio: r = (ln(l / H) - ln tau) / sigma
//
// l        bone length l_base exp(s), metres; s the parameter
// H        stature, metres (parameter); H0 a fixed value of it, so that a small
//          person does not buy slack
// b        sex blend, 0 female .. 1 male (parameter)
// M, F     mean share of stature
// tau      the template's l / H
#pragma once

#include <ceres/autodiff_cost_function.h>

#include <cmath>

#include "model/anthropometry.h"

namespace sweepfit {

// Parameters: log_length[12], person[2] = (stature, sex).
struct AnthropometricResidual {
  int group;
  double base_length;
  BoneStatistics statistics;
  double nominal_stature;

  template <typename T>
  bool operator()(const T* log_length, const T* person, T* residual) const {
    using std::exp;
    const T length = base_length * exp(log_length[group]);
    const T share = statistics.mean_female +
                    person[1] * (statistics.mean_male - statistics.mean_female);
    residual[0] =
        (length - share * person[0]) / (statistics.Sigma() * nominal_stature);
    return true;
  }

  static ceres::CostFunction* Create(int group,
                                     double base_length,
                                     const BoneStatistics& statistics,
                                     double nominal_stature) {
    return new ceres::AutoDiffCostFunction<AnthropometricResidual, 1, 12, 2>(
        new AnthropometricResidual{
            group, base_length, statistics, nominal_stature});
  }
};

struct TemplateRatioResidual {
  int group;
  double base_length;
  double template_ratio;
  double sigma;

  template <typename T>
  bool operator()(const T* log_length, const T* person, T* residual) const {
    using std::log;
    residual[0] = (log_length[group] + std::log(base_length) - log(person[0]) -
                   std::log(template_ratio)) /
                  sigma;
    return true;
  }

  static ceres::CostFunction* Create(int group,
                                     double base_length,
                                     double template_ratio,
                                     double sigma) {
    return new ceres::AutoDiffCostFunction<TemplateRatioResidual, 1, 12, 2>(
        new TemplateRatioResidual{group, base_length, template_ratio, sigma});
  }
};

}  // namespace sweepfit
