// SPDX-License-Identifier: Apache-2.0
#include "model/sweep.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "model/body.h"
#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

Eigen::Quaterniond Turn(double angle, const Eigen::Vector3d& axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized()));
}

double AngleBetween(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.transpose() * b)).angle();
}

// The motion of a section from rest to the posture.
struct Motion {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
};
Motion MotionAt(const SweepAxis& rest, const SweepAxis& posed, double u) {
  const SectionFrame a = rest.At(u);
  const SectionFrame b = posed.At(u);
  const Eigen::Matrix3d rotation =
      b.world_from_section * a.world_from_section.transpose();
  return {rotation, b.center_in_world - rotation * a.center_in_world};
}

class SweepTest : public ::testing::Test {
 protected:
  SweepAxis Rest(const Sweep& sweep) const {
    return SweepAxis(sweep, skeleton_, RestFrames(skeleton_));
  }
  SweepAxis Posed(const Sweep& sweep, const Pose& pose) const {
    return SweepAxis(sweep, skeleton_, ForwardKinematics(skeleton_, pose));
  }

  Skeleton skeleton_ = ToySkeleton();
  Sweep trunk_ = ToySweep("trunk",
                          {kRoot, kSpine, kNeck, kHead, kHeadEnd},
                          Eigen::Vector3d::UnitX(),
                          0.14);
  Sweep arm_ = ToySweep("l_arm",
                        {kLShoulder, kLElbow, kLWrist, kLHandEnd},
                        Eigen::Vector3d::UnitZ(),
                        0.05);
  Sweep foot_ =
      ToySweep("l_foot", {kLAnkle, kLFootEnd}, Eigen::Vector3d::UnitY(), 0.04);
};

TEST_F(SweepTest, RowWeightsSumToOneAndPassThroughKeys) {
  for (double u = -0.5; u < 5; u += 0.037) {
    const RowWeights rows = KeyRowWeights(arm_, u);
    double sum = 0;
    for (double weight : rows.weight) sum += weight;
    EXPECT_NEAR(sum, 1, 1e-14);
  }
  for (int k = 0; k < arm_.num_rows(); ++k) {
    const RowWeights rows = KeyRowWeights(arm_, arm_.key_u[k]);
    double at_key = 0;
    for (int i = 0; i < 4; ++i) {
      if (rows.index[i] == k) at_key += rows.weight[i];
    }
    EXPECT_NEAR(at_key, 1, 1e-14) << k;
  }
}

TEST_F(SweepTest, RowInterpolationReproducesParabolasBetweenInnerKeys) {
  const auto parabola = [](double u) { return 1 + 2 * u - 0.7 * u * u; };
  const int last = arm_.num_rows() - 1;
  for (double u = arm_.key_u[1]; u < arm_.key_u[last - 1]; u += 0.013) {
    const RowWeights rows = KeyRowWeights(arm_, u);
    double value = 0;
    for (int i = 0; i < 4; ++i) {
      value += rows.weight[i] * parabola(arm_.key_u[rows.index[i]]);
    }
    // A cubic through two neighbours with the slopes of parabolas.
    EXPECT_NEAR(value, parabola(u), 1e-12) << u;
  }
}

TEST_F(SweepTest, RowInterpolationIsConstantBeyondTheKeys) {
  for (const double theta : {0.3, 2.0, -1.0}) {
    EXPECT_EQ(Radius(arm_, -3, theta), Radius(arm_, arm_.key_u.front(), theta));
    EXPECT_EQ(Radius(arm_, 9, theta), Radius(arm_, arm_.key_u.back(), theta));
  }
}

TEST_F(SweepTest, OneKeyMakesATubeOfConstantSection) {
  Sweep tube = arm_;
  tube.key_u = {1.0};
  tube.radius = Eigen::MatrixXd::Constant(1, 16, 0.05);
  tube.log_ratio = Eigen::MatrixXd::Zero(1, 16);
  tube.center_offset = Eigen::Matrix2Xd::Zero(2, 1);
  for (const double u : {-0.2, 1.0, 2.5}) {
    EXPECT_NEAR(Radius(tube, u, 0.7), 0.05, 1e-15);
  }
}

TEST_F(SweepTest, RadiusIsTemplateTimesExpOfLogRatio) {
  Sweep plain = arm_;
  plain.log_ratio.setConstant(0.25);
  for (double u = -0.3; u < 3.5; u += 0.11) {
    for (double theta = -4; theta < 4; theta += 0.37) {
      EXPECT_NEAR(Radius(plain, u, theta),
                  std::exp(0.25) * TemplateRadius(arm_, u, theta),
                  1e-14);
    }
  }
}

TEST_F(SweepTest, RadiusWeightsAreTheDerivativeByTheSamples) {
  constexpr double kStep = 1e-5;
  for (const auto& [u, theta] : std::vector<std::pair<double, double>>{
           {0.37, 1.1}, {1.0, 0.01}, {-0.05, 6.2}, {2.9, -2.2}, {3.3, 3.1}}) {
    const SampleWeights weights = RadiusWeights(arm_, u, theta);
    Eigen::VectorXd expected = Eigen::VectorXd::Zero(arm_.log_ratio.size());
    for (int i = 0; i < 16; ++i)
      expected[weights.index[i]] += weights.weight[i];
    for (int sample = 0; sample < expected.size(); ++sample) {
      const int row = sample / arm_.num_columns();
      const int column = sample % arm_.num_columns();
      Sweep more = arm_;
      Sweep less = arm_;
      more.log_ratio(row, column) += kStep;
      less.log_ratio(row, column) -= kStep;
      const double derivative = (std::log(Radius(more, u, theta)) -
                                 std::log(Radius(less, u, theta))) /
                                (2 * kStep);
      EXPECT_NEAR(derivative, expected[sample], 1e-9) << u << " " << sample;
      more = arm_;
      more.radius(row, column) += kStep;
      EXPECT_NEAR(
          (TemplateRadius(more, u, theta) - TemplateRadius(arm_, u, theta)) /
              kStep,
          expected[sample],
          1e-9);
    }
  }
}

TEST_F(SweepTest, RestMotionIsTheIdentity) {
  for (const Sweep* sweep : {&trunk_, &arm_, &foot_}) {
    const SweepAxis rest = Rest(*sweep);
    const SweepAxis posed = Posed(*sweep, Pose());
    for (double u = -0.5; u < sweep->num_bones() + 0.5; u += 0.01) {
      const Motion motion = MotionAt(rest, posed, u);
      EXPECT_LT((motion.rotation - Eigen::Matrix3d::Identity()).norm(), 1e-12);
      EXPECT_LT(motion.translation.norm(), 1e-12);
    }
  }
}

TEST_F(SweepTest, RestFrameBeginsAtTheReference) {
  const Eigen::Matrix3d frame = Rest(arm_).At(0).world_from_section;
  EXPECT_LT((frame.col(2) - skeleton_.rest_direction[kLElbow]).norm(), 1e-12);
  // e1 lies in the plane of the reference and the tangent, on its side.
  EXPECT_NEAR(frame.col(1).dot(arm_.rest_reference), 0, 1e-12);
  EXPECT_GT(frame.col(0).dot(arm_.rest_reference), 0);
}

TEST_F(SweepTest, StraightPartsLieOnTheBones) {
  arm_.center_offset.setZero();
  const Pose pose = RandomPose(1.0, 3);
  const JointFrames joints = ForwardKinematics(skeleton_, pose);
  const SweepAxis axis(arm_, skeleton_, joints);
  for (const double u : {-0.2, 0.0, 0.5, 1.5, 2.5, 3.0, 3.3}) {
    const int bone = std::clamp(static_cast<int>(u), 0, 2);
    const Eigen::Vector3d& a = joints.joint_in_world[arm_.chain[bone]];
    const Eigen::Vector3d& b = joints.joint_in_world[arm_.chain[bone + 1]];
    EXPECT_LT((axis.At(u).center_in_world - (a + (u - bone) * (b - a))).norm(),
              1e-12)
        << u;
  }
}

TEST_F(SweepTest, CornerIsTheQuadraticBezier) {
  arm_.center_offset.setZero();
  Pose pose;
  pose.rotation[kLElbow] = Turn(90 * kDegree, Eigen::Vector3d(1, 1, 0));
  const JointFrames joints = ForwardKinematics(skeleton_, pose);
  const SweepAxis axis(arm_, skeleton_, joints);
  const Eigen::Vector3d& elbow = joints.joint_in_world[kLElbow];
  const Eigen::Vector3d to_shoulder =
      (joints.joint_in_world[kLShoulder] - elbow).normalized();
  const Eigen::Vector3d to_wrist =
      (joints.joint_in_world[kLWrist] - elbow).normalized();
  double mean_radius = 0;
  for (int k = 0; k < 360; ++k) {
    mean_radius += TemplateRadius(arm_, 1, k * kDegree) / 360;
  }
  const double leg = std::min({1.5 * mean_radius,
                               0.35 * skeleton_.length[kLElbow],
                               0.35 * skeleton_.length[kLWrist]});
  const double before = leg / skeleton_.length[kLElbow];
  const double after = leg / skeleton_.length[kLWrist];
  for (const double s : {0.0, 0.25, 0.5, 0.6, 1.0}) {
    const double u = 1 + (s < 0.5 ? (2 * s - 1) * before : (2 * s - 1) * after);
    const Eigen::Vector3d expected =
        elbow + leg * ((1 - s) * (1 - s) * to_shoulder + s * s * to_wrist);
    EXPECT_LT((axis.At(u).center_in_world - expected).norm(), 1e-12) << s;
    const Eigen::Vector3d tangent =
        (s * to_wrist - (1 - s) * to_shoulder).normalized();
    EXPECT_LT((axis.At(u).world_from_section.col(2) - tangent).norm(), 1e-12);
  }
}

TEST_F(SweepTest, FramesAreOrthonormalAndContinuous) {
  constexpr double kStep = 1e-4;
  for (unsigned seed = 0; seed < 40; ++seed) {
    Pose pose = RandomPose(1.0, seed);
    if (seed % 2 == 0) {
      // A hinge at 150 degrees and a forearm turned by 90.
      const Eigen::Vector3d& upper = skeleton_.rest_direction[kLElbow];
      const Eigen::Vector3d& fore = skeleton_.rest_direction[kLWrist];
      pose.rotation[kLElbow] =
          Turn(150 * kDegree, upper.cross(Eigen::Vector3d::UnitZ())) *
          Turn(90 * kDegree, fore);
    }
    for (const Sweep* sweep : {&trunk_, &arm_, &foot_}) {
      const SweepAxis axis = Posed(*sweep, pose);
      SectionFrame last = axis.At(-0.3);
      for (double u = -0.3; u < sweep->num_bones() + 0.3; u += kStep) {
        const SectionFrame now = axis.At(u);
        ASSERT_LT((now.world_from_section.transpose() * now.world_from_section -
                   Eigen::Matrix3d::Identity())
                      .norm(),
                  1e-12);
        ASSERT_GT(now.world_from_section.determinant(), 0);
        ASSERT_LT((now.center_in_world - last.center_in_world).norm(), 2e-4)
            << sweep->name << " at " << u;
        // Steepest at the middle of a sharp corner: for 150 degrees the
        // tangent turns by 2 tan(75 deg) per unit of s.
        ASSERT_LT(AngleBetween(last.world_from_section, now.world_from_section),
                  0.01)
            << sweep->name << " at " << u;
        last = now;
      }
    }
  }
}

TEST_F(SweepTest, TangentFollowsTheAxis) {
  trunk_.center_offset.setZero();
  const SweepAxis axis = Posed(trunk_, RandomPose(0.8, 5));
  constexpr double kStep = 1e-5;
  for (double u = -0.2; u < 4.2; u += 0.0173) {
    const Eigen::Vector3d along =
        axis.At(u + kStep).center_in_world - axis.At(u - kStep).center_in_world;
    EXPECT_LT(
        (along.normalized() - axis.At(u).world_from_section.col(2)).norm(),
        1e-3)
        << u;
  }
}

TEST_F(SweepTest, FrameAtTheEndOfABoneIsThatOfItsJoint) {
  arm_.rigid_end = false;
  const Pose pose = RandomPose(1.0, 11);
  const JointFrames joints = ForwardKinematics(skeleton_, pose);
  const SweepAxis rest = Rest(arm_);
  const SweepAxis posed(arm_, skeleton_, joints);
  // The end of the last bone shows the wrist's rotation; ends of the others
  // lie in a rounded corner, so their middle has turned only half of it.
  EXPECT_LT(
      (MotionAt(rest, posed, 3).rotation - joints.world_from_joint[kLWrist])
          .norm(),
      1e-12);
}

TEST_F(SweepTest, RigidEndMovesWithItsJoint) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    const Pose pose = RandomPose(1.0, seed);
    const JointFrames joints = ForwardKinematics(skeleton_, pose);
    const auto expect_rigid = [&](const Sweep& sweep, double from, int joint) {
      const SweepAxis rest = Rest(sweep);
      const SweepAxis posed(sweep, skeleton_, joints);
      for (double u = from; u < sweep.num_bones() + 0.2; u += 0.05) {
        const Motion motion = MotionAt(rest, posed, u);
        EXPECT_LT((motion.rotation - joints.world_from_joint[joint]).norm(),
                  1e-12)
            << sweep.name << " " << u;
        EXPECT_LT(
            (motion.rotation * RestFrames(skeleton_).joint_in_world[joint] +
             motion.translation - joints.joint_in_world[joint])
                .norm(),
            1e-12);
      }
    };
    expect_rigid(arm_, 2.36, kLWrist);
    expect_rigid(trunk_, 3.36, kHead);
    expect_rigid(foot_, -0.2, kLAnkle);
  }
}

TEST_F(SweepTest, ForearmTwistGrowsLinearlyUpToTheHand) {
  // Straight, so that the twist is the whole motion.
  skeleton_.rest_direction[kLElbow] = skeleton_.rest_direction[kLWrist] =
      skeleton_.rest_direction[kLHandEnd] =
          Eigen::Vector3d(1, -1, 0).normalized();
  const Eigen::Vector3d along = skeleton_.rest_direction[kLElbow];
  for (const double degrees : {150.0, 90.0, -150.0}) {
    for (const int joint : {kLElbow, kLWrist}) {
      // Turned at the elbow or at the wrist: the forearm takes it all.
      Pose pose;
      pose.rotation[joint] = Turn(degrees * kDegree, along);
      const SweepAxis rest = Rest(arm_);
      const SweepAxis posed = Posed(arm_, pose);
      for (double u = 0; u < 3; u += 0.05) {
        const double expected = degrees * kDegree * std::clamp(u - 1, 0.0, 1.0);
        EXPECT_LT((MotionAt(rest, posed, u).rotation -
                   Turn(expected, along).toRotationMatrix())
                      .norm(),
                  1e-12)
            << u;
      }
    }
  }
}

TEST_F(SweepTest, ShoulderTwistDoesNotTurnTheShoulder) {
  Pose pose;
  pose.rotation[kLShoulder] =
      Turn(140 * kDegree, skeleton_.rest_direction[kLElbow]);
  const SweepAxis rest = Rest(arm_);
  const SweepAxis posed = Posed(arm_, pose);
  for (const double u : {-0.2, 0.0}) {
    EXPECT_LT((MotionAt(rest, posed, u).rotation - Eigen::Matrix3d::Identity())
                  .norm(),
              1e-12);
  }
  EXPECT_NEAR(Eigen::AngleAxisd(MotionAt(rest, posed, 0.5).rotation).angle(),
              70 * kDegree,
              1e-12);
}

TEST_F(SweepTest, CollarMovesTheArmWithoutTurningIt) {
  Pose pose;
  pose.collar[0] = Turn(0.4, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d moved =
      ForwardKinematics(skeleton_, pose).joint_in_world[kLShoulder] -
      RestFrames(skeleton_).joint_in_world[kLShoulder];
  const SweepAxis rest = Rest(arm_);
  const SweepAxis posed = Posed(arm_, pose);
  for (double u = -0.1; u < 3.1; u += 0.1) {
    EXPECT_LT((MotionAt(rest, posed, u).rotation - Eigen::Matrix3d::Identity())
                  .norm(),
              1e-12);
    EXPECT_LT((MotionAt(rest, posed, u).translation - moved).norm(), 1e-12);
  }
}

TEST_F(SweepTest, AxisAlongTheCollarBoneTurnsWithIt) {
  Sweep collar = ToySweep(
      "collar", {kNeck, kLShoulder, kLElbow}, Eigen::Vector3d::UnitZ(), 0.05);
  collar.center_offset.setZero();
  Pose pose;
  pose.collar[0] = Turn(0.4, Eigen::Vector3d::UnitZ());
  const JointFrames joints = ForwardKinematics(skeleton_, pose);
  const SectionFrame section = Posed(collar, pose).At(0.5);
  const Eigen::Vector3d& neck = joints.joint_in_world[kNeck];
  const Eigen::Vector3d& shoulder = joints.joint_in_world[kLShoulder];
  EXPECT_LT((section.center_in_world - 0.5 * (neck + shoulder)).norm(), 1e-12);
  EXPECT_LT((section.world_from_section.col(2) - (shoulder - neck).normalized())
                .norm(),
            1e-12);
}

TEST_F(SweepTest, BonesFoldedFlatGiveFiniteFrames) {
  arm_.center_offset.setZero();
  skeleton_.rest_direction[kLElbow] = Eigen::Vector3d::UnitX();
  skeleton_.rest_direction[kLWrist] = Eigen::Vector3d::UnitX();
  JointFrames joints = RestFrames(skeleton_);
  joints.world_from_joint[kLElbow] =
      Eigen::Vector3d(-1, -1, 1).asDiagonal();  // exactly half a turn
  joints.world_from_joint[kLWrist] = joints.world_from_joint[kLElbow];
  joints.joint_in_world[kLWrist] =
      joints.joint_in_world[kLElbow] -
      skeleton_.length[kLWrist] * Eigen::Vector3d::UnitX();
  joints.joint_in_world[kLHandEnd] =
      joints.joint_in_world[kLWrist] +
      joints.world_from_joint[kLWrist] *
          (skeleton_.length[kLHandEnd] * skeleton_.rest_direction[kLHandEnd]);
  const SweepAxis axis(arm_, skeleton_, joints);
  for (const double u : {0.9, 1.0, 1.0 + 1e-9, 1.1, 1.7}) {
    const SectionFrame section = axis.At(u);
    EXPECT_TRUE(section.center_in_world.allFinite()) << u;
    EXPECT_LT(
        (section.world_from_section.transpose() * section.world_from_section -
         Eigen::Matrix3d::Identity())
            .norm(),
        1e-12)
        << u;
  }
}

TEST_F(SweepTest, CenterOffsetIsMeasuredInTheSection) {
  Sweep centred = arm_;
  centred.center_offset.setZero();
  Sweep shifted = centred;
  shifted.center_offset.row(0).setConstant(0.02);
  shifted.center_offset.row(1).setConstant(-0.01);
  const Pose pose = RandomPose(1.0, 7);
  for (double u = -0.1; u < 3.1; u += 0.1) {
    const SectionFrame a = Posed(centred, pose).At(u);
    const SectionFrame b = Posed(shifted, pose).At(u);
    EXPECT_LT((a.world_from_section.transpose() *
                   (b.center_in_world - a.center_in_world) -
               Eigen::Vector3d(0.02, -0.01, 0))
                  .norm(),
              1e-12);
  }
}

TEST_F(SweepTest, DeathOnBrokenChains) {
  Sweep broken = arm_;
  broken.chain = {kLShoulder, kLWrist};
  EXPECT_DEATH(Rest(broken), "l_arm");
}

}  // namespace
}  // namespace sweepfit
