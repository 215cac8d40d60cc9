// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "capture/silhouette.h"
#include "solver/landmark_triangulation.h"

// Landmarks of the outline in one picture: middles of limbs, tips, corners.
namespace sweepfit {

// Pixels from `start` (inside) along the unit direction to the edge of the
// silhouette; negative when there is none within `limit` or no `clearance`
// pixels of background behind it.
double FindEdge(const View& view,
                const Eigen::Vector2d& start,
                const Eigen::Vector2d& direction,
                double limit,
                double clearance);

// The middle between the two silhouette edges beside a limb in one view.
struct EdgeMidpoint {
  PointObservation observation;  // known across the limb only
  double half_width = 0;         // metres at the limb's depth
  double pixels_per_metre = 0;   // there
};

// Looks from the projection of a point on a limb perpendicularly to the limb's
// direction for the edges on either side. Nothing when the view looks along
// the limb, when the point is not inside, when the limb is wider than
// `max_half_width` (metres), or when no background follows an edge, so that
// something else may hide the limb's own.
std::optional<EdgeMidpoint> MeasureLimb(
    const View& view,
    const Eigen::Vector3d& point_in_world,
    const Eigen::Vector3d& unit_limb_direction,
    double max_half_width);

// The observations of one place of a limb in several views, with room for what
// stands beside it. Limbs are about as deep as they are wide: where a view
// shows one much wider than another view does, something else is part of it,
// mostly the other leg, and the middle may lie anywhere within
//   slack = half width - 1.15 * least half width
// to either side of what was measured (variance slack^2 / 3). Opposite views
// then show the same wrong middle, so n such views together know no more than
// one of them: n slack^2 / 3 each.
std::vector<PointObservation> AllowForNeighbours(
    const std::vector<EdgeMidpoint>& edges);

// An end of a limb as the volume shows it.
struct TipPlace {
  int joint = -1;
  // Within the limb, a few centimetres inside.
  Eigen::Vector3d base_in_world = Eigen::Vector3d::Zero();
  double half_width = 0;  // of the limb at its base, metres
  double radius = 0;      // of the rounding of the tip, metres
  // Wider than this, edge to edge, the base is in front of something else, and
  // the tip does not show; 0: any width.
  double widest = 0;
  // How far the farthest point may be from the joint that is meant: hair,
  // shoes, which finger is longest; metres along and across the limb.
  double anatomy_along = 0, anatomy_across = 0;
};

// The outline's farthest point in the direction from the limb's base to the
// tip (finger tips, toes, crown). The edge there is a tangent to the rounded
// tip, not the tip itself: seen at an angle it reaches farther by
// radius (1 - cos); that is taken off. Nothing when the limb is seen shortened
// by more than half, or no background follows within 3 cm of the tip.
std::optional<PointObservation> MeasureTip(const View& view,
                                           const TipPlace& place,
                                           const Eigen::Vector3d& tip_in_world);

// The outline's corner between two limbs (armpit, crotch, neck): the deepest
// background between them that can be reached from the middle of the two limb
// points, within the triangle of these and the joint where the limbs meet, and
// within `max_distance` (metres) of that joint; limbs that hide each other meet
// elsewhere in the picture. Views touch the fold of skin between the limbs at
// different points of it, so the covariance holds the size of a fold, for a
// person of this stature (metres).
std::optional<PointObservation> MeasureCorner(
    const View& view,
    const Eigen::Vector3d& limb_in_world,
    const Eigen::Vector3d& other_limb_in_world,
    const Eigen::Vector3d& joint_in_world,
    double max_distance,
    double stature);

}  // namespace sweepfit
