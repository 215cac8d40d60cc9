// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

namespace sweepfit {

// From 0 to 1 while t does, level at both ends and beyond.
inline double SmoothStep(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

}  // namespace sweepfit
