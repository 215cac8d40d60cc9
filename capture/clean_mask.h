// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "capture/plate.h"

namespace sweepfit {

// The person as a yes-or-no mask (255: person): hysteresis on the difference,
// the largest component and what lies near it, pin-holes filled but gaps that
// show the background left open.
cv::Mat1b PersonMask(const BackgroundDifference& difference,
                     const SegmentOptions& options);

}  // namespace sweepfit
