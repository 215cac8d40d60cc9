// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "capture/silhouette.h"
#include "volume/volume.h"

namespace sweepfit {

// Moves the hull's surface inwards to where the pictures agree (algorithm: the
// hull gives visibility and topology; windowed correlations of tangent-plane
// patches at several depths below it; labels by belief propagation over the
// surface; then least squares over
//   what the labels say, the viewing rays along the silhouettes, which must
//   touch, and a surface that bends little,
// twice, the second time about the surface of the first). Never beyond the
// hull. Without texture enough the hull is kept: a warning says so and
// figures["photo"] begins with "off".
Volume RefineByPhotoConsistency(const std::vector<View>& views,
                                Volume hull,
                                const PhotoOptions& options,
                                Progress* progress,
                                StageSummary* summary);

}  // namespace sweepfit
