// SPDX-License-Identifier: Apache-2.0
#include "model/retarget.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "model/foot_lock.h"
#include "model/input_error.h"
#include "model/joint_limits.h"
#include "model/template.h"
#include "tests/support/walking_rig.h"

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kDegree = std::numbers::pi / 180;

class RetargetTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { body_ = new Body(BuildTemplate({})); }
  static void TearDownTestSuite() { delete body_; }

  static RetargetOptions Plain() {
    RetargetOptions options;
    options.lock_feet = false;
    options.limit_joints = false;
    return options;
  }

  static RetargetResult Run(const BvhMotion& motion,
                            const RetargetOptions& options) {
    return Retarget(motion, *body_, options, "walk.bvh");
  }

  static JointFrames First(const BvhMotion& motion) {
    return ForwardKinematics(body_->skeleton,
                             Run(motion, Plain()).poses.front());
  }

  static Vector3d Bone(const JointFrames& frames, int joint) {
    return (frames.joint_in_world[joint] -
            frames.joint_in_world[kJointParents[joint]])
        .normalized();
  }

  // The direction between two joints of a source.
  static Vector3d Between(const BvhMotion& motion,
                          const std::string& from,
                          const std::string& to) {
    const BvhFrames frames = BvhFramesAt(motion, 0);
    return (frames.joint_in_world[motion.Find(to)] -
            frames.joint_in_world[motion.Find(from)])
        .normalized();
  }

  static Body* body_;
};
Body* RetargetTest::body_ = nullptr;

void ExpectNear(const Vector3d& found, const Vector3d& expected) {
  EXPECT_LT((found - expected).norm(), 1e-9)
      << found.transpose() << " is not " << expected.transpose();
}

TEST_F(RetargetTest, NoRotationsGiveTheRestPoseOfTheSource) {
  WalkingRig rig;  // arms out, legs straight
  const JointFrames frames = First(rig.motion());
  for (const int joint : {kLElbow, kLWrist, kLHandEnd}) {
    ExpectNear(Bone(frames, joint), Vector3d::UnitX());
    ExpectNear(Bone(frames, MirrorJoint(joint)), -Vector3d::UnitX());
  }
  for (const int joint : {kLKnee, kLAnkle, kRKnee, kRAnkle}) {
    ExpectNear(Bone(frames, joint), -Vector3d::UnitY());
  }
  // The axis rests as ours does, and the feet are level.
  ExpectNear(Bone(frames, kNeck), body_->skeleton.rest_direction[kNeck]);
  ExpectNear(Bone(frames, kHeadEnd), body_->skeleton.rest_direction[kHeadEnd]);
  EXPECT_NEAR(Bone(frames, kLFootEnd).y(),
              body_->skeleton.rest_direction[kLFootEnd].y(),
              1e-9);
  EXPECT_NEAR(Bone(frames, kLFootEnd).x(), 0, 1e-9);
}

TEST_F(RetargetTest, ATurnOfTheSourceIsATurnOfOurs) {
  WalkingRig rig;
  rig.Value("LeftArm", 0) = -50;
  rig.Value("LeftForeArm", 1) = 40;
  rig.RotationX("RightUpLeg") = -30;
  rig.RotationX("RightLeg") = 50;
  rig.RotationX("Spine1") = 12;
  const JointFrames before = First(rig.motion());
  for (int axis = 0; axis < 3; ++axis) {
    WalkingRig turned = rig;
    turned.Value("Hips", 3 + axis) = 90;  // Z, Y, X
    const Matrix3d turn =
        Eigen::AngleAxisd(std::numbers::pi / 2, Vector3d::Unit(2 - axis))
            .toRotationMatrix();
    const JointFrames after = First(turned.motion());
    for (int joint = 0; joint < kNumJoints; ++joint) {
      EXPECT_TRUE(after.world_from_joint[joint].isApprox(
          turn * before.world_from_joint[joint], 1e-9))
          << kJointNames[joint] << " axis " << axis;
    }
  }
}

TEST_F(RetargetTest, BonesPointWhereTheSourcesDo) {
  WalkingRig rig;
  rig.Value("LeftArm", 0) = -60;
  rig.Value("LeftArm", 1) = 20;
  rig.Value("LeftForeArm", 1) = -70;
  rig.Value("RightArm", 0) = 30;
  rig.Value("RightForeArm", 2) = 35;
  rig.RotationX("LeftUpLeg") = -70;
  rig.Value("LeftUpLeg", 0) = 15;
  rig.RotationX("LeftLeg") = 60;
  rig.RotationX("RightLeg") = 20;
  const JointFrames frames = First(rig.motion());
  const auto expect = [&](int joint, const char* from, const char* to) {
    ExpectNear(Bone(frames, joint), Between(rig.motion(), from, to));
  };
  expect(kLElbow, "LeftArm", "LeftForeArm");
  expect(kLWrist, "LeftForeArm", "LeftHand");
  expect(kLHandEnd, "LeftHand", "LeftHandIndex1");
  expect(kRElbow, "RightArm", "RightForeArm");
  expect(kRWrist, "RightForeArm", "RightHand");
  expect(kLKnee, "LeftUpLeg", "LeftLeg");
  expect(kLAnkle, "LeftLeg", "LeftFoot");
  expect(kRAnkle, "RightLeg", "RightFoot");
}

TEST_F(RetargetTest, ChainsOfJointsAreComposed) {
  // Three joints of the spine bend by 10 degrees each: the shoulders' line
  // turns by 30, and so do ours.
  WalkingRig rig;
  for (const char* joint : {"LowerBack", "Spine", "Spine1"}) {
    rig.Value(joint, 1) = 10;  // about Y
  }
  const JointFrames frames = First(rig.motion());
  const Vector3d line =
      (frames.joint_in_world[kLShoulder] - frames.joint_in_world[kRShoulder])
          .normalized();
  ExpectNear(
      line,
      Eigen::AngleAxisd(30 * kDegree, Vector3d::UnitY()) * Vector3d::UnitX());
  EXPECT_TRUE(frames.world_from_joint[kRoot].isIdentity(1e-9));
}

TEST_F(RetargetTest, CollarsLiftTheShouldersOnly) {
  WalkingRig rig;
  const JointFrames before = First(rig.motion());
  rig.Value("LeftShoulder", 0) = 20;  // about Z: up
  rig.Value("LeftArm", 0) = -20;      // the arm stays level
  const JointFrames after = First(rig.motion());
  EXPECT_GT(after.joint_in_world[kLShoulder].y(),
            before.joint_in_world[kLShoulder].y() + 0.04);
  ExpectNear(Bone(after, kLElbow), Vector3d::UnitX());
  ExpectNear(after.joint_in_world[kRShoulder] - after.joint_in_world[kNeck],
             before.joint_in_world[kRShoulder] - before.joint_in_world[kNeck]);
}

TEST_F(RetargetTest, TheWayFollowsTheLegs) {
  WalkingRig rig;
  rig.AddFrame();
  rig.Value("Hips", 2) = 100;
  const RetargetResult result = Run(rig.motion(), Plain());
  const Skeleton& s = body_->skeleton;
  const double ratio = (s.length[kLKnee] + s.length[kLAnkle]) /
                       (WalkingRig::kThigh + WalkingRig::kShank);
  EXPECT_NEAR(result.metres_per_unit, ratio, 1e-12);
  EXPECT_NEAR(
      (result.poses[1].root_in_world - result.poses[0].root_in_world).norm(),
      100 * ratio,
      1e-9);
  RetargetOptions metric = Plain();
  metric.scale = 0.01;
  const RetargetResult as_said = Run(rig.motion(), metric);
  EXPECT_NEAR(
      as_said.poses[1].root_in_world.z() - as_said.poses[0].root_in_world.z(),
      1,
      1e-9);
}

TEST_F(RetargetTest, FilesWithZUpAreTurned) {
  WalkingRig rig;
  rig.Walk(0.5);
  const RetargetResult upright = Run(rig.motion(), Plain());
  BvhMotion lying = rig.motion();
  // (x, y, z) becomes (x, -z, y), in offsets, positions and rotations.
  for (BvhJoint& joint : lying.joints) {
    joint.offset =
        Vector3d(joint.offset.x(), -joint.offset.z(), joint.offset.y());
    if (joint.channels.size() < 3) continue;
    const int first = joint.first_channel + (joint.parent < 0 ? 3 : 0);
    // About Z, Y, X becomes about Y, -Z, X; written as Y, Z, X.
    lying.values.col(first + 1) *= -1;
    for (BvhChannel& channel : joint.channels) {
      if (channel == BvhChannel::kZRotation) {
        channel = BvhChannel::kYRotation;
      } else if (channel == BvhChannel::kYRotation) {
        channel = BvhChannel::kZRotation;
      }
    }
  }
  const Eigen::VectorXd y = lying.values.col(1);
  lying.values.col(1) = -lying.values.col(2);
  lying.values.col(2) = y;
  const RetargetResult turned = Run(lying, Plain());
  EXPECT_THAT(turned.notes, Contains(HasSubstr("vertical axis is +Z")));
  // About Y first flips the sign: compare what is left, the joints.
  for (std::size_t t = 0; t < turned.poses.size(); ++t) {
    const JointFrames a = ForwardKinematics(body_->skeleton, upright.poses[t]);
    const JointFrames b = ForwardKinematics(body_->skeleton, turned.poses[t]);
    for (const int joint : {kRoot, kNeck, kLAnkle, kRAnkle, kLFootEnd}) {
      EXPECT_LT((a.joint_in_world[joint] - b.joint_in_world[joint]).norm(),
                1e-6)
          << t << " " << kJointNames[joint];
    }
  }
}

TEST_F(RetargetTest, OurOwnMotionComesBack) {
  const JointLimits limits(body_->skeleton);
  std::vector<Pose> poses = limits.RandomPoses(8, 3);
  for (Pose& pose : poses) {
    // What the file's joints cannot tell apart, or what is ours to choose: the
    // plane of the hinges, twists of wrists, and turns of ends.
    for (const int joint : {kLElbow, kRElbow, kLKnee, kRKnee}) {
      SwingTwist angles = limits.Measure(joint, pose.rotation[joint]);
      angles.side = 0;
      angles.bend = std::max(angles.bend, 30 * kDegree);
      pose.rotation[joint] = limits.Rotation(joint, angles);
    }
    for (const int joint : {kLWrist, kRWrist}) {
      SwingTwist angles = limits.Measure(joint, pose.rotation[joint]);
      angles.twist = 0;
      pose.rotation[joint] = limits.Rotation(joint, angles);
    }
  }
  const BvhMotion motion = BvhFromPoses(body_->skeleton, poses, 0.1);
  RetargetOptions options = Plain();
  options.frames_per_second = 10;
  const RetargetResult result = Run(motion, options);
  EXPECT_EQ(result.names, "sweepfit");
  ASSERT_EQ(result.poses.size(), poses.size());
  for (std::size_t t = 0; t < poses.size(); ++t) {
    const JointFrames a = ForwardKinematics(body_->skeleton, poses[t]);
    const JointFrames b = ForwardKinematics(body_->skeleton, result.poses[t]);
    // Up to where the floor is.
    const Vector3d shift = a.joint_in_world[kRoot] - b.joint_in_world[kRoot];
    for (const int joint : {kLElbow, kLWrist, kRHandEnd, kLKnee, kRAnkle}) {
      ExpectNear(Bone(b, joint), Bone(a, joint));
    }
    for (const int joint : {kRoot, kNeck, kLKnee, kRAnkle, kLFootEnd}) {
      EXPECT_LT(
          (a.joint_in_world[joint] - b.joint_in_world[joint] - shift).norm(),
          1e-5)
          << t << " " << kJointNames[joint];
    }
  }
}

TEST_F(RetargetTest, StandingFeetStayWhereTheyAre) {
  WalkingRig rig;
  rig.Walk(3);
  RetargetOptions options;
  const RetargetResult locked = Run(rig.motion(), options);
  EXPECT_GT(locked.standing_share, 0.9);
  EXPECT_LT(locked.longest_slide, 0.005);

  // Measured on the poses, away from contact detection: the ankle of a planted
  // foot (the middle of each stance) does not move, and stands on the floor.
  const auto feet = MeasureFeet(*body_);
  for (int step = 0; step < 2; ++step) {
    const int begin = 60 * step + 60 + 6, end = 60 * step + 60 + 30;
    const FootPoints first = FootPointsOf(
        ForwardKinematics(body_->skeleton, locked.poses[begin]), feet)[0];
    for (int t = begin; t < end; ++t) {
      const FootPoints points = FootPointsOf(
          ForwardKinematics(body_->skeleton, locked.poses[t]), feet)[0];
      EXPECT_LT((points.heel - first.heel).norm(), 0.003) << t;
      EXPECT_LT((points.ball - first.ball).norm(), 0.004) << t;
      EXPECT_NEAR(points.heel.y(), 0, 0.003) << t;
      EXPECT_NEAR(points.ball.y(), 0, 0.003) << t;
    }
  }

  // The rig's legs fit nobody: without the lock feet do slide.
  options.lock_feet = false;
  EXPECT_GT(Run(rig.motion(), options).longest_slide, 0.005);
}

TEST_F(RetargetTest, LimitsHoldAndAreTold) {
  WalkingRig rig;
  rig.Walk(2);
  // Knees that overextend and a head that turns to the back.
  for (int t = 0; t < rig.motion().num_frames(); ++t) {
    BvhMotion& motion = rig.motion();
    const auto set = [&](const char* joint, int channel, double value) {
      motion.values(
          t, motion.joints[motion.Find(joint)].first_channel + channel) = value;
    };
    if (t > 90) set("LeftLeg", 2, -30);
    if (t > 60) set("Head", 1, 100);
  }
  const JointLimits limits(body_->skeleton);
  const RetargetResult result = Run(rig.motion(), {});
  for (const Pose& pose : result.poses) {
    EXPECT_TRUE(limits.Violations(pose, 1e-6).empty());
    for (const int knee : {kLKnee, kRKnee}) {
      EXPECT_GT(limits.Measure(knee, pose.rotation[knee]).bend,
                -5.01 * kDegree);
    }
  }
  EXPECT_THAT(result.notes, Contains(HasSubstr("head: twist held")));

  RetargetOptions free;
  free.limit_joints = false;
  const RetargetResult beyond = Run(rig.motion(), free);
  EXPECT_THAT(beyond.notes, Contains(HasSubstr("head: twist leaves")));
}

TEST_F(RetargetTest, LegsDoNotGoThroughEachOther) {
  const JointLimits limits(body_->skeleton);
  WalkingRig rig;
  rig.Walk(2);
  const auto crosses = HasSubstr("leg against leg");
  EXPECT_THAT(Run(rig.motion(), {}).notes, Not(Contains(crosses)));
  // The left leg swings through the right one.
  BvhMotion& motion = rig.motion();
  const int hip = motion.joints[motion.Find("LeftUpLeg")].first_channel;
  for (int t = 0; t < motion.num_frames(); ++t) motion.values(t, hip) = -20;
  const RetargetResult result = Run(motion, {});
  EXPECT_THAT(result.notes,
              Contains(HasSubstr("l_hip: leg against leg held at its limit")));
  for (const Pose& pose : result.poses) {
    EXPECT_TRUE(limits.Violations(pose, 1e-6).empty());
  }
  EXPECT_THAT(Run(motion, Plain()).notes,
              Contains(HasSubstr("l_hip: leg against leg leaves its limit")));
}

TEST_F(RetargetTest, ElbowsBendAboutTheirHinge) {
  // The source bends its forearm upwards; ours must turn the upper arm.
  WalkingRig rig;
  rig.Value("LeftArm", 0) = -60;
  rig.Value("LeftForeArm", 0) = 60;
  const RetargetResult result = Run(rig.motion(), Plain());
  const JointLimits limits(body_->skeleton);
  const SwingTwist angles =
      limits.Measure(kLElbow, result.poses[0].rotation[kLElbow]);
  EXPECT_NEAR(angles.bend, 60 * kDegree, 1e-6);
  EXPECT_NEAR(angles.side, 0, 1e-6);
}

TEST_F(RetargetTest, PartAndRateAreAsAsked) {
  WalkingRig rig;
  rig.Walk(2);
  RetargetOptions options;
  options.start = 0.5;
  options.end = 1.5;
  options.frames_per_second = 24;
  const RetargetResult result = Run(rig.motion(), options);
  ASSERT_EQ(result.poses.size(), 25u);
  EXPECT_EQ(result.time.front(), 0);
  EXPECT_NEAR(result.time.back(), 1, 1e-12);
  EXPECT_EQ(Run(rig.motion(), {}).frame_time, 1.0 / 60);
}

TEST_F(RetargetTest, BadInputIsNamed) {
  WalkingRig rig;
  const auto error = [&](const BvhMotion& motion,
                         const RetargetOptions& options) -> std::string {
    try {
      Run(motion, options);
    } catch (const InputError& e) {
      return e.what();
    }
    return "no error";
  };
  RetargetOptions late;
  late.start = 9;
  EXPECT_THAT(error(rig.motion(), late), HasSubstr("walk.bvh: no frame"));
  late.end = 8;
  EXPECT_THAT(error(rig.motion(), late), HasSubstr("end must lie after"));
  RetargetOptions scale;
  scale.scale = -1;
  EXPECT_THAT(error(rig.motion(), scale), HasSubstr("scale"));

  BvhMotion renamed = rig.motion();
  renamed.joints[renamed.Find("LeftLeg")].name = "Knie";
  EXPECT_THAT(error(renamed, {}), HasSubstr("l_knee (sought as LeftLeg)"));

  BvhMotion swapped = rig.motion();
  std::swap(swapped.joints[swapped.Find("LeftLeg")].name,
            swapped.joints[swapped.Find("LeftUpLeg")].name);
  EXPECT_THAT(error(swapped, {}),
              HasSubstr("'LeftLeg', mapped to l_knee, does not hang on "
                        "'LeftUpLeg', mapped to l_hip"));

  BvhMotion flat = rig.motion();
  for (BvhJoint& joint : flat.joints) joint.offset.setZero();
  EXPECT_THAT(error(flat, {}), HasSubstr("legs have no length"));
}

TEST(FootLockTest, StandingIsLowAndSlow) {
  const double frame_time = 0.01;
  std::vector<Vector3d> point;
  for (int t = 0; t < 300; ++t) {
    // Rests, swings high and fast, skims low and fast, rests.
    double z = 0, y = 0.01;
    if (t >= 100 && t < 200) {
      z = 0.03 * (t - 100);
      if (t < 150) y += 0.1;
    } else if (t >= 200) {
      z = 3;
    }
    point.push_back({0, y, z});
  }
  const std::vector<bool> stands = FindStanding(point, frame_time, 0.8);
  for (const int t : {5, 50, 90, 210, 290}) EXPECT_TRUE(stands[t]) << t;
  for (const int t : {105, 125, 149, 160, 190}) EXPECT_FALSE(stands[t]) << t;
}

TEST(FootLockTest, SlideIsTheLongestWayOfOneStance) {
  const std::vector<Vector3d> point = {{0, 0, 0},
                                       {0.03, 9, 0},
                                       {0, 0, 0.04},
                                       {5, 0, 5},
                                       {6, 0, 6},
                                       {6, 0, 6.01}};
  EXPECT_NEAR(
      LongestSlide(point, {true, true, true, false, true, true}), 0.05, 1e-4);
  EXPECT_EQ(LongestSlide(point, {false, false, false, true, false, false}), 0);
}

// A foot comes down on its heel, stands, and leaves over its toes: it neither
// slides nor goes below the floor.
TEST_F(RetargetTest, FeetRollOverTheirSoles) {
  const Skeleton& skeleton = body_->skeleton;
  const auto feet = MeasureFeet(*body_);
  constexpr int kFrames = 120;
  std::vector<Pose> poses(kFrames);
  std::array<FootContact, 2> contact;
  for (FootContact& of_side : contact) {
    of_side.heel.assign(kFrames, false);
    of_side.ball.assign(kFrames, false);
    of_side.stance.assign(kFrames, true);
  }
  const double height =
      -(RestFrames(skeleton).joint_in_world[kLAnkle].y() + feet[0].heel.y());
  for (int t = 0; t < kFrames; ++t) {
    // Toes 25 degrees up, level, heel 30 degrees up; the body goes ahead.
    const double pitch = t < 30   ? -25 * (30 - t) / 30.0
                         : t < 80 ? 0
                                  : 30 * (t - 80) / 40.0;
    Pose& pose = poses[t];
    pose.root_in_world = {0, height - 0.05, 0.001 * (t - 60)};
    for (const int ankle : {kLAnkle, kRAnkle}) {
      pose.rotation[ankle] =
          Eigen::AngleAxisd(pitch * kDegree, Vector3d::UnitX());
    }
    for (FootContact& of_side : contact) {
      of_side.heel[t] = of_side.ball[t] = t >= 30 && t < 80;
    }
  }
  LockFeet(skeleton, feet, contact, 1.0 / 120, &poses);
  for (int side = 0; side < 2; ++side) {
    const int ankle = side == 0 ? kLAnkle : kRAnkle;
    const auto sole = [&](int t) {
      const JointFrames frames = ForwardKinematics(skeleton, poses[t]);
      std::vector<Vector3d> points;
      for (const Vector3d& point : feet[side].sole) {
        points.push_back(frames.joint_in_world[ankle] +
                         frames.world_from_joint[ankle] * point);
      }
      return points;
    };
    const auto lower = [](const Vector3d& a, const Vector3d& b) {
      return a.y() < b.y();
    };
    std::vector<Vector3d> before = sole(0);
    for (int t = 1; t < kFrames; ++t) {
      const std::vector<Vector3d> points = sole(t);
      const auto lowest = std::min_element(points.begin(), points.end(), lower);
      EXPECT_NEAR(lowest->y(), 0, 0.002) << t;
      // The point that stood may lift but has not slid.
      const auto stood = std::min_element(before.begin(), before.end(), lower);
      const Vector3d way = points[stood - before.begin()] - *stood;
      EXPECT_LT(std::hypot(way.x(), way.z()), 0.001) << t;
      before = points;
    }
  }
}

// Toes that point outwards turn the shank as well as the ankle.
TEST_F(RetargetTest, ToesOutAreSharedByKneeAndAnkle) {
  WalkingRig rig;
  for (const char* foot : {"LeftFoot", "RightFoot"}) {
    rig.Value(foot, 1) = foot[0] == 'L' ? 30 : -30;  // about Y
  }
  const RetargetResult result = Run(rig.motion(), Plain());
  const JointLimits limits(body_->skeleton);
  for (const int ankle : {kLAnkle, kRAnkle}) {
    const Pose& pose = result.poses.front();
    EXPECT_LT(std::abs(limits.Measure(ankle, pose.rotation[ankle]).side),
              20 * kDegree);
    EXPECT_NEAR(
        std::abs(limits.Measure(ankle - 1, pose.rotation[ankle - 1]).twist),
        15 * kDegree,
        4 * kDegree);
    const Vector3d foot = Bone(First(rig.motion()), ankle + 1);
    const Vector3d rest = body_->skeleton.rest_direction[ankle + 1];
    EXPECT_NEAR(std::abs(std::atan2(foot.x(), foot.z()) -
                         std::atan2(rest.x(), rest.z())),
                30 * kDegree,
                4 * kDegree);
  }
}

TEST_F(RetargetTest, FeetAreMeasuredOnTheSole) {
  const Body& body = *body_;
  const auto feet = MeasureFeet(body);
  double lowest = 0;
  for (const Vector3d& vertex : RestVertices(body)) {
    lowest = std::min(lowest, vertex.y());
  }
  const JointFrames rest = RestFrames(body.skeleton);
  for (int side = 0; side < 2; ++side) {
    const Vector3d& ankle = rest.joint_in_world[side == 0 ? kLAnkle : kRAnkle];
    EXPECT_NEAR(ankle.y() + feet[side].heel.y(), lowest, 0.01);
    EXPECT_LT(feet[side].heel.z(), 0);
    EXPECT_GT(feet[side].ball.z(), 0.08);
    // From behind the heel to before the ball.
    double first = 0, last = 0;
    for (const Vector3d& point : feet[side].sole) {
      first = std::min(first, point.z());
      last = std::max(last, point.z());
    }
    EXPECT_LT(first, feet[side].heel.z() - 0.005);
    EXPECT_GT(last, feet[side].ball.z() + 0.03);
  }
  EXPECT_NEAR(feet[0].ball.x(), -feet[1].ball.x(), 1e-9);
}

}  // namespace
}  // namespace sweepfit
