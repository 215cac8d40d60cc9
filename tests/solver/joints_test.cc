// SPDX-License-Identifier: Apache-2.0
#include "solver/joints.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/anthropometry.h"
#include "model/joint_angles.h"
#include "tests/support/test_person.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

constexpr double kStature = 1.7;

// Every joint of a posture as a landmark.
LandmarkResult LandmarksOf(const JointFrames& frames, double sigma) {
  LandmarkResult result;
  for (int j = 0; j < kNumJoints; ++j) {
    Landmark3 landmark;
    landmark.name = kJointNames[j];
    landmark.joint = j;
    landmark.point_in_world = frames.joint_in_world[j];
    landmark.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
    landmark.num_views = 8;
    result.landmarks.push_back(landmark);
  }
  const Vector3d to_left =
      frames.joint_in_world[kLHip] - frames.joint_in_world[kRHip];
  result.facing_in_world = to_left.cross(Vector3d::UnitY()).normalized();
  result.stature = kStature;
  result.stature_sigma = 0.02;
  return result;
}

JointFrames PosedFrames(const Skeleton& skeleton,
                        const std::vector<double>& coordinates) {
  const JointAngles angles(skeleton);
  return ForwardKinematics(skeleton, angles.ToPose(coordinates.data()));
}

TEST(EstimateJoints, RecoversAPostureFromExactLandmarks) {
  const Skeleton base = TestSkeleton();
  const JointAngles angles(base);
  Skeleton person = base;
  for (int j = 1; j < kNumJoints; ++j) {
    person.length[j] *= 1 + 0.01 * (LengthGroup(j) % 5 - 2);
  }
  for (unsigned seed = 1; seed < 6; ++seed) {
    const JointFrames truth =
        PosedFrames(person, RandomCoordinates(angles, seed));
    StageSummary summary;
    const JointResult result = EstimateJoints(
        {LandmarksOf(truth, 1e-4)}, base, kStature, {}, &summary);
    EXPECT_EQ(summary.status, "ok");
    for (int j = 0; j < kNumJoints; ++j) {
      // Priors pull by a fraction of the landmarks' 0.1 mm.
      EXPECT_LT(
          (result.poses[0].frames.joint_in_world[j] - truth.joint_in_world[j])
              .norm(),
          5e-4)
          << kJointNames[j] << " seed " << seed;
    }
  }
}

TEST(EstimateJoints, AnyFacingIsFound) {
  const Skeleton base = TestSkeleton();
  const JointAngles angles(base);
  for (const double yaw : {0.0, 1.6, 3.1, -1.5, -3.1}) {
    std::vector<double> coordinates(angles.num_parameters(), 0.0);
    coordinates[angles.Find("root_twist")] = yaw;
    const JointFrames truth = PosedFrames(base, coordinates);
    StageSummary summary;
    const JointResult result = EstimateJoints(
        {LandmarksOf(truth, 0.005)}, base, kStature, {}, &summary);
    EXPECT_LT((result.poses[0].frames.joint_in_world[kLWrist] -
               truth.joint_in_world[kLWrist])
                  .norm(),
              0.01)
        << yaw;
  }
}

TEST(EstimateJoints, PosesShareOneSetOfLengths) {
  const Skeleton base = TestSkeleton();
  const JointAngles angles(base);
  const JointFrames first = PosedFrames(base, RandomCoordinates(angles, 3));
  const JointFrames second = PosedFrames(base, RandomCoordinates(angles, 4));
  StageSummary summary;
  const JointResult result =
      EstimateJoints({LandmarksOf(first, 0.01), LandmarksOf(second, 0.01)},
                     base,
                     kStature,
                     {},
                     &summary);
  ASSERT_EQ(result.poses.size(), 2u);
  for (const JointEstimate& pose : result.poses) {
    for (int j = 1; j < kNumJoints; ++j) {
      const double length = (pose.frames.joint_in_world[j] -
                             pose.frames.joint_in_world[kJointParents[j]])
                                .norm();
      EXPECT_NEAR(length, result.skeleton.length[j], 1e-9);
      EXPECT_NEAR(length, result.skeleton.length[MirrorJoint(j)], 1e-9);
    }
  }
}

TEST(EstimateJoints, AMissingLandmarkIsLessCertainAndStaysPlausible) {
  const Skeleton base = TestSkeleton();
  const JointAngles angles(base);
  const JointFrames truth = PosedFrames(base, RandomCoordinates(angles, 5));
  LandmarkResult all = LandmarksOf(truth, 0.01);
  LandmarkResult missing = all;
  std::erase_if(missing.landmarks, [](const Landmark3& landmark) {
    return landmark.joint == kLElbow;
  });
  StageSummary summary;
  const JointResult with = EstimateJoints({all}, base, kStature, {}, &summary);
  const JointResult without =
      EstimateJoints({missing}, base, kStature, {}, &summary);
  EXPECT_GT(without.poses[0].covariance[kLElbow].trace(),
            2 * with.poses[0].covariance[kLElbow].trace());
  EXPECT_LT(without.poses[0].reliability[kLElbow],
            with.poses[0].reliability[kLElbow]);
  // What the landmark does not say, tables and priors do.
  EXPECT_LT(without.poses[0].evidence[kLElbow].at("landmark"),
            with.poses[0].evidence[kLElbow].at("landmark") - 0.1);
  for (const auto& evidence : without.poses[0].evidence) {
    double sum = 0;
    for (const auto& [family, share] : evidence) {
      EXPECT_GT(share, 0) << family;
      sum += share;
    }
    EXPECT_NEAR(sum, 1, 1e-9);
  }
  EXPECT_LT((without.poses[0].frames.joint_in_world[kLElbow] -
             truth.joint_in_world[kLElbow])
                .norm(),
            0.12);
}

// The identity of the evaluation function: the refined length of a bone is the
// convex combination of the observed, the template's and the tables' length.
TEST(EstimateJoints, PaperModeIsTheConvexCombination) {
  const Skeleton base = TestSkeleton();
  const JointAngles angles(base);
  Skeleton person = base;
  for (double& length : person.length) length *= 1.08;
  const std::vector<double> zero(angles.num_parameters(), 0.0);
  const JointFrames observed = PosedFrames(person, zero);
  JointOptions options;
  options.mode = "paper";
  options.weights.landmark = 0.5;
  options.weights.template_ratio = 0.2;
  options.weights.anthropometric = 0.3;
  ASSERT_EQ(options.Check(), std::nullopt);
  StageSummary summary;
  const JointResult result = EstimateJoints(
      {LandmarksOf(observed, 0.001)}, base, kStature, options, &summary);
  const Anthropometry& tables = Anthropometry::Default();
  for (int j = 1; j < kNumJoints; ++j) {
    const double expected = 0.5 * person.length[j] + 0.2 * base.length[j] +
                            0.3 * tables.bone[j].Mean(0.5) * kStature;
    EXPECT_NEAR(result.skeleton.length[j], expected, 2e-3) << kJointNames[j];
  }
}

TEST(JointOptions, SimplexWeightsMustSumToOne) {
  JointOptions options;
  EXPECT_EQ(options.Check(), std::nullopt);
  options.mode = "simplex";
  options.weights.landmark = 0.5;
  options.weights.template_ratio = 0.2;
  options.weights.anthropometric = 0.2;
  EXPECT_NE(options.Check(), std::nullopt);
  options.weights.anthropometric = 0.3;
  EXPECT_EQ(options.Check(), std::nullopt);
  options.mode = "guess";
  EXPECT_NE(options.Check(), std::nullopt);
}

// A mode alone is refused with words that say what else to set.
TEST(JointOptions, ConvexModesSayWhichWeightsTheyNeed) {
  JointOptions options;
  options.mode = "paper";
  EXPECT_THAT(*options.Check(), ::testing::HasSubstr("set all three"));
}

// The other weights stay the user's in every mode.
TEST(JointOptions, ConvexWeightsLeaveTheFamiliesWhole) {
  JointOptions options;
  options.weights.landmark = 0.5;
  options.weights.template_ratio = 0.2;
  options.weights.anthropometric = 0.3;
  options.weights.pose = 3;
  options.weights.silhouette = 0.2;
  for (const std::string mode : {"sigma", "simplex", "paper"}) {
    options.mode = mode;
    const JointOptions::Weights families = options.FamilyWeights();
    EXPECT_EQ(families.pose, 3) << mode;
    EXPECT_EQ(families.silhouette, 0.2) << mode;
    EXPECT_EQ(families.landmark, mode == "sigma" ? 0.5 : 1) << mode;
    EXPECT_EQ(families.template_ratio, mode == "sigma" ? 0.2 : 0) << mode;
    EXPECT_EQ(families.anthropometric, mode == "sigma" ? 0.3 : 1) << mode;
  }
}

}  // namespace
}  // namespace sweepfit
