// SPDX-License-Identifier: Apache-2.0
#include "model/sweep.h"

#include <glog/logging.h>

#include <algorithm>
#include <cmath>

#include "model/cross_section.h"

namespace sweepfit {
namespace {

// Legs of a rounded corner in units of the radius at the joint and of the
// bones. With 1.5 radii the sections do not fold over until about 92 degrees;
// 0.35 leaves the middle of each bone straight. The trunk is deep for the
// length of its bones: it bends over more of them.
constexpr double kLegByRadius = 1.5;
constexpr double kLegByBone = 0.35;
constexpr double kLegByBoneOfTrunk = 0.48;

// Rotation about a unit axis with the given cosine and sine (Rodrigues).
Eigen::Matrix3d RotationAbout(const Eigen::Vector3d& axis,
                              double cosine,
                              double sine) {
  const Eigen::Vector3d v = (1 - cosine) * axis;
  const Eigen::Vector3d s = sine * axis;
  Eigen::Matrix3d rotation;
  rotation << v.x() * axis.x() + cosine, v.x() * axis.y() - s.z(),
      v.x() * axis.z() + s.y(),  //
      v.y() * axis.x() + s.z(), v.y() * axis.y() + cosine,
      v.y() * axis.z() - s.x(),  //
      v.z() * axis.x() - s.y(), v.z() * axis.y() + s.x(),
      v.z() * axis.z() + cosine;
  return rotation;
}

// The shortest turn of one unit vector onto another.
struct ShortestTurn {
  Eigen::Vector3d axis;
  double cosine;
  double sine;

  Eigen::Matrix3d Matrix() const { return RotationAbout(axis, cosine, sine); }
};

ShortestTurn TurnOnto(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  // Below this the cross product is rounding noise: parallel vectors do not
  // turn, opposite ones turn about any normal.
  constexpr double kParallel = 1e-12;
  const Eigen::Vector3d cross = from.cross(to);
  const double dot = from.dot(to);
  const double sine = cross.norm();
  if (sine < kParallel) {
    return {from.unitOrthogonal(), dot < 0 ? -1.0 : 1.0, 0.0};
  }
  // The projection keeps the axis a normal of `from` where the cross product
  // has lost digits.
  const Eigen::Vector3d axis = cross - cross.dot(from) * from;
  return {axis.normalized(), dot, sine};
}

// Columns e1, e2, tangent, with e1 as near to `reference` as can be.
Eigen::Matrix3d FrameFromReference(const Eigen::Vector3d& tangent,
                                   const Eigen::Vector3d& reference) {
  const Eigen::Vector3d across = reference - reference.dot(tangent) * tangent;
  CHECK_GT(across.norm(), 1e-6 * reference.norm())
      << "the reference direction of a sweep lies along its axis";
  Eigen::Matrix3d frame;
  frame.col(0) = across.normalized();
  frame.col(2) = tangent;
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

// The frame after turning its e1 by an angle about its tangent.
Eigen::Matrix3d Twisted(const Eigen::Matrix3d& frame, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  Eigen::Matrix3d twisted;
  twisted.col(0) = c * frame.col(0) + s * frame.col(1);
  twisted.col(1) = c * frame.col(1) - s * frame.col(0);
  twisted.col(2) = frame.col(2);
  return twisted;
}

// The twist about the common tangent that makes `from` into `to`, in (-pi, pi].
double TwistBetween(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to) {
  return std::atan2(to.col(0).dot(from.col(1)), to.col(0).dot(from.col(0)));
}

// Frames on the bones of the chain at rest, carried without twist.
std::vector<Eigen::Matrix3d> RestFramesOnBones(const Sweep& sweep,
                                               const Skeleton& skeleton) {
  std::vector<Eigen::Matrix3d> frames;
  for (int bone = 0; bone < sweep.num_bones(); ++bone) {
    const Eigen::Vector3d& direction =
        skeleton.rest_direction[sweep.chain[bone + 1]];
    if (bone == 0) {
      frames.push_back(FrameFromReference(direction, sweep.rest_reference));
      continue;
    }
    const Eigen::Vector3d& before = skeleton.rest_direction[sweep.chain[bone]];
    frames.push_back(TurnOnto(before, direction).Matrix() * frames.back());
  }
  return frames;
}

double MeanTemplateRadius(const Sweep& sweep, double u) {
  const RowWeights rows = KeyRowWeights(sweep, u);
  double mean = 0;
  for (int i = 0; i < 4; ++i) {
    if (rows.weight[i] == 0) continue;
    mean += rows.weight[i] * sweep.radius.row(rows.index[i]).mean();
  }
  return mean;
}

double Interpolate(const Eigen::MatrixXd& samples,
                   const SampleWeights& weights) {
  const int columns = static_cast<int>(samples.cols());
  double value = 0;
  for (int i = 0; i < 16; ++i) {
    value += weights.weight[i] *
             samples(weights.index[i] / columns, weights.index[i] % columns);
  }
  return value;
}

// Weights of three neighbouring rows.
struct TangentWeights {
  double before;
  double here;
  double after;
};

// Weights of rows k - 1, k, k + 1 in the derivative at key k: that of the
// parabola through the three keys, of the secant at the ends.
TangentWeights TangentAtKey(const std::vector<double>& key_u, int k) {
  const int last = static_cast<int>(key_u.size()) - 1;
  if (k == 0) {
    const double step = key_u[1] - key_u[0];
    return {0, -1 / step, 1 / step};
  }
  if (k == last) {
    const double step = key_u[k] - key_u[k - 1];
    return {-1 / step, 1 / step, 0};
  }
  const double a = key_u[k] - key_u[k - 1];
  const double b = key_u[k + 1] - key_u[k];
  return {-b / (a * (a + b)), (b - a) / (a * b), a / (b * (a + b))};
}

}  // namespace

RowWeights KeyRowWeights(const Sweep& sweep, double u) {
  const std::vector<double>& key_u = sweep.key_u;
  CHECK(!key_u.empty());
  const int last = static_cast<int>(key_u.size()) - 1;
  if (u <= key_u.front()) return {{0, 0, 0, 0}, {1, 0, 0, 0}};
  if (u >= key_u.back()) return {{last, last, last, last}, {1, 0, 0, 0}};
  const int k = static_cast<int>(
      std::upper_bound(key_u.begin(), key_u.end(), u) - key_u.begin() - 1);

  const double step = key_u[k + 1] - key_u[k];
  const double t = (u - key_u[k]) / step;
  const double t2 = t * t;
  const double t3 = t2 * t;
  const double value_after = 3 * t2 - 2 * t3;
  const double slope_here = step * (t3 - 2 * t2 + t);
  const double slope_after = step * (t3 - t2);
  const TangentWeights here = TangentAtKey(key_u, k);
  const TangentWeights after = TangentAtKey(key_u, k + 1);
  return {
      {std::max(k - 1, 0), k, k + 1, std::min(k + 2, last)},
      {slope_here * here.before,
       1 - value_after + slope_here * here.here + slope_after * after.before,
       value_after + slope_here * here.after + slope_after * after.here,
       slope_after * after.after}};
}

SampleWeights RadiusWeights(const Sweep& sweep, double u, double theta) {
  const int columns = sweep.num_columns();
  const RowWeights rows = KeyRowWeights(sweep, u);
  const PeriodicWeights around = PeriodicCubicWeights(theta, columns);
  SampleWeights weights;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      weights.index[4 * i + j] = rows.index[i] * columns + around.index[j];
      weights.weight[4 * i + j] = rows.weight[i] * around.weight[j];
    }
  }
  return weights;
}

double TemplateRadius(const Sweep& sweep, double u, double theta) {
  return Interpolate(sweep.radius, RadiusWeights(sweep, u, theta));
}

double Radius(const Sweep& sweep, double u, double theta) {
  const SampleWeights weights = RadiusWeights(sweep, u, theta);
  return Interpolate(sweep.radius, weights) *
         std::exp(Interpolate(sweep.log_ratio, weights));
}

Eigen::Vector2d CenterOffset(const Sweep& sweep, double u) {
  const RowWeights rows = KeyRowWeights(sweep, u);
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
  for (int i = 0; i < 4; ++i) {
    offset += rows.weight[i] * sweep.center_offset.col(rows.index[i]);
  }
  return offset;
}

SweepAxis::SweepAxis(const Sweep& sweep,
                     const Skeleton& skeleton,
                     const JointFrames& frames)
    : sweep_(sweep) {
  CHECK_GE(sweep.num_bones(), 1) << sweep.name;
  std::vector<Eigen::Matrix3d> target_frames =
      RestFramesOnBones(sweep, skeleton);
  const Eigen::Matrix3d rest_frame = target_frames.front();
  bones_.resize(sweep.num_bones());
  for (int k = 0; k < sweep.num_bones(); ++k) {
    const int joint = sweep.chain[k];
    const int next = sweep.chain[k + 1];
    CHECK_EQ(kJointParents[next], joint) << sweep.name;
    CHECK_GT(skeleton.length[next], 0) << sweep.name;
    bones_[k].start_in_world = frames.joint_in_world[joint];
    bones_[k].along_in_world =
        frames.joint_in_world[next] - frames.joint_in_world[joint];
    // A bone turns with the joint it starts at; a collar bone has a turn of
    // its own besides.
    const Eigen::Matrix3d carried =
        frames.world_from_joint[joint] * target_frames[k];
    target_frames[k] =
        TurnOnto(carried.col(2), bones_[k].along_in_world.normalized())
            .Matrix() *
        carried;
  }
  bones_.front().world_from_start =
      StartFrame(rest_frame, target_frames.front().col(2), frames);
  corners_.resize(bones_.size() - 1);
  for (std::size_t k = 0; k < corners_.size(); ++k) {
    corners_[k].joint_in_world = bones_[k + 1].start_in_world;
    corners_[k].direction_before = target_frames[k].col(2);
    corners_[k].direction_after = target_frames[k + 1].col(2);
  }
  RoundCorners();
  CarryFrames(target_frames);
}

Eigen::Matrix3d SweepAxis::StartFrame(const Eigen::Matrix3d& rest_frame,
                                      const Eigen::Vector3d& direction,
                                      const JointFrames& frames) const {
  const int first = sweep_.chain.front();
  const int parent = kJointParents[first];
  if (parent < 0) return frames.world_from_joint[first] * rest_frame;
  const Eigen::Matrix3d carried = frames.world_from_joint[parent] * rest_frame;
  return TurnOnto(carried.col(2), direction).Matrix() * carried;
}

void SweepAxis::RoundCorners() {
  const double leg_by_bone =
      sweep_.chain.front() == kRoot ? kLegByBoneOfTrunk : kLegByBone;
  for (std::size_t k = 0; k < corners_.size(); ++k) {
    Corner& corner = corners_[k];
    const double length_before = bones_[k].along_in_world.norm();
    const double length_after = bones_[k + 1].along_in_world.norm();
    corner.leg = std::min(
        {kLegByRadius * MeanTemplateRadius(sweep_, static_cast<double>(k + 1)),
         leg_by_bone * length_before,
         leg_by_bone * length_after});
    corner.range_before = corner.leg / length_before;
    corner.range_after = corner.leg / length_after;
    const ShortestTurn turn =
        TurnOnto(corner.direction_before, corner.direction_after);
    corner.hinge_in_world = turn.axis;
    corner.cos_bend = turn.cosine;
    corner.sin_bend = turn.sine;
  }
}

// `target_frames`: per bone the frame of the joint it starts at, which is the
// frame wanted at the bone's end.
void SweepAxis::CarryFrames(const std::vector<Eigen::Matrix3d>& target_frames) {
  const std::size_t last = bones_.size() - 1;
  for (std::size_t k = 0; k <= last; ++k) {
    Bone& bone = bones_[k];
    if (k > 0) {
      const Corner& corner = corners_[k - 1];
      bone.world_from_start =
          RotationAbout(
              corner.hinge_in_world, corner.cos_bend, corner.sin_bend) *
          target_frames[k - 1];
    }
    bone.twist = TwistBetween(bone.world_from_start, target_frames[k]);
  }
  if (sweep_.rigid_end) {
    if (last > 0) bones_[last - 1].twist += bones_[last].twist;
    bones_[last].twist = 0;
    bones_[last].world_from_start = target_frames[last];
  }
}

SectionFrame SweepAxis::OnAxis(double u) const {
  const int last = static_cast<int>(bones_.size()) - 1;
  const int bone = static_cast<int>(std::clamp(std::floor(u), 0.0, 1.0 * last));
  const double fraction = u - bone;
  if (bone < last && fraction > 1 - corners_[bone].range_before) {
    return InCorner(bone, u);
  }
  if (bone > 0 && fraction < corners_[bone - 1].range_after) {
    return InCorner(bone - 1, u);
  }
  return OnBone(bone, fraction);
}

SectionFrame SweepAxis::At(double u) const {
  SectionFrame section = OnAxis(u);
  section.center_in_world +=
      section.world_from_section.leftCols<2>() * CenterOffset(sweep_, u);
  return section;
}

SectionFrame SweepAxis::OnBone(int index, double fraction) const {
  const Bone& bone = bones_[index];
  return {bone.start_in_world + fraction * bone.along_in_world,
          Twisted(bone.world_from_start,
                  bone.twist * std::clamp(fraction, 0.0, 1.0))};
}

// With s the parameter of the Bezier curve, the tangent is (1 - s) before +
// s after, so it turns in the plane of the two bones, about the hinge; so does
// a frame carried without twist.
SectionFrame SweepAxis::InCorner(int index, double u) const {
  const Corner& corner = corners_[index];
  const double from_joint = u - (index + 1);
  const bool is_before = from_joint < 0;
  const double s =
      0.5 +
      0.5 * from_joint / (is_before ? corner.range_before : corner.range_after);

  double cosine = (1 - s) + s * corner.cos_bend;
  double sine = s * corner.sin_bend;
  const double norm = std::hypot(cosine, sine);
  // Bones folded flat onto each other leave no tangent at the tip: half way.
  cosine = norm > 0 ? cosine / norm : 0;
  sine = norm > 0 ? sine / norm : 1;

  // Both halves start from the frame that ends the bone before.
  const Bone& before = bones_[index];
  const Bone& after = bones_[index + 1];
  const double twist = is_before ? before.twist * (1 + from_joint)
                                 : before.twist + after.twist * from_joint;
  return {corner.joint_in_world +
              corner.leg * (s * s * corner.direction_after -
                            (1 - s) * (1 - s) * corner.direction_before),
          RotationAbout(corner.hinge_in_world, cosine, sine) *
              Twisted(before.world_from_start, twist)};
}

}  // namespace sweepfit
