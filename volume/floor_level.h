// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "capture/silhouette.h"
#include "volume/volume.h"

namespace sweepfit {

// The height, metres along +Y, below which no silhouette needs the volume: the
// floor that the person stands on, or the lowest point of one who does not.
// Views from above leave wedges below the feet that no silhouette contradicts.
//
// Algorithm: the ray through every pixel of a silhouette's lower edge needs the
// highest point that it has in common with the volume. Of the pixels that need
// something within kContact of the lowest, a tenth may be a shadow's, and an
// outline is trusted to one pixel. Of three or more views the one that needs
// the second lowest decides: one may err.
// Pixels at the frame, where the person is cut, all count. The lowest point of
// the volume when no view looks down.
double FindFloor(const std::vector<View>& views, const Volume& volume);

}  // namespace sweepfit
