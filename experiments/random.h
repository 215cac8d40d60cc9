// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace sweepfit {

// Random numbers that are the same with every standard library: the engine is
// specified by the standard, the distributions of <random> are not.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  // In [0, 1).
  double Uniform() { return static_cast<double>(engine_() >> 11) * 0x1.0p-53; }
  double Uniform(double low, double high) {
    return low + (high - low) * Uniform();
  }
  // Standard normal by Box and Muller.
  double Normal() {
    const double u = 1 - Uniform();
    const double v = Uniform();
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * v);
  }
  // Normal with mean 0, cut off at two sigma.
  double Spread(double sigma) {
    double x = Normal();
    while (std::abs(x) > 2) x = Normal();
    return sigma * x;
  }
  bool Chance(double probability) { return Uniform() < probability; }

 private:
  std::mt19937_64 engine_;
};

}  // namespace sweepfit
