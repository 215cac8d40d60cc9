// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "capture/keypoints.h"
#include "capture/silhouette.h"
#include "solver/landmarks.h"

namespace sweepfit {

// Triangulates keypoints made elsewhere, all of one pose, name by name, without
// the help of silhouettes or volume. Those of joints become landmarks with the
// source "keypoint", others features with joint -1. Keypoints that fewer than
// two views agree on are left out. Appends what agrees to `points`.
std::vector<Landmark3> TriangulateKeypoints(
    const std::vector<View>& views,
    const std::vector<Keypoint2>& keypoints,
    std::vector<Landmark2>* points);

}  // namespace sweepfit
