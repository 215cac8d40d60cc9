// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "capture/silhouette.h"
#include "volume/volume.h"

namespace sweepfit {

// Takes off what lies below the floor of a standing or seated person: views
// that all look down leave a wedge there that no silhouette contradicts.
//
// Only where the wedge is several times as deep as the floor is uncertain,
// because the plane (FindFloor) may take that much of a sole that no view sees.
// `depth` (metres, may be null): of what was taken off, 0 when nothing was.
Volume CutBelowFloor(const std::vector<View>& views,
                     Volume hull,
                     double* depth);

}  // namespace sweepfit
