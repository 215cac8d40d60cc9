// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "capture/silhouette.h"
#include "volume/vertex_rings.h"

namespace sweepfit {

// "weight (slope * offset - value)^2": what moving a vertex by `offset` along
// its normal should achieve. Metres, 1 / metres^2.
struct OffsetTarget {
  int vertex = 0;
  double slope = 1;
  double value = 0;
  double weight = 0;
};

// The viewing rays along the edge of a silhouette touch the body. One target
// for every vertex that may be such a contact: of the vertices near a ray those
// farthest out, in equal parts where several are (on a visual hull all along
// the ray are). `sigma`: noise of the edge, metres.
std::vector<OffsetTarget> FindRimContacts(
    const View& view,
    const std::vector<Eigen::Vector3d>& vertices,
    const std::vector<Eigen::Vector3d>& normals,
    double sigma);

}  // namespace sweepfit
