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
  std::string name;        // "trunk", "l_arm", ...
  std::vector<int> chain;  // joints, proximal first
  // At rest e1 is this direction made orthogonal to the first bone; e2 = e3 x
  // e1. Along the rest axis the frame is carried without twist (so e1 stays
  // the reference where that is normal to the plane the chain bends in).
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

// Weights of at most four key rows in the interpolation at u: the Hermite cubic
// between the keys beside u whose tangent at a key is that of the parabola
// through it and its neighbours (the secant at the first and the last key).
// Constant beyond the keys. The weights sum to 1; unused rows weigh 0.
struct RowWeights {
  std::array<int, 4> index;
  std::array<double, 4> weight;
};
RowWeights KeyRowWeights(const Sweep& sweep, double u);

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

// The section centre from the axis, in (e1, e2), metres.
Eigen::Vector2d CenterOffset(const Sweep& sweep, double u);

// A section's frame in the world: origin on the section centre (offset
// included), columns e1, e2, tangent.
struct SectionFrame {
  Eigen::Vector3d center_in_world;
  Eigen::Matrix3d world_from_section;
};

// The axis of one sweep in one posture.
//
// Every inner corner of the joint chain is rounded by a quadratic Bezier curve
// whose control point is the joint and whose legs have the length h = min(1.5
// r, 0.35 length of either bone), r the mean template radius at the joint. u
// moves evenly along each leg: u = k -+ h / length are the curve's ends and
// u = k its middle.
//
// Frames are carried along without rotation about the tangent. The twist that
// a joint puts on the bone that starts there grows linearly along that bone,
// from 0 to what makes the frame at its end that of the joint. With rigid_end
// the twist of the last bone is spread over the bone before instead. The frame
// begins, for a chain that starts at the root, as that of the root; for any
// other as that of the parent of the first joint, turned the shortest way onto
// the first bone.
//
// At rest this is the rest axis, so that motion relative to rest is the
// identity there.
class SweepAxis {
 public:
  // `sweep` must outlive the axis. CHECKs that the joints of the chain follow
  // each other in the skeleton and that its bones have positive lengths.
  SweepAxis(const Sweep& sweep,
            const Skeleton& skeleton,
            const JointFrames& frames);

  // Any u; see Sweep for u beyond the ends of the chain.
  SectionFrame At(double u) const;
  // The same with the origin on the axis itself, without the centre offset.
  SectionFrame OnAxis(double u) const;

  // The rounded corner between bone k and the next, at u = k + 1.
  struct Corner {
    Eigen::Vector3d joint_in_world;
    Eigen::Vector3d direction_before;  // unit vectors along the bones
    Eigen::Vector3d direction_after;
    Eigen::Vector3d hinge_in_world;  // unit axis that turns before onto after
    double cos_bend = 1;
    double sin_bend = 0;
    double leg = 0;           // h, metres
    double range_before = 0;  // h as a fraction of either bone
    double range_after = 0;
  };
  int num_corners() const { return static_cast<int>(corners_.size()); }
  const Corner& corner(int index) const { return corners_[index]; }

 private:
  struct Bone {
    Eigen::Vector3d start_in_world;
    Eigen::Vector3d along_in_world;    // from start to end
    Eigen::Matrix3d world_from_start;  // section frame at the start, untwisted
    double twist = 0;                  // radians gained until the bone's end
  };
  // What begins the chain: the frame on its first bone before any twist.
  Eigen::Matrix3d StartFrame(const Eigen::Matrix3d& rest_frame,
                             const Eigen::Vector3d& rest_direction,
                             const JointFrames& frames) const;
  void RoundCorners();
  void CarryFrames(const std::vector<Eigen::Matrix3d>& target_frames);
  SectionFrame OnBone(int bone, double fraction) const;
  SectionFrame InCorner(int corner, double u) const;

  const Sweep& sweep_;
  std::vector<Bone> bones_;
  std::vector<Corner> corners_;  // corner k lies between bones k and k + 1
};

}  // namespace sweepfit
