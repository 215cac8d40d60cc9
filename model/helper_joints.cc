// SPDX-License-Identifier: Apache-2.0
#include "model/helper_joints.h"

#include <glog/logging.h>

#include <algorithm>
#include <cmath>

namespace sweepfit {
namespace {

std::vector<SweepAxis> MakeAxes(const Body& body, const JointFrames& frames) {
  std::vector<SweepAxis> axes;
  axes.reserve(body.sweeps.size());
  for (const Sweep& sweep : body.sweeps) {
    axes.emplace_back(sweep, body.skeleton, frames);
  }
  return axes;
}

RigidMotion MotionBetween(const SectionFrame& from, const SectionFrame& to) {
  const Eigen::Matrix3d rotation =
      to.world_from_section * from.world_from_section.transpose();
  return {rotation, to.center_in_world - rotation * from.center_in_world};
}

// The sweep whose chain holds the joint inside, and where: -1 if none.
std::pair<int, double> FindJointOnSweep(const Body& body, int joint) {
  for (std::size_t s = 0; s < body.sweeps.size(); ++s) {
    const std::vector<int>& chain = body.sweeps[s].chain;
    for (std::size_t k = 0; k + 1 < chain.size(); ++k) {
      if (chain[k] == joint) {
        return {static_cast<int>(s), static_cast<double>(k)};
      }
    }
  }
  return {-1, 0};
}

}  // namespace

std::vector<HelperJoint> MakeHelperJoints(const Body& body) {
  const JointFrames rest = RestFrames(body.skeleton);
  const std::vector<SweepAxis> axes = MakeAxes(body, rest);
  std::vector<HelperJoint> helpers;
  const auto add = [&](int joint,
                       const char* suffix,
                       std::vector<HelperJoint::Source> sources) {
    HelperJoint helper;
    helper.name = std::string(kJointNames[joint]) + suffix;
    helper.parent = joint;
    const HelperJoint::Source& at = sources.back();
    helper.joint_in_rest = axes[at.sweep].OnAxis(at.u).center_in_world;
    helper.sources = std::move(sources);
    helpers.push_back(std::move(helper));
  };
  for (std::size_t i = 0; i < body.sweeps.size(); ++i) {
    const int s = static_cast<int>(i);
    const Sweep& sweep = body.sweeps[i];
    const int first = sweep.chain.front();
    const bool is_limb = first != kRoot && sweep.num_bones() > 1;
    if (is_limb) {
      add(first, "_swing", {{s, 0, 1}});
      const auto [parent_sweep, parent_u] =
          FindJointOnSweep(body, kJointParents[first]);
      if (parent_sweep >= 0) {
        const double near = 0.5;
        add(first,
            "_blend",
            {{parent_sweep, parent_u, 1 - near}, {s, 0, near}});
      }
    }
    for (int k = 0; k < sweep.num_bones(); ++k) {
      const int joint = sweep.chain[k];
      if (k > 0) add(joint, "_half", {{s, static_cast<double>(k), 1}});
      // The last bone of a limb is rigid; short bones need no middle.
      const bool is_last = k + 1 == sweep.num_bones();
      if (is_last && (sweep.rigid_end || !is_limb)) continue;
      if (sweep.num_bones() > 1 &&
          body.skeleton.length[sweep.chain[k + 1]] > 0.03 * body.stature) {
        add(joint, "_twist", {{s, k + 0.5, 1}});
      }
    }
  }
  return helpers;
}

JointMotions::JointMotions(const Body& body,
                           const std::vector<HelperJoint>& helpers)
    : body_(body),
      helpers_(helpers),
      rest_(RestFrames(body.skeleton)),
      rest_axes_(MakeAxes(body, rest_)) {}

std::vector<RigidMotion> JointMotions::At(const Pose& pose) const {
  std::vector<RigidMotion> motions = AtWithoutHelpers(pose);
  if (helpers_.empty()) return motions;
  const std::vector<SweepAxis> axes =
      MakeAxes(body_, ForwardKinematics(body_.skeleton, pose));
  for (std::size_t h = 0; h < helpers_.size(); ++h) {
    MotionBlend blend;
    for (const HelperJoint::Source& source : helpers_[h].sources) {
      blend.Add(source.weight,
                MotionBetween(rest_axes_[source.sweep].OnAxis(source.u),
                              axes[source.sweep].OnAxis(source.u)));
    }
    motions[kNumJoints + h] = blend.Normalized();
  }
  return motions;
}

std::vector<RigidMotion> JointMotions::AtWithoutHelpers(
    const Pose& pose) const {
  const JointFrames posed = ForwardKinematics(body_.skeleton, pose);
  std::vector<RigidMotion> motions(kNumJoints + helpers_.size());
  for (int j = 0; j < kNumJoints; ++j) {
    motions[j].rotation =
        posed.world_from_joint[j] * rest_.world_from_joint[j].transpose();
    motions[j].translation =
        posed.joint_in_world[j] - motions[j].rotation * rest_.joint_in_world[j];
  }
  for (std::size_t h = 0; h < helpers_.size(); ++h) {
    motions[kNumJoints + h] = motions[helpers_[h].parent];
  }
  return motions;
}

}  // namespace sweepfit
