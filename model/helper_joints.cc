// SPDX-License-Identifier: Apache-2.0
#include "model/helper_joints.h"

#include <glog/logging.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "model/joint_limits.h"

namespace sweepfit {
namespace {

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

double MeanRadius(const Sweep& sweep, double u) {
  constexpr int kNum = 24;
  double sum = 0;
  for (int i = 0; i < kNum; ++i) {
    sum += Radius(sweep, u, 2 * std::numbers::pi * i / kNum);
  }
  return sum / kNum;
}

// A piece of skin near joint k of a chain: so far from the joint along the
// bones in radii of the limb there, on one side of it.
struct SkinPatch {
  const char* suffix;
  double begin;  // negative: before the joint
  double end;
  Eigen::Vector3d side;
  // The vertices of a patch belong to the sweep by a weight in this range.
  double min_weight = 0.4;
  double max_weight = 1;
  double half_width = 0.8;  // radians around the limb
};

std::vector<int> FindSkin(const Body& body,
                          const std::vector<Eigen::Vector3d>& rest_vertices,
                          const SweepAxis& rest_axis,
                          int sweep_index,
                          int k,
                          const SkinPatch& patch) {
  const Sweep& sweep = body.sweeps[sweep_index];
  const double radius = MeanRadius(sweep, k);
  std::vector<int> skin;
  for (int v = 0; v < body.num_vertices(); ++v) {
    for (const SweepAttachment& a : body.binding[v].attachment) {
      if (a.sweep != sweep_index || a.weight < patch.min_weight ||
          a.weight > patch.max_weight) {
        continue;
      }
      const int bone = a.u < k ? k - 1 : k;
      if (bone < 0) continue;
      const double distance =
          (a.u - k) * body.skeleton.length[sweep.chain[bone + 1]] / radius;
      if (distance < patch.begin || distance > patch.end) continue;
      const SectionFrame section = rest_axis.OnAxis(a.u);
      const Eigen::Vector3d tangent = section.world_from_section.col(2);
      const auto across = [&tangent](const Eigen::Vector3d& direction) {
        return (direction - direction.dot(tangent) * tangent).normalized();
      };
      const Eigen::Vector3d out =
          across(rest_vertices[v] - section.center_in_world);
      if (out.dot(across(patch.side)) > std::cos(patch.half_width)) {
        skin.push_back(v);
      }
      break;
    }
  }
  return skin;
}

// The chain folds over itself at joint k: not at its start, the neck or the
// head, or where its rigid end begins.
bool FoldsAt(const Sweep& sweep, int k) {
  if (sweep.chain.front() == kRoot) return sweep.chain[k] == kSpine;
  return k > 0 && k + (sweep.rigid_end ? 1 : 0) < sweep.num_bones();
}

// Where skin moves as no section does: it is pressed back where a limb folds
// over itself, the further from the joint the deeper the fold; drawn over the
// tip of a bend; and stretched or closed where a limb leaves the trunk.
std::vector<SkinPatch> PatchesAtJoint(const Sweep& sweep,
                                      int k,
                                      const JointLimit& limit) {
  const Eigen::Vector3d& inner = limit.towards;
  const bool is_limb = sweep.chain.front() != kRoot && sweep.num_bones() > 1;
  if (is_limb && k == 0) {
    const bool is_left = MirrorJoint(sweep.chain[0]) > sweep.chain[0];
    const Eigen::Vector3d medial(is_left ? -1 : 1, 0, 0);
    return {{"_fold_after", 0.2, 1.1, inner},
            {"_pit", 0.9, 2.0, medial},
            {"_hollow", 0.2, 1.6, medial, 0.1, 0.4},
            {"_rear", 0.2, 1.4, -inner}};
  }
  if (!FoldsAt(sweep, k)) return {};
  if (!is_limb) {
    // The waist is broad: its fold is deep in front and shallow at the flanks.
    const Eigen::Vector3d left =
        0.5 * inner.normalized() + Eigen::Vector3d(0.9, 0, 0);
    const Eigen::Vector3d right = left.cwiseProduct(Eigen::Vector3d(-1, 1, 1));
    // Belly that stands out is pressed back steeply: its creases are narrow.
    const Eigen::Vector3d left_front =
        inner.normalized() + Eigen::Vector3d(1, 0, 0);
    const Eigen::Vector3d right_front =
        left_front.cwiseProduct(Eigen::Vector3d(-1, 1, 1));
    return {{"_fold_before", -0.6, 0, inner, 0.4, 1, 0.5},
            {"_fold_before_far", -1.3, -0.5, inner},
            {"_fold_after", 0.2, 1.1, inner},
            {"_fold_before_left", -0.8, 0, left},
            {"_fold_before_right", -0.8, 0, right},
            {"_fold_after_left", 0, 0.8, left},
            {"_fold_after_right", 0, 0.8, right},
            {"_crease", 0.1, 0.6, inner, 0.4, 1, 0.5},
            {"_crease_left", 0.1, 0.5, left_front, 0.4, 1, 0.35},
            {"_crease_right", 0.1, 0.5, right_front, 0.4, 1, 0.35}};
  }
  // Flesh pressed out of a bend swells to both sides along the hinge.
  const bool is_left = MirrorJoint(sweep.chain[0]) > sweep.chain[0];
  const Eigen::Vector3d hinge = (is_left ? 1 : -1) * limit.bend_axis;
  return {{"_fold_before_far", -2.4, -1.3, inner},
          {"_fold_before", -1.1, -0.2, inner},
          {"_fold_after", 0.2, 1.1, inner},
          {"_fold_after_far", 1.3, 2.4, inner},
          {"_tip", -0.9, 0.1, -inner},
          {"_tip_after", -0.1, 0.9, -inner},
          {"_side", 0.2, 1.4, hinge, 0.4, 1, 0.6},
          {"_side_other", 0.2, 1.4, -hinge, 0.4, 1, 0.6}};
}

// The rigid motion that carries points nearest to others (Kabsch 1976, Umeyama
// 1991).
RigidMotion NearestMotion(const std::vector<int>& vertices,
                          const std::vector<Eigen::Vector3d>& from,
                          const std::vector<Eigen::Vector3d>& to) {
  Eigen::Vector3d from_mean(0, 0, 0), to_mean(0, 0, 0);
  for (const int v : vertices) {
    from_mean += from[v];
    to_mean += to[v];
  }
  from_mean /= static_cast<double>(vertices.size());
  to_mean /= static_cast<double>(vertices.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const int v : vertices) {
    covariance += (to[v] - to_mean) * (from[v] - from_mean).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign(1, 1, 1);
  sign.z() = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const Eigen::Matrix3d rotation =
      svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  return {rotation, to_mean - rotation * from_mean};
}

bool RideOnSkin(const std::vector<HelperJoint>& helpers) {
  return std::any_of(helpers.begin(), helpers.end(), [](const HelperJoint& h) {
    return !h.skin.empty();
  });
}

}  // namespace

std::vector<HelperJoint> MakeHelperJoints(const Body& body) {
  const JointFrames rest = RestFrames(body.skeleton);
  const std::vector<SweepAxis> axes = MakeAxes(body, rest);
  const std::vector<Eigen::Vector3d> rest_vertices = RestVertices(body);
  const JointLimits limits(body.skeleton);
  std::vector<HelperJoint> helpers;
  const auto add_patch = [&](int s, int k, const SkinPatch& patch) {
    const Sweep& sweep = body.sweeps[s];
    const int joint = sweep.chain[k];
    HelperJoint helper;
    helper.skin = FindSkin(body, rest_vertices, axes[s], s, k, patch);
    // Three points hold a motion; a few more make it a patch.
    constexpr std::size_t kFewest = 12;
    if (helper.skin.size() < kFewest) return;
    helper.name = std::string(kJointNames[joint]) + patch.suffix;
    const double middle = (patch.begin + patch.end) / 2;
    const bool is_before = middle < 0;
    helper.joint = joint;
    helper.parent = is_before ? kJointParents[joint] : joint;
    for (const int v : helper.skin) helper.joint_in_rest += rest_vertices[v];
    helper.joint_in_rest /= static_cast<double>(helper.skin.size());
    const int bone_end = sweep.chain[is_before ? k : k + 1];
    helper.sources = {
        {s,
         k + middle * MeanRadius(sweep, k) / body.skeleton.length[bone_end],
         1}};
    helpers.push_back(std::move(helper));
  };
  const auto add = [&](int joint,
                       const char* suffix,
                       std::vector<HelperJoint::Source> sources) {
    HelperJoint helper;
    helper.name = std::string(kJointNames[joint]) + suffix;
    helper.joint = joint;
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
      if (FoldsAt(sweep, k)) {
        const SweepAxis::Corner& corner = axes[s].corner(k - 1);
        add(joint, "_bend_before", {{s, k - corner.range_before / 3, 1}});
        helpers.back().parent = kJointParents[joint];
        add(joint, "_bend_after", {{s, k + corner.range_after / 3, 1}});
      }
      if (k > 0 && (is_limb || !FoldsAt(sweep, k))) {
        add(joint, "_half", {{s, static_cast<double>(k), 1}});
      }
      if (limits.limit(joint)) {
        for (const SkinPatch& patch :
             PatchesAtJoint(sweep, k, *limits.limit(joint))) {
          add_patch(s, k, patch);
        }
      }
      // The last bone of a limb is rigid; short bones need no middle; that of
      // the pelvis moves with the root.
      if (joint == kRoot) continue;
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
      rest_axes_(MakeAxes(body, rest_)) {
  if (!RideOnSkin(helpers)) return;
  own_deformer_ = std::make_unique<BodyDeformer>(body);
  deformer_ = own_deformer_.get();
}

JointMotions::JointMotions(const Body& body,
                           const std::vector<HelperJoint>& helpers,
                           const BodyDeformer& deformer)
    : body_(body),
      helpers_(helpers),
      rest_(RestFrames(body.skeleton)),
      rest_axes_(MakeAxes(body, rest_)),
      deformer_(RideOnSkin(helpers) ? &deformer : nullptr) {}

std::vector<RigidMotion> JointMotions::At(const Pose& pose) const {
  return At(pose,
            deformer_ != nullptr ? deformer_->Vertices(pose)
                                 : std::vector<Eigen::Vector3d>());
}

std::vector<RigidMotion> JointMotions::At(
    const Pose& pose,
    const std::vector<Eigen::Vector3d>& vertices_in_world) const {
  std::vector<RigidMotion> motions = AtWithoutHelpers(pose);
  if (helpers_.empty()) return motions;
  const std::vector<SweepAxis> axes =
      MakeAxes(body_, ForwardKinematics(body_.skeleton, pose));
  for (std::size_t h = 0; h < helpers_.size(); ++h) {
    if (!helpers_[h].skin.empty()) {
      motions[kNumJoints + h] = NearestMotion(
          helpers_[h].skin, deformer_->rest_vertices(), vertices_in_world);
      continue;
    }
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
