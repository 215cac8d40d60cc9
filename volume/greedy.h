// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "capture/silhouette.h"
#include "volume/volume.h"

namespace sweepfit {

// "Self-constrained greedy" carving of the hull's voxels: our reading of the
// method that the paper cites (Kim and Kweon, IJCV 66(2), 2006), whose text was
// not available to us; not a reproduction. The surface voxels stand in a queue
// by the log likelihood ratio of "the views that see it show one colour" to
// "they show any colours"; the least likely one goes first, if
//   - its ratio is below the threshold,
//   - every picture element of every silhouette that it supports keeps another
//     voxel (so the silhouettes stay covered: the self-constraint),
//   - it is not deeper below the hull than max_depth, and
//   - it does not stand in a pit of its own (bounded curvature);
// then its neighbours are judged anew. The result is smoothed a little.
Volume CarveGreedily(const std::vector<View>& views,
                     Volume hull,
                     const GreedyOptions& options,
                     StageSummary* summary);

}  // namespace sweepfit
