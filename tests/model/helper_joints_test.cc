// SPDX-License-Identifier: Apache-2.0
#include "model/helper_joints.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "model/joint_limits.h"
#include "model/lbs.h"
#include "model/mesh.h"
#include "model/self_intersection.h"
#include "model/template.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;
using Vertices = std::vector<Vector3d>;

constexpr double kDegree = std::numbers::pi / 180;

const Body& Person() {
  static const auto* body = new Body(BuildTemplate(TemplateOptions()));
  return *body;
}

const BodyDeformer& Deformer() {
  static const auto* deformer = new BodyDeformer(Person());
  return *deformer;
}

// Triangles that look away from where their vertices' sections have turned.
int CountTurned(const Pose& pose) {
  const Vertices& rest = Deformer().rest_vertices();
  static const auto* triangles = new std::vector<Triangle>(
      TriangulateQuads(Person().topology.quads, rest));
  const std::vector<VertexMotion> motions = Deformer().Motions(pose);
  int count = 0;
  for (const Triangle& t : *triangles) {
    const Vector3d at_rest =
        (rest[t[1]] - rest[t[0]]).cross(rest[t[2]] - rest[t[0]]);
    std::array<Vector3d, 3> x;
    Vector3d expected = Vector3d::Zero();
    for (int i = 0; i < 3; ++i) {
      const VertexMotion& motion = motions[t[i]];
      x[i] = motion.rotation * rest[t[i]] + motion.translation;
      expected += motion.rotation * at_rest;
    }
    count += (x[1] - x[0]).cross(x[2] - x[0]).dot(expected) <= 0;
  }
  return count;
}

TEST(BodyDeformer, NoFaceTurnsOverAtTheJointLimits) {
  const JointLimits limits(Person().skeleton);
  const std::vector<Pose> poses = limits.LimitPoses();
  EXPECT_GT(poses.size(), 100u);
  for (std::size_t p = 0; p < poses.size(); ++p) {
    EXPECT_EQ(CountTurned(poses[p]), 0) << "posture " << p;
  }
}

TEST(BodyDeformer, CutsItselfNoMoreThanSkinningAtTheJointLimits) {
  const SkinWeights plain =
      FitSkinWeights(Person(), kSkinPoses, kSkinSeed, false).weights;
  const std::vector<Triangle> triangles =
      TriangulateQuads(Person().topology.quads, Deformer().rest_vertices());
  const std::vector<Pose> poses = JointLimits(Person().skeleton).LimitPoses();
  for (std::size_t p = 0; p < poses.size(); ++p) {
    const std::size_t sweeps =
        SelfIntersections({Deformer().Vertices(poses[p]), triangles}).size();
    const std::size_t skinning =
        SelfIntersections(
            {PoseVerticesLbs(Person(), plain, poses[p]), triangles})
            .size();
    EXPECT_LE(sweeps, skinning) << "posture " << p;
  }
}

TEST(BodyDeformer, TheSkullTurnsAsOnePiece) {
  const JointLimits limits(Person().skeleton);
  Pose pose;
  pose.rotation[kHead] =
      limits.Rotation(kHead, {20 * kDegree, 10 * kDegree, 40 * kDegree});
  const JointFrames rest = RestFrames(Person().skeleton);
  const JointFrames posed = ForwardKinematics(Person().skeleton, pose);
  const Vertices vertices = Deformer().Vertices(pose);
  int count = 0;
  for (int v = 0; v < Person().num_vertices(); ++v) {
    const Vector3d in_head =
        Deformer().rest_vertices()[v] - rest.joint_in_world[kHead];
    if (Person().topology.part[v] != BodyPart::kHead || in_head.y() < 0) {
      continue;
    }
    const Vector3d expected =
        posed.joint_in_world[kHead] + posed.world_from_joint[kHead] * in_head;
    EXPECT_LT((vertices[v] - expected).norm(), 1e-9) << v;
    ++count;
  }
  EXPECT_GT(count, 500);
}

TEST(HelperJoints, HaveMirrorImagesAndOwnNames) {
  const std::vector<HelperJoint> helpers = MakeHelperJoints(Person());
  std::map<std::string, const HelperJoint*> by_name;
  for (const HelperJoint& helper : helpers) {
    EXPECT_TRUE(by_name.emplace(helper.name, &helper).second) << helper.name;
  }
  for (const HelperJoint& helper : helpers) {
    EXPECT_TRUE(helper.name.starts_with(kJointNames[helper.joint]));
    EXPECT_TRUE(helper.parent == helper.joint ||
                helper.parent == kJointParents[helper.joint])
        << helper.name;
    if (MirrorJoint(helper.joint) == helper.joint) continue;
    std::string other = helper.name;
    other[0] = other[0] == 'l' ? 'r' : 'l';
    ASSERT_TRUE(by_name.contains(other)) << helper.name;
    EXPECT_EQ(by_name[other]->parent, MirrorJoint(helper.parent));
    EXPECT_EQ(by_name[other]->skin.size(), helper.skin.size());
    const Vector3d mirrored =
        by_name[other]->joint_in_rest.cwiseProduct(Vector3d(-1, 1, 1));
    EXPECT_LT((mirrored - helper.joint_in_rest).norm(), 1e-6) << helper.name;
  }
  for (const char* name : {"l_knee_fold_before_far",
                           "l_knee_fold_before",
                           "l_knee_fold_after",
                           "l_knee_fold_after_far",
                           "l_knee_tip",
                           "l_knee_tip_after",
                           "l_knee_side",
                           "l_elbow_side_other",
                           "spine_crease",
                           "spine_crease_left",
                           "l_elbow_fold_after",
                           "l_shoulder_pit",
                           "l_shoulder_hollow",
                           "l_hip_pit",
                           "spine_fold_before_far",
                           "spine_fold_after_left",
                           "spine_fold_after"}) {
    ASSERT_TRUE(by_name.contains(name)) << name;
    EXPECT_FALSE(by_name[name]->skin.empty()) << name;
  }
  // The flanks of the waist mirror each other.
  const HelperJoint& left = *by_name.at("spine_fold_before_left");
  const HelperJoint& right = *by_name.at("spine_fold_before_right");
  EXPECT_EQ(left.skin.size(), right.skin.size());
  EXPECT_GT(left.joint_in_rest.x(), 0.05);
  EXPECT_LT((left.joint_in_rest -
             right.joint_in_rest.cwiseProduct(Vector3d(-1, 1, 1)))
                .norm(),
            1e-6);
  // Where they are named after.
  EXPECT_LT(by_name["l_knee_fold_after"]->joint_in_rest.z(),
            by_name["l_knee_tip"]->joint_in_rest.z());
  EXPECT_GT(by_name["l_knee_fold_before"]->joint_in_rest.y(),
            by_name["l_knee_fold_after"]->joint_in_rest.y());
}

TEST(HelperJoints, RideOnTheSkinOfAFold) {
  const std::vector<HelperJoint> helpers = MakeHelperJoints(Person());
  const JointMotions motions(Person(), helpers);
  const JointLimits limits(Person().skeleton);
  const Vertices& rest = Deformer().rest_vertices();
  const auto rms = [&](const HelperJoint& helper,
                       const RigidMotion& motion,
                       const Vertices& posed) {
    double sum = 0;
    for (const int v : helper.skin) {
      sum += (motion * rest[v] - posed[v]).squaredNorm();
    }
    return std::sqrt(sum / helper.skin.size());
  };
  Pose bent;
  bent.rotation[kLKnee] = limits.Rotation(kLKnee, {125 * kDegree, 0, 0});
  const Vertices posed = Deformer().Vertices(bent);
  const std::vector<RigidMotion> at_rest = motions.At(Pose());
  const std::vector<RigidMotion> at_bend = motions.At(bent);
  int pressed = 0;
  for (std::size_t h = 0; h < helpers.size(); ++h) {
    const HelperJoint& helper = helpers[h];
    EXPECT_LT(
        (at_rest[kNumJoints + h].rotation - Eigen::Matrix3d::Identity()).norm(),
        1e-9)
        << helper.name;
    EXPECT_LT(at_rest[kNumJoints + h].translation.norm(), 1e-9) << helper.name;
    if (helper.joint != kLKnee || helper.skin.empty()) continue;
    const double own = rms(helper, at_bend[kNumJoints + h], posed);
    const double above = rms(helper, at_bend[kLHip], posed);
    const double below = rms(helper, at_bend[kLKnee], posed);
    // The nearest rigid motion is no worse than any other.
    EXPECT_LE(own, std::min(above, below) + 1e-9) << helper.name;
    EXPECT_NEAR(at_bend[kNumJoints + h].rotation.determinant(), 1, 1e-9);
    pressed += own < 0.5 * std::min(above, below);
  }
  EXPECT_GE(pressed, 3);
}

TEST(HelperJoints, MoveTheSameWithVerticesThatAreKnown) {
  const std::vector<HelperJoint> helpers = MakeHelperJoints(Person());
  const JointMotions own(Person(), helpers);
  const JointMotions shared(Person(), helpers, Deformer());
  Pose bent;
  bent.rotation[kLKnee] =
      JointLimits(Person().skeleton).Rotation(kLKnee, {70 * kDegree, 0, 0});
  const std::vector<RigidMotion> expected = own.At(bent);
  const std::vector<RigidMotion> found =
      shared.At(bent, Deformer().Vertices(bent));
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t j = 0; j < found.size(); ++j) {
    EXPECT_EQ(found[j].rotation, expected[j].rotation) << j;
    EXPECT_EQ(found[j].translation, expected[j].translation) << j;
  }
}

// The bake of `model.glb`, measured on postures that it was not fitted to. The
// seeds have arms across the chest, which closes the armpit, and deep bends of
// the waist.
TEST(HelperJoints, LetSkinningFollowTheSweepsInDeepFolds) {
  const SkinFit fit = FitSkinWeights(Person(), kSkinPoses, kSkinSeed);
  const JointMotions motions(Person(), fit.weights.helpers);
  for (const unsigned seed : {5u, 6u, 7u, 10u}) {
    double sum = 0, count = 0, largest = 0;
    for (const Pose& pose :
         JointLimits(Person().skeleton).RandomPoses(60, seed)) {
      const Vertices sweeps = Deformer().Vertices(pose);
      const Vertices skinned = SkinVertices(
          Deformer().rest_vertices(), fit.weights, motions.At(pose));
      for (std::size_t v = 0; v < sweeps.size(); ++v) {
        const double error = (sweeps[v] - skinned[v]).norm();
        sum += error * error;
        largest = std::max(largest, error);
        count += 1;
      }
    }
    EXPECT_LT(std::sqrt(sum / count), 0.003) << seed;
    EXPECT_LT(largest, 0.020) << seed;
  }
}

TEST(BodyDeformer, NoFaceTurnsOverWhereAnArmClosesTheArmpit) {
  const JointLimits limits(Person().skeleton);
  for (const unsigned seed : {6u, 7u}) {
    const std::vector<Pose> poses = limits.RandomPoses(60, seed);
    for (std::size_t p = 0; p < poses.size(); ++p) {
      EXPECT_EQ(CountTurned(poses[p]), 0) << seed << " posture " << p;
    }
  }
}

}  // namespace
}  // namespace sweepfit
