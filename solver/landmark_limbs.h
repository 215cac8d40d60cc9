// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "volume/cut_plane.h"
#include "volume/volume.h"

namespace sweepfit {

// A place on the centre line of a limb or of the trunk.
struct LimbSection {
  double s = 0;                    // metres along the line from its end
  Eigen::Vector3d point_in_world;  // on the centre line
  Eigen::Vector3d tangent;         // unit, away from the end
  CutPlaneSection cut;             // perpendicular to the tangent
  // The section stands free: found, closed, and no larger than the limit.
  bool free = false;
};

// Centre line from the end of a body part towards the trunk.
using LimbLine = std::vector<LimbSection>;

struct TraceOptions {
  double step = 0.012;       // metres between sections
  double smoothing = 0.035;  // metres, standard deviation along the line
  double half_size = 0.1;    // of the cut planes, metres
  double max_area = 0;       // square metres; larger sections are not free
  double max_length = 2;     // metres
  int iterations = 2;
};

// Turns a way through the inside (it cuts corners) into a centre line: the
// centroids of the perpendicular sections, where these stand free.
LimbLine TraceLimb(const Volume& volume,
                   const std::vector<Eigen::Vector3d>& path_in_world,
                   const TraceOptions& options);

// The line's point and tangent at s, linear between sections, clamped.
Eigen::Vector3d PointAt(const LimbLine& line, double s);
Eigen::Vector3d TangentAt(const LimbLine& line, double s);

// The straight line through the section points with s in [from, to], least
// squares; direction away from the end. False with fewer than three points.
bool FitAxis(const LimbLine& line,
             double from,
             double to,
             Eigen::Vector3d* point,
             Eigen::Vector3d* direction);

// Where the line bends most sharply within [from, to], for arms longer than
// `arm` metres on either side: the angle in radians, and s.
struct Bend {
  double s = 0;
  double angle = 0;
};
Bend SharpestBend(const LimbLine& line, double from, double to, double arm);

}  // namespace sweepfit
