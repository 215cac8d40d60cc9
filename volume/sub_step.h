// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

namespace sweepfit {

// Maximum of a parabola through three equidistant values, in steps from the
// middle one, within half a step; 0 where there is none.
inline double SubStep(double before, double middle, double after) {
  const double bend = before - 2 * middle + after;
  if (!(bend < -1e-6)) return 0;
  return std::clamp(0.5 * (before - after) / bend, -0.5, 0.5);
}

}  // namespace sweepfit
