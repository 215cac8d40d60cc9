// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "capture/silhouette.h"
#include "volume/volume.h"

namespace sweepfit {

// For every view, the share (0..1) of its silhouette whose viewing rays meet
// the volume. A hull of coherent silhouettes explains nearly all of each; a
// view with a wrong mask or calibration leaves the others' uncovered.
std::vector<double> SilhouetteCoverage(const std::vector<View>& views,
                                       const Volume& volume);

}  // namespace sweepfit
