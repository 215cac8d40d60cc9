// SPDX-License-Identifier: Apache-2.0
#include "model/lbs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

constexpr int kRings = 20;
constexpr int kPoses = 40;
constexpr unsigned kSeed = 7;

const SkinFit& ToyFit() {
  static const auto* fit =
      new SkinFit(FitSkinWeights(ToyBody(kRings), kPoses, kSeed));
  return *fit;
}

std::map<int, double> WeightsOf(const SkinWeights& weights, int vertex) {
  std::map<int, double> by_joint;
  for (int i = 0; i < 4; ++i) {
    if (weights.weight[vertex][i] > 0) {
      by_joint[weights.joint[vertex][i]] += weights.weight[vertex][i];
    }
  }
  return by_joint;
}

// The joint or helper on the other side.
int MirrorOf(const SkinWeights& weights, int joint) {
  if (joint < kNumJoints) return MirrorJoint(joint);
  std::string name = weights.helpers[joint - kNumJoints].name;
  if (name.starts_with("l_") || name.starts_with("r_")) {
    name[0] = name[0] == 'l' ? 'r' : 'l';
  }
  for (std::size_t h = 0; h < weights.helpers.size(); ++h) {
    if (weights.helpers[h].name == name) {
      return kNumJoints + static_cast<int>(h);
    }
  }
  return -1;
}

double Rms(const std::vector<Eigen::Vector3d>& a,
           const std::vector<Eigen::Vector3d>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).squaredNorm();
  return std::sqrt(sum / a.size());
}

// A ring of circular sections along a chain; the vertices of the left arm and
// of the trunk mirror those of the right arm and of the trunk itself.
Body SymmetricBody() {
  Body body;
  body.skeleton = ToySkeleton();
  const auto circular = [](const std::string& name, std::vector<int> chain) {
    Sweep sweep = ToySweep(name, chain, Eigen::Vector3d::UnitZ(), 0.05);
    sweep.center_offset.setZero();
    sweep.radius.setConstant(name == "trunk" ? 0.14 : 0.05);
    sweep.log_ratio.setZero();
    return sweep;
  };
  body.sweeps = {circular("trunk", {kRoot, kSpine, kNeck, kHead, kHeadEnd}),
                 circular("l_arm", {kLShoulder, kLElbow, kLWrist, kLHandEnd}),
                 circular("r_arm", {kRShoulder, kRElbow, kRWrist, kRHandEnd})};
  constexpr int kRingSize = 12;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::vector<std::pair<int, double>>> sweep_weights;
  std::vector<int>& mirror = body.topology.mirror_vertex;
  const auto mirrored = [](Eigen::Vector3d p) {
    p.x() = -p.x();
    return p;
  };
  for (int ring = 0; ring < 10; ++ring) {
    const int base = static_cast<int>(vertices.size());
    for (int k = 0; k < kRingSize; ++k) {
      const double angle = 2 * std::numbers::pi * k / kRingSize;
      // Exactly mirrored although sin and cos are rounded.
      const int partner = (kRingSize - k) % kRingSize;
      Eigen::Vector3d p(
          0.14 * std::sin(angle), 0.08 * ring, 0.14 * std::cos(angle));
      if (partner == k) p.x() = 0;
      if (partner < k) p = mirrored(vertices[base + partner]);
      vertices.push_back(p);
      mirror.push_back(base + partner);
      sweep_weights.push_back({{0, 1.0}});
    }
  }
  const SweepAxis axis(
      body.sweeps[1], body.skeleton, RestFrames(body.skeleton));
  for (int ring = 0; ring < 12; ++ring) {
    const SectionFrame section = axis.At(3.0 * ring / 11);
    for (int k = 0; k < kRingSize; ++k) {
      const double angle = 2 * std::numbers::pi * k / kRingSize;
      const Eigen::Vector3d p =
          section.center_in_world +
          section.world_from_section * Eigen::Vector3d(0.05 * std::cos(angle),
                                                       0.05 * std::sin(angle),
                                                       0);
      const double trunk = ring < 3 ? 0.4 - 0.1 * ring : 0;
      for (const int side : {1, 2}) {
        const int self = static_cast<int>(vertices.size());
        vertices.push_back(side == 1 ? p : mirrored(p));
        mirror.push_back(side == 1 ? self + 1 : self - 1);
        if (trunk > 0) {
          sweep_weights.push_back({{side, 1 - trunk}, {0, trunk}});
        } else {
          sweep_weights.push_back({{side, 1.0}});
        }
      }
    }
  }
  BindVertices(vertices, sweep_weights, &body);
  return body;
}

TEST(FitSkinWeights, WeightsAreWellFormed) {
  const std::set<int> ends = {
      kHeadEnd, kLHandEnd, kRHandEnd, kLFootEnd, kRFootEnd};
  const SkinWeights& weights = ToyFit().weights;
  ASSERT_EQ(weights.joint.size(), ToyBody(kRings).binding.size());
  ASSERT_EQ(weights.weight.size(), weights.joint.size());
  for (std::size_t v = 0; v < weights.joint.size(); ++v) {
    double sum = 0;
    std::set<int> joints;
    for (int i = 0; i < 4; ++i) {
      const double w = weights.weight[v][i];
      const int joint = weights.joint[v][i];
      EXPECT_GE(w, 0);
      EXPECT_LE(w, weights.weight[v][std::max(0, i - 1)]);
      sum += w;
      if (w == 0) {
        EXPECT_EQ(joint, 0);
      } else {
        EXPECT_TRUE(joints.insert(joint).second) << "joint listed twice";
        EXPECT_EQ(ends.count(joint), 0u) << "vertex " << v;
      }
    }
    EXPECT_NEAR(sum, 1, 1e-12);
  }
}

TEST(FitSkinWeights, FollowsTheSweeps) {
  const Body body = ToyBody(kRings);
  const SkinFit& fit = ToyFit();
  EXPECT_LT(fit.rms, 0.015);
  EXPECT_GE(fit.max, fit.rms);
  // The joints alone cannot do what the helpers do.
  const SkinFit plain = FitSkinWeights(body, kPoses, kSeed, false);
  EXPECT_TRUE(plain.weights.helpers.empty());
  EXPECT_LT(fit.rms, 0.6 * plain.rms);
  // Poses that were not sampled; better than by one joint per vertex.
  SkinWeights heaviest = fit.weights;
  for (auto& weight : heaviest.weight) weight = {1, 0, 0, 0};
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const Pose pose = RandomPose(0.6, seed);
    const std::vector<Eigen::Vector3d> sweeps = PoseVertices(body, pose);
    const double error = Rms(PoseVerticesLbs(body, fit.weights, pose), sweeps);
    EXPECT_LT(error, 0.012);
    EXPECT_LT(error, Rms(PoseVerticesLbs(body, heaviest, pose), sweeps));
  }
}

TEST(FitSkinWeights, HandBelongsToTheWristAlone) {
  const Body body = ToyBody(kRings);
  int checked = 0;
  for (int v = 0; v < body.num_vertices(); ++v) {
    const SweepAttachment& attachment = body.binding[v].attachment[0];
    if (attachment.sweep != 1 || attachment.u < 2.7) continue;
    ++checked;
    EXPECT_GT(WeightsOf(ToyFit().weights, v)[kLWrist], 0.95) << v;
  }
  EXPECT_GT(checked, 16);
}

TEST(FitSkinWeights, ForearmTurnsAtTheElbow) {
  const Body body = ToyBody(kRings);
  double mean = 0;
  int count = 0;
  for (int v = 0; v < body.num_vertices(); ++v) {
    const SweepAttachment& attachment = body.binding[v].attachment[0];
    if (attachment.sweep != 1 || attachment.u < 1.4 || attachment.u > 1.6) {
      continue;
    }
    const auto weights = WeightsOf(ToyFit().weights, v);
    for (const auto& [joint, weight] : weights) {
      const int of = joint < kNumJoints
                         ? joint
                         : ToyFit().weights.helpers[joint - kNumJoints].parent;
      if (of == kLElbow) mean += weight;
    }
    ++count;
  }
  ASSERT_GT(count, 0);
  EXPECT_GT(mean / count, 0.4);
}

TEST(FitSkinWeights, NeighboursDifferLittle) {
  const Body body = ToyBody(kRings);
  double largest = 0;
  for (const Quad& quad : body.topology.quads) {
    const auto a = WeightsOf(ToyFit().weights, quad[0]);
    const auto b = WeightsOf(ToyFit().weights, quad[1]);
    for (int joint = 0; joint < kNumJoints; ++joint) {
      const double wa = a.contains(joint) ? a.at(joint) : 0;
      const double wb = b.contains(joint) ? b.at(joint) : 0;
      largest = std::max(largest, std::abs(wa - wb));
    }
  }
  EXPECT_LT(largest, 0.35);
}

TEST(FitSkinWeights, MirrorsExactly) {
  const Body body = SymmetricBody();
  const SkinFit fit = FitSkinWeights(body, 20, kSeed);
  bool any_shared = false;
  for (int v = 0; v < body.num_vertices(); ++v) {
    const auto own = WeightsOf(fit.weights, v);
    const auto other = WeightsOf(fit.weights, body.topology.mirror_vertex[v]);
    ASSERT_EQ(own.size(), other.size()) << v;
    for (const auto& [joint, weight] : own) {
      const auto partner = other.find(MirrorOf(fit.weights, joint));
      ASSERT_NE(partner, other.end()) << v;
      EXPECT_EQ(weight, partner->second) << v;
    }
    any_shared = any_shared || own.size() > 1;
  }
  EXPECT_TRUE(any_shared);
}

TEST(FitSkinWeights, RepeatsAndDependsOnTheSeed) {
  const Body body = ToyBody(8);
  const SkinFit first = FitSkinWeights(body, 12, 1);
  const SkinFit again = FitSkinWeights(body, 12, 1);
  const SkinFit other = FitSkinWeights(body, 12, 2);
  EXPECT_EQ(first.weights.joint, again.weights.joint);
  EXPECT_EQ(first.weights.weight, again.weights.weight);
  EXPECT_EQ(first.rms, again.rms);
  EXPECT_NE(first.weights.weight, other.weights.weight);
}

TEST(PoseVerticesLbs, SingleJointMovesRigidly) {
  const Body body = ToyBody(8);
  const std::vector<Eigen::Vector3d> rest = RestVertices(body);
  const Pose pose = RandomPose(1.0, 5);
  const JointFrames from = RestFrames(body.skeleton);
  const JointFrames to = ForwardKinematics(body.skeleton, pose);
  SkinWeights weights;
  weights.joint.assign(rest.size(), {kLElbow, 0, 0, 0});
  weights.weight.assign(rest.size(), {1, 0, 0, 0});
  const std::vector<Eigen::Vector3d> posed =
      PoseVerticesLbs(body, weights, pose);
  for (std::size_t v = 0; v < rest.size(); ++v) {
    const Eigen::Vector3d expected =
        to.joint_in_world[kLElbow] +
        to.world_from_joint[kLElbow] * (rest[v] - from.joint_in_world[kLElbow]);
    EXPECT_LT((posed[v] - expected).norm(), 1e-12);
  }
}

TEST(PoseVerticesLbs, RootCarriesTheWholeBody) {
  const Body body = ToyBody(kRings);
  Pose pose;
  pose.root_in_world = Eigen::Vector3d(1, 2, -3);
  pose.rotation[kRoot] =
      Eigen::AngleAxisd(2, Eigen::Vector3d(1, 2, 3).normalized());
  const std::vector<Eigen::Vector3d> rest = RestVertices(body);
  const std::vector<Eigen::Vector3d> posed =
      PoseVerticesLbs(body, ToyFit().weights, pose);
  for (std::size_t v = 0; v < rest.size(); ++v) {
    const Eigen::Vector3d expected =
        pose.rotation[kRoot] * rest[v] + pose.root_in_world;
    EXPECT_LT((posed[v] - expected).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace sweepfit
