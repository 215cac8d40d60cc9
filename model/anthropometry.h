// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>

#include "model/skeleton.h"

namespace sweepfit {

// Statistics of one bone as a fraction of stature.
struct BoneStatistics {
  double mean_male = 0;
  double mean_female = 0;
  // Spread in the population, and how far the table's joint centres may lie
  // from those of the reader (rigs are not anatomy).
  double sigma_population = 0;
  double sigma_systematic = 0;

  double Mean(double sex) const {
    return mean_female + sex * (mean_male - mean_female);
  }
  double Sigma() const;  // both, in quadrature
};

// ln girth[mm] = a + b ln(mass/kg) + c ln(stature/m), residual sigma in ln.
struct GirthRegression {
  double a_male, b_male, c_male, sigma_male;
  double a_female, b_female, c_female, sigma_female;
  double Girth(double sex, double mass, double stature) const;  // metres
};

// Tables of body proportions. Sources are named in the data file
// (model/data/anthropometry.yaml). Left and right share an entry.
struct Anthropometry {
  std::array<BoneStatistics, kNumJoints> bone;  // by the joint that ends it
  GirthRegression chest, waist, buttock, thigh, calf, neck, ankle;

  // Parses the YAML text; errors name `source`, key and line.
  static Anthropometry Parse(const std::string& text,
                             const std::string& source);
  // The tables that come with the program.
  static const Anthropometry& Default();
};

}  // namespace sweepfit
