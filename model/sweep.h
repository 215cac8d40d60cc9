// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "model/skeleton.h"

namespace sweepfit {

// A limb (or the trunk) as a sweep of star-shaped cross-sections along an axis
// through a chain of joints:
//
//   S(u, theta) = c(u) + R(u) r(u, theta) (cos theta, sin theta, 0)
//   r(u, theta) = r_T(u, theta) exp q(u, theta)
//
// The arc parameter u counts bones of the chain: u = k + f is the fraction f
// of bone k. u < 0 and u > number of bones continue the first and last bone in
// a straight line. Columns of R(u): e1, e2 span the section plane, e3 is the
// tangent. q is the logarithm of the ratio between the fitted and the template
// radius (the paper's "difference ratio"), zero in the template.
struct Sweep {
  std::string name;                // "trunk", "l_arm", ...
  std::vector<int> chain;          // joints, proximal first
  // At rest e1 is this direction made orthogonal to the tangent; e2 = e3 x e1.
  Eigen::Vector3d rest_reference;
  // The last bone (hand, foot, head) moves as a rigid piece: its twist is
  // spread over the bone before.
  bool rigid_end = false;

  // Key rows, ascending u, and what is keyed there. Between keys everything is
  // interpolated by a cubic through the keys (Catmull-Rom, clamped ends).
  std::vector<double> key_u;
  Eigen::Matrix2Xd center_offset;  // 2 x rows: centre from the axis, in (e1,e2)
  Eigen::MatrixXd radius;          // rows x K: r_T, metres
  Eigen::MatrixXd log_ratio;       // rows x K: q

  // How far the local fit may trust the evidence here, 0 to 1 per key row
  // (the paper's feature weight).
  Eigen::VectorXd feature_weight;

  int num_rows() const { return static_cast<int>(key_u.size()); }
  int num_columns() const { return static_cast<int>(radius.cols()); }
  int num_bones() const { return static_cast<int>(chain.size()) - 1; }
};

// r(u, theta) depends on at most 4 x 4 samples: their flat indices
// (row * K + column) and weights.
struct SampleWeights {
  std::array<int, 16> index;
  std::array<double, 16> weight;
};
SampleWeights RadiusWeights(const Sweep& sweep, double u, double theta);

// The template's radius r_T and the fitted radius r.
double TemplateRadius(const Sweep& sweep, double u, double theta);
double Radius(const Sweep& sweep, double u, double theta);

// A section's frame in the world: origin on the section centre (offset
// included), columns e1, e2, tangent.
struct SectionFrame {
  Eigen::Vector3d center_in_world;
  Eigen::Matrix3d world_from_section;
};

// The axis of one sweep in one posture. Corners of the joint chain are rounded
// by quadratic Bezier curves; frames are carried along without rotation about
// the tangent (rotation-minimising), and the twist that is left against a
// joint's own frame is spread linearly over the bone that ends in it. At rest
// this is the rest axis, so that motion relative to rest is the identity there.
class SweepAxis {
 public:
  SweepAxis(const Sweep& sweep,
            const Skeleton& skeleton,
            const JointFrames& frames);

  SectionFrame At(double u) const;

 private:
  struct Bone {
    Eigen::Vector3d start_in_world;
    Eigen::Vector3d end_in_world;
    Eigen::Matrix3d start_frame;  // columns e1, e2, tangent, at the bone start
    double twist = 0;             // radians gained until the bone end
    double bend_start = 0;        // fraction of the bone rounded at its start
    double bend_end = 0;          // and at its end
  };
  const Sweep& sweep_;
  std::vector<Bone> bones_;
};

}  // namespace sweepfit
