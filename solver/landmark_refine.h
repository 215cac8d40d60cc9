// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "capture/silhouette.h"
#include "solver/landmark_body.h"
#include "solver/landmarks.h"

namespace sweepfit {

// Triangulates the outline's corners beside the rough landmarks: crotch and
// armpits. Appends what the views showed to `points`.
std::vector<Landmark3> TriangulateCorners(const std::vector<View>& views,
                                          const std::vector<Landmark3>& rough,
                                          double stature,
                                          std::vector<Landmark2>* points);

// Looks for the volume's landmarks in every picture and triangulates them with
// the volume's own estimates as priors:
//   limbs   middles between the edges: the same point in every view, while the
//           edges are different points of the skin
//   tips    farthest points of the outline
//   neck    middles between its edges, at its narrowest
// Landmarks that fewer than two views agree on stay the volume's. Appends what
// the views showed to result->points, and the neck's middle to
// result->features.
void RefineInViews(const std::vector<View>& views,
                   const BodyTrace& body,
                   LandmarkResult* result);

}  // namespace sweepfit
