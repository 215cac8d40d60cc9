// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "capture/silhouette.h"
#include "solver/landmarks.h"

namespace sweepfit {

// The middle between the two silhouette edges beside a limb in one view.
struct EdgeMidpoint {
  Eigen::Vector2d pinhole_pixel;
  Eigen::Vector2d across;  // unit, from edge to edge
  double half_width = 0;   // metres at the limb's depth
  double sigma = 0;        // pixels, across the limb
};

// Looks from the projection of a point on a limb perpendicularly to the limb's
// direction for the edges on either side. Nothing when the view looks along
// the limb, when the point is not inside, when an edge is farther away than
// `max_half_width` (metres), or when no background follows an edge, so that
// something else may hide the limb's own.
std::optional<EdgeMidpoint> MeasureLimb(
    const View& view,
    const Eigen::Vector3d& point_in_world,
    const Eigen::Vector3d& unit_limb_direction,
    double max_half_width);

// Improves a landmark of a limb across its direction: midpoints are centres of
// the limb, the same in every view, while the edges themselves are different
// points of the skin. Minimises
//   sum_i rho_Huber(a_i . (pi_i(X) - m_i) / sigma_i)
//     + |X - X_0|^2 in the landmark's covariance, widened across the limb,
// by Gauss-Newton; appends what the views showed to `points`. Unchanged with
// fewer than two agreeing views.
void RefineAcrossLimb(const std::vector<View>& views,
                      const Eigen::Vector3d& unit_limb_direction,
                      double max_half_width,
                      Landmark3* landmark,
                      std::vector<Landmark2>* points);

// The silhouette's edge beyond a tip (finger, toe, crown), seen from a point
// inside the limb, in every view that shows it before background.
void MeasureTip(const std::vector<View>& views,
                const Landmark3& tip,
                const Eigen::Vector3d& base_in_world,
                std::vector<Landmark2>* points);

// The silhouette's corner between two limbs (armpit, crotch, neck) in every
// view that shows background between them: walking from the middle of the two
// limb points towards the joint where the limbs meet, the first point of the
// silhouette, if it lies within `max_distance` (metres) of the joint: limbs
// that hide each other meet elsewhere in the picture. Views see different
// points of the skin there, so corners are not triangulated; they are for
// overlays and for other programs.
void MeasureCorner(const std::vector<View>& views,
                   const std::string& name,
                   const Eigen::Vector3d& limb_in_world,
                   const Eigen::Vector3d& other_limb_in_world,
                   const Eigen::Vector3d& joint_in_world,
                   double max_distance,
                   std::vector<Landmark2>* points);

}  // namespace sweepfit
