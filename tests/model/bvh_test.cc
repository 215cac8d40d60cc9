// SPDX-License-Identifier: Apache-2.0
#include "model/bvh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ostream>
#include <string>
#include <vector>

#include "model/input_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr char kSmall[] = R"(HIERARCHY
ROOT Hips
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation
  JOINT Left Leg
  {
    OFFSET 10 0 0
    CHANNELS 3 Xrotation Zrotation Yrotation
    End Site
    {
      OFFSET 0 -80 0
    }
  }
  JOINT Empty {
    OFFSET 0 0 0
    CHANNELS 0
    JOINT Last
    {
      OFFSET 0 1e1 0
      CHANNELS 1 Zrotation
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.04
0 0 0 0 0 0 0 0 0 0
1 2 3 90 0 0 0 90 0 +30
)";

TEST(BvhTest, ReadsAnyHierarchyAndChannelOrder) {
  const BvhMotion motion = ParseBvh(kSmall, "small.bvh");
  ASSERT_EQ(motion.joints.size(), 5u);
  EXPECT_EQ(motion.joints[1].name, "Left Leg");
  EXPECT_TRUE(motion.joints[2].is_end_site());
  EXPECT_EQ(motion.joints[2].parent, 1);
  EXPECT_EQ(motion.joints[4].parent, 3);
  EXPECT_EQ(motion.joints[4].first_channel, 9);
  EXPECT_EQ(motion.num_frames(), 2);
  EXPECT_EQ(motion.frame_time, 0.04);
  EXPECT_EQ(motion.values(1, 9), 30);
  EXPECT_EQ(motion.Find("Last"), 4);
  EXPECT_EQ(motion.Find("Nobody"), -1);
}

TEST(BvhTest, KinematicsByHand) {
  const BvhMotion motion = ParseBvh(kSmall, "small.bvh");
  const BvhFrames rest = BvhRestFrames(motion);
  EXPECT_TRUE(rest.joint_in_world[2].isApprox(Eigen::Vector3d(10, 10, 0)));
  // Hips at (1, 2, 3), turned by 90 degrees about Y: x becomes -z. The leg
  // turns by 90 degrees about Z: what hung down points along +x, so -z.
  const BvhFrames posed = BvhFramesAt(motion, 1);
  EXPECT_TRUE(posed.joint_in_world[1].isApprox(Eigen::Vector3d(1, 2, -7)));
  EXPECT_TRUE(posed.joint_in_world[2].isApprox(Eigen::Vector3d(1, 2, -87)));
}

TEST(BvhTest, RotationsMultiplyInTheOrderOfTheFile) {
  std::string text = kSmall;
  text.replace(text.rfind("90 0 0 0 90 0"), 13, "0 0 0 90 0 90");
  const Eigen::Matrix3d leg =
      BvhFramesAt(ParseBvh(text, "small.bvh"), 1).world_from_joint[1];
  const Eigen::Matrix3d expected =
      (Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitX()) *
       Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitY()))
          .toRotationMatrix();
  EXPECT_TRUE(leg.isApprox(expected, 1e-12)) << leg;
}

TEST(BvhTest, WrittenTextReadsTheSame) {
  const BvhMotion motion = ParseBvh(kSmall, "small.bvh");
  const std::string text = BvhToText(motion);
  const BvhMotion again = ParseBvh(text, "again.bvh");
  EXPECT_EQ(BvhToText(again), text);
  EXPECT_EQ(again.values, motion.values);
}

TEST(BvhTest, PosesSurviveTheFile) {
  const Skeleton skeleton = ToySkeleton();
  std::vector<Pose> poses;
  for (unsigned seed = 0; seed < 30; ++seed) {
    poses.push_back(RandomPose(seed == 0 ? 0 : 3.1, seed));
  }
  // Where the angles Z and Y turn about the same axis.
  for (const double angle : {90.0, -90.0, 90.0001}) {
    Pose pose;
    pose.rotation[kRoot] = Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) *
                           Eigen::AngleAxisd(angle * std::numbers::pi / 180,
                                             Eigen::Vector3d::UnitX());
    poses.push_back(pose);
  }
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "poses.bvh").string();
  SaveBvh(BvhFromPoses(skeleton, poses, 0.01), path);
  const BvhPoses again = PosesFromBvh(LoadBvh(path), path);
  ASSERT_EQ(again.poses.size(), poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const JointFrames expected = ForwardKinematics(skeleton, poses[i]);
    const JointFrames found = ForwardKinematics(again.skeleton, again.poses[i]);
    for (int joint = 0; joint < kNumJoints; ++joint) {
      EXPECT_LT(
          (found.joint_in_world[joint] - expected.joint_in_world[joint]).norm(),
          1e-5)
          << "pose " << i << " " << kJointNames[joint];
      if (joint != kHeadEnd && joint != kLHandEnd && joint != kRHandEnd &&
          joint != kLFootEnd && joint != kRFootEnd) {
        EXPECT_LT(
            (found.world_from_joint[joint] - expected.world_from_joint[joint])
                .norm(),
            1e-5)
            << "pose " << i << " " << kJointNames[joint];
      }
    }
  }
}

TEST(BvhTest, AnglesDoNotJump) {
  std::vector<Pose> poses;
  for (int i = 0; i <= 100; ++i) {
    Pose pose;
    // More than a turn about Z, and through 90 degrees about X.
    pose.rotation[kRoot] =
        Eigen::AngleAxisd(0.08 * i, Eigen::Vector3d::UnitZ());
    pose.rotation[kSpine] =
        Eigen::AngleAxisd(0.0301 * i, Eigen::Vector3d::UnitX());
    poses.push_back(pose);
  }
  const BvhMotion motion = BvhFromPoses(ToySkeleton(), poses, 0.01);
  for (int frame = 1; frame < motion.num_frames(); ++frame) {
    EXPECT_LT((motion.values.row(frame) - motion.values.row(frame - 1))
                  .cwiseAbs()
                  .maxCoeff(),
              10)
        << "frame " << frame;
  }
}

TEST(BvhTest, OtherSkeletonsAreNotOurs) {
  EXPECT_THROW(PosesFromBvh(ParseBvh(kSmall, "small.bvh"), "small.bvh"),
               InputError);
}

struct Fault {
  std::string expected;  // after "bad.bvh:"
  std::string old_text;
  std::string new_text;

  friend void PrintTo(const Fault& fault, std::ostream* out) {
    *out << fault.expected;
  }
};

class BvhFaultTest : public ::testing::TestWithParam<Fault> {};

TEST_P(BvhFaultTest, IsNamedWithItsLine) {
  std::string text = kSmall;
  const std::size_t at = text.find(GetParam().old_text);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, GetParam().old_text.size(), GetParam().new_text);
  try {
    ParseBvh(text, "bad.bvh");
    FAIL() << "no error; expected " << GetParam().expected;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), StartsWith("bad.bvh:" + GetParam().expected));
  }
}

INSTANTIATE_TEST_SUITE_P(
    All,
    BvhFaultTest,
    ::testing::Values(
        Fault{"1: expected HIERARCHY, found the end of the file", kSmall, ""},
        Fault{"1: expected HIERARCHY, found 'glTF?", kSmall, "glTF\x02 x"},
        Fault{"2: expected ROOT, found 'JOINT'", "ROOT", "JOINT"},
        Fault{"2: a joint without a name", "ROOT Hips", "ROOT"},
        Fault{"3: expected {, found 'OFFSET'", "{\n  OFFSET 0 90", "OFFSET 0"},
        Fault{"4: expected OFFSET, found 'CHANNELS'", "OFFSET 0 90 0\n", ""},
        Fault{"4: OFFSET is not a number but 'up'", "0 90 0", "0 up 0"},
        Fault{"4: OFFSET is not a number but 'nan'", "0 90 0", "0 nan 0"},
        Fault{"5: CHANNELS is not a count but 'six'",
              "CHANNELS 6",
              "CHANNELS six"},
        Fault{
            "5: CHANNELS is not a count but '-6'", "CHANNELS 6", "CHANNELS -6"},
        Fault{"5: no channel is called 'Wrotation'",
              "Yrotation Xrotation Zr",
              "Wrotation Xrotation Zr"},
        Fault{"5: channel 'Xrotation' twice",
              "Yrotation Xrotation",
              "Xrotation Xrotation"},
        Fault{"6: no channel is called 'JOINT'", "CHANNELS 6", "CHANNELS 7"},
        Fault{"5: expected CHANNELS, JOINT, End Site or }, found 'Zrotation'",
              "CHANNELS 6",
              "CHANNELS 5"},
        Fault{"6: a second joint 'Hips'", "Left Leg", "Hips"},
        Fault{"10: CHANNELS twice",
              "    End Site",
              "    CHANNELS 1 Xrotation End Site"},
        Fault{
            "13: expected }, found 'JOINT'", "-80 0\n", "-80 0\n JOINT Toe\n"},
        Fault{"24: expected CHANNELS, JOINT, End Site or }, found 'MOTION'",
              "  }\n}\nMOTION",
              "  }\nMOTION"},
        Fault{"25: expected MOTION, found '}'",
              "  }\n}\nMOTION",
              "  }\n}\n}\nMOTION"},
        Fault{"25: a second ROOT", "MOTION", "ROOT Other"},
        Fault{"26: expected MOTION, found 'Frames:'", "\nMOTION", "\n"},
        Fault{
            "26: Frames is not a count but '2.5'", "Frames: 2", "Frames: 2.5"},
        Fault{"26: a motion without frames", "Frames: 2", "Frames: 0"},
        Fault{"26: expected Frames:, found 'Frame'", "Frames: 2\n", ""},
        Fault{"27: expected Frame, found '0'", "Frame Time: 0.04\n", ""},
        Fault{"27: Frame Time is not positive", "0.04", "0"},
        Fault{"27: Frame Time is not a number", "0.04", "0,04"},
        Fault{"27: the file ends before its 2000000000 frames",
              "Frames: 2",
              "Frames: 2000000000"},
        Fault{"29: frame 2 has 8 values, not 10", "90 0 +30\n", "90\n0 +30\n"},
        Fault{"29: frame 2 has more than its 10 values", "+30", "+30 1"},
        Fault{"30: the file ends in frame 3 of 3", "Frames: 2", "Frames: 3"},
        Fault{"29: more than the 1 frames announced", "Frames: 2", "Frames: 1"},
        Fault{"29: a value is not a number but '1e999'", "+30", "1e999"},
        Fault{"29: a value is not a number but '3O'", "+30", "3O"}));

TEST(BvhTest, DeepHierarchiesAreRefused) {
  std::string text = "HIERARCHY\nROOT r\n";
  for (int i = 0; i < 100000; ++i) {
    text += "{ OFFSET 0 0 0\nJOINT j" + std::to_string(i) + "\n";
  }
  EXPECT_THROW(ParseBvh(text, "deep.bvh"), InputError);
}

TEST(BvhTest, MissingFileIsNamed) {
  try {
    LoadBvh("/nowhere/walk.bvh");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/nowhere/walk.bvh"));
  }
}

}  // namespace
}  // namespace sweepfit
