// SPDX-License-Identifier: Apache-2.0
#include "model/foot_lock.h"

#include <glog/logging.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>

#include "model/joint_limits.h"
#include "model/smooth_step.h"

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

// Frames [begin, end).
struct Interval {
  int begin, end;
};

std::vector<Interval> Runs(const std::vector<bool>& flags) {
  std::vector<Interval> runs;
  for (int t = 0; t < static_cast<int>(flags.size()); ++t) {
    if (!flags[t]) continue;
    if (runs.empty() || runs.back().end != t) runs.push_back({t, t});
    runs.back().end = t + 1;
  }
  return runs;
}

// Beyond the ends values go on as they come, mirrored in the end, so that
// speeds there are not halved.
std::vector<double> Gaussian(const std::vector<double>& values, double sigma) {
  const int num = static_cast<int>(values.size());
  const int reach = std::min(static_cast<int>(std::ceil(3 * sigma)), num - 1);
  const auto at = [&](int k) {
    if (k < 0) return 2 * values.front() - values[-k];
    if (k >= num) return 2 * values.back() - values[2 * (num - 1) - k];
    return values[k];
  };
  std::vector<double> smooth(num);
  for (int t = 0; t < num; ++t) {
    double sum = 0, weights = 0;
    for (int k = t - reach; k <= t + reach; ++k) {
      const double z = sigma > 0 ? (k - t) / sigma : 0;
      const double weight = std::exp(-0.5 * z * z);
      sum += weight * at(k);
      weights += weight;
    }
    smooth[t] = sum / weights;
  }
  return smooth;
}

// The lowest value within `reach` frames.
std::vector<double> Lowest(const std::vector<double>& values, int reach) {
  const int num = static_cast<int>(values.size());
  std::vector<double> lowest(num);
  std::deque<int> rising;  // frames whose values ascend, the lowest first
  int next = 0;
  for (int t = 0; t < num; ++t) {
    for (; next < std::min(num, t + reach + 1); ++next) {
      while (!rising.empty() && values[rising.back()] >= values[next]) {
        rising.pop_back();
      }
      rising.push_back(next);
    }
    while (rising.front() < t - reach) rising.pop_front();
    lowest[t] = values[rising.front()];
  }
  return lowest;
}

// ------------------------------------------------------------ one foot

struct FootPose {
  Vector3d ankle_in_world;
  Quaterniond world_from_ankle;

  Vector3d operator*(const Vector3d& point) const {
    return ankle_in_world + world_from_ankle * point;
  }
};

// Turns a foot until heel and ball are level; its heading stays.
Quaterniond Flat(const FootShape& foot, const Quaterniond& world_from_ankle) {
  const Vector3d along = world_from_ankle * (foot.ball - foot.heel);
  const Vector3d level(along.x(), 0, along.z());
  if (level.norm() < 0.1 * along.norm()) return world_from_ankle;
  const Quaterniond pitched =
      Quaterniond::FromTwoVectors(along, level) * world_from_ankle;
  // The roll about the line from heel to ball that brings the foot's own
  // vertical upright.
  const Vector3d axis = level.normalized();
  Vector3d up = pitched * Vector3d::UnitY();
  up -= up.dot(axis) * axis;
  return Quaterniond::FromTwoVectors(up, Vector3d::UnitY()) * pitched;
}

Quaterniond Mean(const std::vector<Quaterniond>& rotations) {
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  for (const Quaterniond& q : rotations) {
    sum += (q.dot(rotations.front()) < 0 ? -1.0 : 1.0) * q.coeffs();
  }
  return Quaterniond(Eigen::Vector4d(sum.normalized()));
}

// Where a foot goes when it does not slide.
class FootPath {
  // In leg lengths: from the motion, and from the hip while the foot comes or
  // leaves. The root sinks for a leg that is short.
  static constexpr double kFurthest = 0.1;
  static constexpr double kStretch = 1.012;

 public:
  FootPath(const FootShape& foot,
           const FootContact& contact,
           double frame_time,
           double leg_length,
           const std::vector<Vector3d>& hip_in_world,
           std::vector<FootPose> free)
      : foot_(foot),
        contact_(contact),
        leg_length_(leg_length),
        hip_in_world_(hip_in_world),
        free_(std::move(free)) {
    const int num = static_cast<int>(free_.size());
    ramp_ = std::max(1.0, 0.12 / frame_time);
    correction_.assign(num, Vector3d::Zero());
    fixed_ = free_;
    std::vector<Interval> stances = Runs(contact.stance);
    for (Interval& stance : stances) Hold(&stance);
    Bridge(stances);
    for (int t = 0; t < num; ++t) {
      fixed_[t].ankle_in_world += correction_[t];
      // Nothing goes through the floor.
      const double lowest = (fixed_[t] * Lowest(t)).y();
      if (lowest < 0) fixed_[t].ankle_in_world.y() -= lowest;
    }
  }

  const std::vector<FootPose>& fixed() const { return fixed_; }

 private:
  // The point of the sole that is lowest as the foot is turned in a frame.
  const Vector3d& Lowest(int frame) const {
    const Vector3d up =
        fixed_[frame].world_from_ankle.conjugate() * Vector3d::UnitY();
    return *std::min_element(
        foot_.sole.begin(),
        foot_.sole.end(),
        [&](const auto& a, const auto& b) { return a.dot(up) < b.dot(up); });
  }

  // The place of one stance, and the corrections that keep the foot there.
  // Shortens the stance to where they are small.
  void Hold(Interval* stance) {
    std::vector<int> flat;  // frames
    for (int t = stance->begin; t < stance->end; ++t) {
      if (contact_.heel[t] && contact_.ball[t]) flat.push_back(t);
    }
    std::vector<Vector3d> place(free_.size());  // of the ankle
    int rest = (stance->begin + stance->end) / 2;
    if (flat.empty()) {
      // On heel or toes only.
      const Vector3d point = free_[rest] * Lowest(rest);
      place[rest] = free_[rest].ankle_in_world + OnFloor(point) - point;
    } else {
      const Quaterniond level = Flat(foot_, MeanRotation(flat));
      Flatten(*stance, level);
      rest = flat[flat.size() / 2];
      Vector3d middle = Vector3d::Zero();
      for (const int t : flat) middle += free_[t] * Middle();
      middle = OnFloor(middle / static_cast<double>(flat.size()));
      place[rest] = middle - fixed_[rest].world_from_ankle * Middle();
      place[rest].y() =
          middle.y() - (fixed_[rest].world_from_ankle * Lowest(rest)).y();
    }
    const auto roll = [&](int from, int to) {
      const Vector3d& point = Lowest(from);
      place[to] = place[from] + fixed_[from].world_from_ankle * point -
                  fixed_[to].world_from_ankle * point;
      // The next point may have come down.
      place[to].y() += (fixed_[to].world_from_ankle * (point - Lowest(to))).y();
    };
    for (int t = rest + 1; t < stance->end; ++t) roll(t - 1, t);
    for (int t = rest - 1; t >= stance->begin; --t) roll(t + 1, t);

    for (int t = stance->begin; t < stance->end; ++t) {
      correction_[t] = place[t] - free_[t].ankle_in_world;
    }
    const auto far = [&](int t) {
      const bool coming = !contact_.heel[t] && !contact_.ball[t];
      return (correction_[t] - correction_[rest]).norm() >
                 kFurthest * leg_length_ ||
             (coming &&
              (place[t] - hip_in_world_[t]).norm() > kStretch * leg_length_);
    };
    int begin = rest, end = rest + 1;
    while (begin > stance->begin && !far(begin - 1)) --begin;
    while (end < stance->end && !far(end)) ++end;
    *stance = {begin, end};
  }

  // Of the frames in which the foot is level; it may roll in and out of it.
  Quaterniond MeanRotation(const std::vector<int>& frames) const {
    constexpr double kLevel = 5 * std::numbers::pi / 180;
    std::vector<Quaterniond> chosen;
    for (const int t : frames) chosen.push_back(free_[t].world_from_ankle);
    Quaterniond mean = Mean(chosen);
    for (int round = 0; round < 2; ++round) {
      chosen.clear();
      for (const int t : frames) {
        if (free_[t].world_from_ankle.angularDistance(mean) < kLevel) {
          chosen.push_back(free_[t].world_from_ankle);
        }
      }
      if (chosen.empty()) break;
      mean = Mean(chosen);
    }
    return mean;
  }

  // Holds the foot level while the motion nearly does; it follows the motion
  // where that turns it further, and before and after.
  void Flatten(const Interval& stance, const Quaterniond& level) {
    constexpr double kDegree = std::numbers::pi / 180;
    const int num = static_cast<int>(free_.size());
    const int reach = static_cast<int>(std::ceil(ramp_));
    const int begin = std::max(0, stance.begin - reach);
    const int end = std::min(num, stance.end + reach);
    for (int t = begin; t < end; ++t) {
      const double away = std::max({0, stance.begin - t, t + 1 - stance.end});
      const double turned =
          free_[t].world_from_ankle.angularDistance(level) / kDegree;
      const double weight =
          SmoothStep(1 - away / ramp_) * SmoothStep((10 - turned) / 7);
      fixed_[t].world_from_ankle =
          fixed_[t].world_from_ankle.slerp(weight, level);
    }
  }

  Vector3d Middle() const { return (foot_.heel + foot_.ball) / 2; }

  // The floor, unless the foot clearly stands on something else.
  Vector3d OnFloor(Vector3d point) const {
    constexpr double kStep = 0.06;  // metres
    if (std::abs(point.y()) < kStep) point.y() = 0;
    return point;
  }

  // Between stances the correction passes from the last to the next.
  void Bridge(const std::vector<Interval>& stances) {
    const int num = static_cast<int>(free_.size());
    for (std::size_t i = 0; i <= stances.size(); ++i) {
      if (stances.empty()) return;
      const int begin = i == 0 ? 0 : stances[i - 1].end;
      const int end = i == stances.size() ? num : stances[i].begin;
      const Vector3d before =
          correction_[i == 0 ? stances[0].begin : begin - 1];
      const Vector3d after = i == stances.size() ? before : correction_[end];
      for (int t = begin; t < end; ++t) {
        const double share =
            SmoothStep((t - begin + 1.0) / (end - begin + 1.0));
        correction_[t] = (1 - share) * before + share * after;
      }
    }
  }

  const FootShape& foot_;
  const FootContact& contact_;
  double leg_length_;
  const std::vector<Vector3d>& hip_in_world_;
  std::vector<FootPose> free_;
  double ramp_ = 1;  // frames
  std::vector<Vector3d> correction_;
  std::vector<FootPose> fixed_;
};

// ----------------------------------------------------------------- legs

// How far the root must sink for a straight leg to reach the ankle.
double SinkToReach(const Vector3d& hip, const Vector3d& ankle, double reach) {
  const Vector3d to_ankle = ankle - hip;
  if (to_ankle.norm() <= reach) return 0;
  const double across = std::hypot(to_ankle.x(), to_ankle.z());
  if (across >= reach) return std::max(0.0, -to_ankle.y());
  return -to_ankle.y() - std::sqrt(reach * reach - across * across);
}

// The angle about `axis` that turns a bone until its direction has the dot
// product `wanted` with `along`; of two the one that leaves it bent further
// about the axis.
double HingeAngle(const Vector3d& axis,
                  const Vector3d& along,
                  const Vector3d& bone,
                  double wanted) {
  // along . R(b) bone = p cos b + q sin b + r
  const double r = along.dot(axis) * axis.dot(bone);
  const double p = along.dot(bone) - r;
  const double q = along.dot(axis.cross(bone));
  const double size = std::hypot(p, q);
  if (size < 1e-9) return 0;
  const double middle = std::atan2(q, p);
  const double spread = std::acos(std::clamp((wanted - r) / size, -1.0, 1.0));
  return middle + spread;
}

// Puts the ankle where it should be, in the plane in which the knee bends.
void ReachAnkle(const Skeleton& skeleton,
                const Vector3d& knee_axis,
                int hip,
                const FootPose& foot,
                Pose* pose) {
  const int knee = hip + 1, ankle = hip + 2;
  const JointFrames frames = ForwardKinematics(skeleton, *pose);
  const double thigh = skeleton.length[knee], shank = skeleton.length[ankle];
  const Vector3d& along = skeleton.rest_direction[knee];
  const Vector3d to_ankle = foot.ankle_in_world - frames.joint_in_world[hip];
  const double distance = std::clamp(
      to_ankle.norm(), std::abs(thigh - shank) + 1e-3 * thigh, thigh + shank);
  const double wanted = (distance * distance - thigh * thigh - shank * shank) /
                        (2 * thigh * shank);
  Quaterniond& bend = pose->rotation[knee];
  const Vector3d bone = bend * skeleton.rest_direction[ankle];
  bend = Quaterniond(Eigen::AngleAxisd(
             HingeAngle(knee_axis, along, bone, wanted), knee_axis)) *
         bend;
  const Vector3d reached =
      frames.world_from_joint[hip] *
      (thigh * along + shank * (bend * skeleton.rest_direction[ankle]));
  const Quaterniond world_from_hip =
      Quaterniond::FromTwoVectors(reached, to_ankle) *
      Quaterniond(frames.world_from_joint[hip]);
  const Quaterniond world_from_root(frames.world_from_joint[kRoot]);
  pose->rotation[hip] =
      (world_from_root.conjugate() * world_from_hip).normalized();
  bend.normalize();
  pose->rotation[ankle] =
      ((world_from_hip * bend).conjugate() * foot.world_from_ankle)
          .normalized();
}

}  // namespace

namespace {

// The vertices on which a foot stands for pitches up to 80 degrees and rolls up
// to 40, from the ankle.
std::vector<Vector3d> SoleOf(const std::vector<Vector3d>& vertices,
                             const Vector3d& ankle) {
  std::vector<Vector3d> sole;
  if (vertices.empty()) return sole;
  constexpr double kDegree = std::numbers::pi / 180;
  for (int pitch = -80; pitch <= 80; pitch += 5) {
    for (int roll = -40; roll <= 40; roll += 10) {
      const Vector3d down(std::sin(roll * kDegree),
                          -std::cos(roll * kDegree) * std::cos(pitch * kDegree),
                          std::cos(roll * kDegree) * std::sin(pitch * kDegree));
      const Vector3d furthest =
          *std::max_element(vertices.begin(),
                            vertices.end(),
                            [&](const Vector3d& a, const Vector3d& b) {
                              return a.dot(down) < b.dot(down);
                            }) -
          ankle;
      if (std::find(sole.begin(), sole.end(), furthest) == sole.end()) {
        sole.push_back(furthest);
      }
    }
  }
  return sole;
}

}  // namespace

std::array<FootShape, 2> MeasureFeet(const Body& body) {
  const std::vector<Vector3d> rest = RestVertices(body);
  const JointFrames frames = RestFrames(body.skeleton);
  std::array<FootShape, 2> feet;
  for (int side = 0; side < 2; ++side) {
    const int ankle = side == 0 ? kLAnkle : kRAnkle;
    const BodyPart part = side == 0 ? BodyPart::kLFoot : BodyPart::kRFoot;
    const Vector3d& toe = frames.joint_in_world[ankle + 1];
    // A body without feet stands on the ends of its bones.
    Eigen::AlignedBox3d box(frames.joint_in_world[ankle]);
    box.extend(toe);
    std::vector<Vector3d> vertices;
    for (int v = 0; v < body.num_vertices(); ++v) {
      if (body.topology.part[v] != part) continue;
      vertices.push_back(rest[v]);
      box.extend(rest[v]);
    }
    const double length = box.sizes().z();
    const auto sole_at = [&](double from, double to) {
      Vector3d sum = Vector3d::Zero();
      int count = 0;
      for (const Vector3d& vertex : vertices) {
        const double share = (vertex.z() - box.min().z()) / length;
        if (share < from || share > to ||
            vertex.y() > box.min().y() + 0.1 * length) {
          continue;
        }
        sum += vertex;
        ++count;
      }
      Vector3d point = count > 0
                           ? Vector3d(sum / count)
                           : Vector3d(frames.joint_in_world[ankle].x(),
                                      0,
                                      box.min().z() + (from + to) / 2 * length);
      point.y() = box.min().y();
      return Vector3d(point - frames.joint_in_world[ankle]);
    };
    feet[side].heel = sole_at(0, 0.2);
    feet[side].ball = sole_at(0.7, 0.9);
    feet[side].sole = SoleOf(vertices, frames.joint_in_world[ankle]);
    if (vertices.empty()) feet[side].sole = {feet[side].heel, feet[side].ball};
  }
  return feet;
}

std::vector<bool> FindStanding(const std::vector<Vector3d>& point,
                               double frame_time,
                               double leg_length,
                               double most_speed) {
  const int num = static_cast<int>(point.size());
  std::vector<bool> stands(num, false);
  if (num == 0) return stands;
  // Smoothed over about 20 ms against the noise of motion capture.
  const double sigma = 0.02 / frame_time;
  std::array<std::vector<double>, 3> smooth;
  for (int i = 0; i < 3; ++i) {
    std::vector<double> values(num);
    for (int t = 0; t < num; ++t) values[t] = point[t][i];
    smooth[i] = Gaussian(values, sigma);
  }
  const std::vector<double> lowest =
      Lowest(smooth[1], static_cast<int>(std::ceil(0.6 / frame_time)));
  constexpr double kSlow = 0.25;  // leg lengths per second
  std::vector<bool> slow(num, false);
  for (int t = 0; t < num; ++t) {
    const int before = std::max(0, t - 1), after = std::min(num - 1, t + 1);
    double speed = 0;
    if (after > before) {
      speed = std::hypot(smooth[0][after] - smooth[0][before],
                         smooth[1][after] - smooth[1][before],
                         smooth[2][after] - smooth[2][before]) /
              ((after - before) * frame_time * leg_length);
    }
    const bool low = smooth[1][t] < lowest[t] + 0.04 * leg_length;
    stands[t] = low && speed < most_speed;
    slow[t] = low && speed < kSlow;
  }
  for (const Interval& run : Runs(stands)) {
    if (std::find(slow.begin() + run.begin, slow.begin() + run.end, true) ==
        slow.begin() + run.end) {
      std::fill(stands.begin() + run.begin, stands.begin() + run.end, false);
    }
  }
  // Close short breaks, then drop short stances.
  std::vector<bool> moving(num);
  for (int t = 0; t < num; ++t) moving[t] = !stands[t];
  for (const Interval& gap : Runs(moving)) {
    if (gap.begin == 0 || gap.end == num) continue;
    if ((gap.end - gap.begin) * frame_time < 0.05) {
      std::fill(stands.begin() + gap.begin, stands.begin() + gap.end, true);
    }
  }
  for (const Interval& run : Runs(stands)) {
    if ((run.end - run.begin) * frame_time < 0.08 &&
        run.end - run.begin < num) {
      std::fill(stands.begin() + run.begin, stands.begin() + run.end, false);
    }
  }
  return stands;
}

std::array<FootPoints, 2> FootPointsOf(const JointFrames& frames,
                                       const std::array<FootShape, 2>& feet) {
  std::array<FootPoints, 2> points;
  for (int side = 0; side < 2; ++side) {
    const int ankle = side == 0 ? kLAnkle : kRAnkle;
    const Matrix3d& rotation = frames.world_from_joint[ankle];
    points[side].heel =
        frames.joint_in_world[ankle] + rotation * feet[side].heel;
    points[side].ball =
        frames.joint_in_world[ankle] + rotation * feet[side].ball;
  }
  return points;
}

double LongestSlide(const std::vector<Vector3d>& point,
                    const std::vector<bool>& stands) {
  CHECK_EQ(point.size(), stands.size());
  // The diameter of a set of points is its greatest extent in any direction;
  // 32 of them miss less than .2 %.
  constexpr int kDirections = 32;
  double longest = 0;
  for (const Interval& run : Runs(stands)) {
    for (int i = 0; i < kDirections; ++i) {
      const double angle = std::numbers::pi * i / kDirections;
      const Vector3d direction(std::cos(angle), 0, std::sin(angle));
      double low = point[run.begin].dot(direction), high = low;
      for (int t = run.begin; t < run.end; ++t) {
        low = std::min(low, point[t].dot(direction));
        high = std::max(high, point[t].dot(direction));
      }
      longest = std::max(longest, high - low);
    }
  }
  return longest;
}

void LockFeet(const Skeleton& skeleton,
              const std::array<FootShape, 2>& feet,
              const std::array<FootContact, 2>& contact,
              double frame_time,
              std::vector<Pose>* poses) {
  const int num = static_cast<int>(poses->size());
  std::array<std::vector<FootPose>, 2> free;
  std::array<std::vector<Vector3d>, 2> hip_in_world;
  for (const Pose& pose : *poses) {
    const JointFrames frames = ForwardKinematics(skeleton, pose);
    for (int side = 0; side < 2; ++side) {
      const int hip = side == 0 ? kLHip : kRHip;
      hip_in_world[side].push_back(frames.joint_in_world[hip]);
      free[side].push_back({frames.joint_in_world[hip + 2],
                            Quaterniond(frames.world_from_joint[hip + 2])});
    }
  }
  std::array<std::vector<FootPose>, 2> fixed;
  // The root sinks as far as the leg that is further from its ankle asks for,
  // and smoothly.
  constexpr double kReach = 0.999;  // of a leg that is quite straight
  std::vector<double> sink(num, 0.0);
  for (int side = 0; side < 2; ++side) {
    const int hip = side == 0 ? kLHip : kRHip;
    const double leg = skeleton.length[hip + 1] + skeleton.length[hip + 2];
    fixed[side] = FootPath(feet[side],
                           contact[side],
                           frame_time,
                           leg,
                           hip_in_world[side],
                           free[side])
                      .fixed();
    const double reach = kReach * leg;
    for (int t = 0; t < num; ++t) {
      sink[t] = std::max(
          sink[t],
          SinkToReach(
              hip_in_world[side][t], fixed[side][t].ankle_in_world, reach));
    }
  }
  constexpr double kSigma = 0.06;  // seconds
  const int reach = static_cast<int>(std::ceil(2 * kSigma / frame_time));
  std::vector<double> deepest(num);
  for (int t = 0; t < num; ++t) {
    const auto begin = sink.begin() + std::max(0, t - reach);
    const auto end = sink.begin() + std::min(num, t + reach + 1);
    deepest[t] = *std::max_element(begin, end);
  }
  deepest = Gaussian(deepest, kSigma / frame_time);

  const JointLimits limits(skeleton);
  for (int t = 0; t < num; ++t) {
    Pose& pose = (*poses)[t];
    pose.root_in_world.y() -= deepest[t];
    for (int side = 0; side < 2; ++side) {
      const int hip = side == 0 ? kLHip : kRHip;
      ReachAnkle(skeleton,
                 limits.limit(hip + 1)->bend_axis,
                 hip,
                 fixed[side][t],
                 &pose);
    }
  }
}

}  // namespace sweepfit
