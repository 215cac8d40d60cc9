// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "model/skeleton.h"

namespace sweepfit {

// Tells whether the legs of a posture go through each other. A leg is the set
// of points within r of its bones from the crotch to the ankle. The radius
// changes evenly from the hip, where legs that stand fill the way between the
// hip joints, to half the breadth of the knee, and from there to half that of
// the foot, because feet side by side keep the ankles apart.
class LegContact {
 public:
  // Breadths as shares of the length of the leg from hip to ankle.
  LegContact(const Skeleton& skeleton,
             double knee_breadth,
             double foot_breadth);

  // The gap between the legs, metres; negative when they overlap.
  double Gap(const Pose& pose) const;

 private:
  struct Leg {
    Eigen::Vector3d hip_in_root;
    Eigen::Vector3d thigh, shank;  // at rest
    double hip_radius, knee_radius, ankle_radius;
  };
  std::array<Leg, 2> legs_;
};

}  // namespace sweepfit
