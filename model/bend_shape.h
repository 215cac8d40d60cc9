// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "model/sweep.h"

namespace sweepfit {

// What bending does to the sections of a sweep.
//
// Moved rigidly along a bent axis, sections would lose volume, because the
// rounded corner is shorter than the bones it replaces, and would fold over on
// the inner side. So a section is reshaped in its own plane. With n the
// coordinate towards the inside of the bend, b along the hinge, both from the
// section centre:
//
//   n' = min~(s n, L) for n < 0, min~(n, L) else
//   b' = (1 + kSideways (s - 1)) b
//
// L is where the section meets the plane that bisects the two bones, less a
// small gap: skin does not pass it, so the two sides of a fold touch and do
// not run through each other. For a corner of leg h and bend phi with
// v = (1 - w) before + w after the unnormalised tangent at parameter w,
// L = h cot(phi/2) |v| within the corner and d cot(phi/2) on the bones at the
// distance d from the joint, measured from the axis. min~ is a smooth minimum.
//
// s >= 0 makes every thin slice keep its volume: dV/du = |dc/du| times the
// integral of 1 - kappa n over the section, kappa the curvature of the axis
// (the theorem of Pappus for sections of any shape, their centroid on the axis
// or not). It is then smoothed along u and its amplitude set so that the whole
// corner keeps its volume to rounding, within bounds of s.
//
// Only limbs swell. The axis of the trunk, a sweep from the root, lies far from
// its centroid: keeping every slice's volume would move the belly by
// centimetres for a slight lean. Beside the short bones of neck and head the
// limit would cut off the skull, so there is none.
//
// Where the axis is bent at rest already, what the limit takes from the rest
// shape is given back, so that the rest posture stays as it is.

// The sections near the corners of one sweep at rest, and their volume.
class BendZones {
 public:
  // Both must outlive the zones.
  BendZones(const Sweep& sweep, const SweepAxis& rest_axis);

  // What the bends of the rest axis would change about a point of the section
  // at u, from its centre in (e1, e2), metres; 0 nearly everywhere.
  Eigen::Vector2d RestChange(double u,
                             const Eigen::Matrix3d& world_from_section,
                             const Eigen::Vector2d& offset,
                             const Eigen::Vector2d& point) const;

 private:
  friend class BendShape;
  struct Section {
    double u;
    Eigen::Matrix2Xd outline;  // from the centre, (e1, e2)
    Eigen::Matrix2Xd rest_change;
    Eigen::Vector2d offset;  // centre from the axis
    double volume_by_u;      // dV/du / length of the bone, square metres
  };
  const SweepAxis& rest_axis_;
  bool swells_;
  std::vector<bool> is_limited_;              // per corner
  std::vector<std::vector<Section>> corner_;  // sections, ascending u
};

// The same in one posture.
class BendShape {
 public:
  // `zones` and `posed_axis` must outlive the shape.
  BendShape(const BendZones& zones, const SweepAxis& posed_axis);

  // How a point of the section at u moves within the section, from the section
  // centre in (e1, e2), metres. `world_from_section` is the posed frame at u,
  // `offset` the section centre from the axis. RestChange is to be subtracted.
  Eigen::Vector2d Change(double u,
                         const Eigen::Matrix3d& world_from_section,
                         const Eigen::Vector2d& offset,
                         const Eigen::Vector2d& point) const;

 private:
  struct Profile {
    double cot_half = 0;        // cot(phi / 2); 0: straight
    std::vector<double> swell;  // s - 1 at the samples
  };
  void SolveCorner(int corner);
  double Swell(int corner, double u) const;

  const BendZones& zones_;
  const SweepAxis& axis_;
  std::vector<Profile> profile_;  // per corner
};

}  // namespace sweepfit
