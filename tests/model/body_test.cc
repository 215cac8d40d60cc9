// SPDX-License-Identifier: Apache-2.0
#include "model/body.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

double MaxDistance(const std::vector<Eigen::Vector3d>& a,
                   const std::vector<Eigen::Vector3d>& b) {
  EXPECT_EQ(a.size(), b.size());
  double max = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    max = std::max(max, (a[i] - b[i]).norm());
  }
  return max;
}

// A body with bent sections, a log ratio and displacements.
Body DisplacedBody() {
  Body body = ToyBody();
  for (int v = 0; v < body.num_vertices(); ++v) {
    body.displacement_in_section[v] =
        0.004 * Eigen::Vector3d(std::sin(v), std::cos(2 * v), std::sin(3 * v));
  }
  return body;
}

TEST(BodyTest, BindingReproducesVerticesAnywhereInSpace) {
  Body body = ToyBody();
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<std::pair<int, double>>> weights;
  for (int i = 0; i < 2000; ++i) {
    const double x = uniform(generator);
    const double y = uniform(generator);
    const double z = uniform(generator);
    points.emplace_back(0.8 * x, 0.3 + 0.9 * y, 0.4 * z);
    weights.push_back(i % 3 == 0 ? std::vector<std::pair<int, double>>{{0, 1.0}}
                                 : std::vector<std::pair<int, double>>{
                                       {1, 1.0}, {0, 2.0 + x}});
  }
  BindVertices(points, weights, &body);
  EXPECT_LT(MaxDistance(RestVertices(body), points), 1e-10);
  for (int v = 0; v < body.num_vertices(); ++v) {
    double sum = 0;
    double last = 1;
    for (const SweepAttachment& attachment : body.binding[v].attachment) {
      if (attachment.sweep < 0) continue;
      EXPECT_LE(attachment.weight, last);
      last = attachment.weight;
      sum += attachment.weight;
      const Sweep& sweep = body.sweeps[attachment.sweep];
      EXPECT_GE(attachment.u, sweep.key_u.front());
      EXPECT_LE(attachment.u, sweep.key_u.back());
      // Inside the range the section plane goes through the vertex.
      if (attachment.u > sweep.key_u.front() &&
          attachment.u < sweep.key_u.back()) {
        EXPECT_LT(std::abs(attachment.tau), 1e-9);
      }
    }
    EXPECT_NEAR(sum, 1, 1e-14);
  }
}

TEST(BodyTest, BindingFindsTheNearestSection) {
  Body body = ToyBody();
  const SweepAxis axis(
      body.sweeps[1], body.skeleton, RestFrames(body.skeleton));
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<std::pair<int, double>>> weights;
  for (double u = 0; u < 3; u += 0.02) {
    for (double theta = 0; theta < 6; theta += 0.5) {
      const SectionFrame section = axis.At(u);
      points.push_back(
          section.center_in_world +
          0.06 * (section.world_from_section *
                  Eigen::Vector3d(std::cos(theta), std::sin(theta), 0)));
      weights.push_back({{1, 1.0}});
    }
  }
  BindVertices(points, weights, &body);
  for (std::size_t v = 0; v < points.size(); ++v) {
    const double u = body.binding[v].attachment[0].u;
    const double found = (points[v] - axis.At(u).center_in_world).norm();
    for (double other = 0; other < 3; other += 0.01) {
      EXPECT_LT(found,
                (points[v] - axis.At(other).center_in_world).norm() + 2e-3);
    }
  }
}

TEST(BodyTest, RestPoseLeavesEveryVertex) {
  const Body body = DisplacedBody();
  EXPECT_LT(MaxDistance(PoseVertices(body, Pose()), RestVertices(body)), 1e-12);
}

TEST(BodyTest, DisplacementIsInTheSectionOfTheHeaviestSweep) {
  Body body = ToyBody();
  const std::vector<Eigen::Vector3d> before = RestVertices(body);
  body.displacement_in_section.assign(body.num_vertices(), {0.01, 0, -0.02});
  const std::vector<Eigen::Vector3d> after = RestVertices(body);
  for (int v = 0; v < body.num_vertices(); v += 7) {
    const SweepAttachment& a = body.binding[v].attachment[0];
    const SweepAxis axis(
        body.sweeps[a.sweep], body.skeleton, RestFrames(body.skeleton));
    EXPECT_LT(
        (axis.At(a.u).world_from_section.transpose() * (after[v] - before[v]) -
         Eigen::Vector3d(0.01, 0, -0.02))
            .norm(),
        1e-12);
  }
}

TEST(BodyTest, RootMovesTheWholeBodyRigidly) {
  const Body body = DisplacedBody();
  Pose pose = RandomPose(0.7, 2);
  pose.root_in_world.setZero();
  pose.rotation[kRoot].setIdentity();
  const std::vector<Eigen::Vector3d> before = PoseVertices(body, pose);
  for (const double angle : {0.3, 1.57, 3.1}) {
    pose.root_in_world = Eigen::Vector3d(1, -2, 3);
    pose.rotation[kRoot] = Eigen::Quaterniond(
        Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, -1).normalized()));
    std::vector<Eigen::Vector3d> expected = before;
    for (Eigen::Vector3d& vertex : expected) {
      vertex = pose.rotation[kRoot] * vertex + pose.root_in_world;
    }
    EXPECT_LT(MaxDistance(PoseVertices(body, pose), expected), 1e-12);
  }
}

TEST(BodyTest, MotionsAreRigidAndPoseTheVertices) {
  const Body body = DisplacedBody();
  const Pose pose = RandomPose(0.9, 4);
  const std::vector<Eigen::Vector3d> rest = RestVertices(body);
  const std::vector<Eigen::Vector3d> posed = PoseVertices(body, pose);
  const std::vector<VertexMotion> motions = BodyDeformer(body).Motions(pose);
  for (int v = 0; v < body.num_vertices(); ++v) {
    EXPECT_LT(
        (posed[v] - motions[v].rotation * rest[v] - motions[v].translation)
            .norm(),
        1e-12);
    EXPECT_LT((motions[v].rotation.transpose() * motions[v].rotation -
               Eigen::Matrix3d::Identity())
                  .norm(),
              1e-12);
  }
}

TEST(BodyTest, BlendOfTwoSectionsLiesBetweenThem) {
  // Rotations about one axis blend to the rotation in between.
  Body body = ToyBody();
  Pose pose;
  const Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  pose.rotation[kNeck] = Eigen::Quaterniond(Eigen::AngleAxisd(0.8, up));
  Binding binding = body.binding.front();
  SweepAttachment on_trunk;
  on_trunk.sweep = 0;
  on_trunk.weight = 0.5;
  on_trunk.u = 0;
  SweepAttachment on_arm = on_trunk;
  on_arm.sweep = 1;
  on_arm.u = 0;
  binding.attachment = {on_trunk, on_arm, SweepAttachment()};
  body.binding.front() = binding;
  const VertexMotion motion = BodyDeformer(body).Motions(pose).front();
  EXPECT_LT(
      (motion.rotation - Eigen::AngleAxisd(0.4, up).toRotationMatrix()).norm(),
      1e-12);
  // Between the screw motion at half the angle, which keeps the distance from
  // the axis through the neck, and the mean of both positions, which shrinks it
  // by the cosine of half the angle.
  const Eigen::Vector3d neck = RestFrames(body.skeleton).joint_in_world[kNeck];
  Eigen::Vector3d rest = RestVertices(body).front() - neck;
  Eigen::Vector3d posed =
      motion.rotation * (rest + neck) + motion.translation - neck;
  EXPECT_NEAR(rest.y(), posed.y(), 1e-12);
  rest.y() = posed.y() = 0;
  EXPECT_LT(posed.norm(), rest.norm());
  EXPECT_GT(posed.norm(), std::cos(0.4) * rest.norm());
}

TEST(BodyTest, RestByLogRatioIsTheDerivative) {
  Body body = DisplacedBody();
  const std::vector<RestDerivative> all = RestByLogRatio(body);
  constexpr double kStep = 1e-5;
  for (int v = 5; v < body.num_vertices(); v += 41) {
    const RestDerivative derivative = RestByLogRatio(body, v);
    ASSERT_EQ(derivative.terms.size(), all[v].terms.size());
    ASSERT_FALSE(derivative.terms.empty());
    for (const RestDerivative::Term& term : derivative.terms) {
      Eigen::Vector3d expected = Eigen::Vector3d::Zero();
      for (const RestDerivative::Term& other : all[v].terms) {
        if (other.sweep == term.sweep && other.sample == term.sample) {
          expected += other.direction_at_rest;
        }
      }
      Eigen::MatrixXd& q = body.sweeps[term.sweep].log_ratio;
      const int columns = static_cast<int>(q.cols());
      double& sample = q(term.sample / columns, term.sample % columns);
      const double value = sample;
      sample = value + kStep;
      const Eigen::Vector3d more = RestVertices(body)[v];
      sample = value - kStep;
      const Eigen::Vector3d less = RestVertices(body)[v];
      sample = value;
      EXPECT_LT(((more - less) / (2 * kStep) - expected).norm(), 1e-8);
    }
  }
}

TEST(BodyTest, ScalingScalesEveryPosture) {
  const Body body = DisplacedBody();
  Body scaled = body;
  ScaleBody(1.3, &scaled);
  EXPECT_DOUBLE_EQ(scaled.stature, 1.3 * body.stature);
  Pose pose = RandomPose(0.8, 9);
  pose.root_in_world.setZero();
  std::vector<Eigen::Vector3d> expected = PoseVertices(body, pose);
  for (Eigen::Vector3d& vertex : expected) vertex *= 1.3;
  EXPECT_LT(MaxDistance(PoseVertices(scaled, pose), expected), 1e-12);
}

TEST(BodyTest, LongerBonesStretchTheAxisAndKeepTheSections) {
  Body body = ToyBody();
  const std::vector<Eigen::Vector3d> before = RestVertices(body);
  std::array<double, kNumJoints> length = body.skeleton.length;
  length[kLElbow] += 0.05;
  SetBoneLengths(length, &body);
  const std::vector<Eigen::Vector3d> after = RestVertices(body);
  const Eigen::Vector3d stretch = 0.05 * body.skeleton.rest_direction[kLElbow];
  int num_beyond = 0;
  for (int v = 0; v < body.num_vertices(); ++v) {
    const Binding& binding = body.binding[v];
    if (binding.attachment[1].sweep >= 0) continue;
    const SweepAttachment& a = binding.attachment[0];
    if (a.sweep == 0) {
      EXPECT_LT((after[v] - before[v]).norm(), 1e-12);
    } else if (a.u > 1.4) {
      EXPECT_LT((after[v] - before[v] - stretch).norm(), 1e-12);
      ++num_beyond;
    }
  }
  EXPECT_GT(num_beyond, 50);
}

TEST(BodyTest, DeathOnImpossibleBones) {
  Body body = ToyBody();
  std::array<double, kNumJoints> length = body.skeleton.length;
  length[kLKnee] = 0;
  EXPECT_DEATH(SetBoneLengths(length, &body), "l_knee");
}

}  // namespace
}  // namespace sweepfit
