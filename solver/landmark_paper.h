// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "capture/silhouette.h"
#include "solver/landmark_graph.h"
#include "solver/landmarks.h"
#include "volume/volume.h"

namespace sweepfit {

// The paper's landmarks (II.A, III), as far as its text tells, kept as a
// baseline. Two pictures are used, those of the cameras that look at the person
// most frontally and most laterally:
//   features   extrema and convexity defects of the 8-connected contour chain:
//              crown, finger tips and feet; crotch, armpits and neck corners;
//              wrists, elbows, knees and ankles between them at usual shares of
//              the limbs, in the middle between the edges; toes and heels of
//              the lateral view
//   2-D to 3-D the frontal outline's box is mapped linearly to the volume's
//              box, which ignores perspective; depth is that of the centroid of
//              the volume's cut-plane through the feature, perpendicular to its
//              neighbours' bisector (shoulders and hips: middle of the chord)
// Covariances are the same for all, 2 cm, as in the paper a point is as good as
// any other. The person must stand, arms and legs clear of each other; what a
// frontal outline does not show is left out. `graph` samples the volume, facing
// comes from it. Appends the features to `points`.
std::vector<Landmark3> FindPaperLandmarks(
    const std::vector<View>& views,
    const Volume& volume,
    const SolidGraph& graph,
    const Eigen::Vector3d& facing_in_world,
    std::vector<Landmark2>* points);

}  // namespace sweepfit
