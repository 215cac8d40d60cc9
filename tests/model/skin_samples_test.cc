// SPDX-License-Identifier: Apache-2.0
#include "model/skin_samples.h"

#include <gtest/gtest.h>

#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

TEST(SkinSamples, AreErrorsOfEveryJointAlone) {
  const Body body = ToyBody(8);
  const std::vector<HelperJoint> helpers = MakeHelperJoints(body);
  std::vector<Pose> poses;
  for (unsigned seed = 0; seed < 11; ++seed) {
    poses.push_back(RandomPose(0.8, seed));
  }
  const SkinSamples samples(body, helpers, poses);
  ASSERT_EQ(samples.num_poses(), 11);
  ASSERT_GE(samples.size(), 11);
  EXPECT_EQ(samples.size() % 4, 0);
  ASSERT_EQ(samples.rest().size(), body.binding.size());

  const JointMotions motions(body, helpers);
  std::vector<float> errors(samples.size());
  const int num_joints = kNumJoints + static_cast<int>(helpers.size());
  for (const int v : {0, 17, body.num_vertices() - 1}) {
    for (int joint = 0; joint < num_joints; ++joint) {
      for (int axis = 0; axis < 3; ++axis) {
        samples.Errors(v, joint, axis, errors.data());
        for (std::size_t p = 0; p < poses.size(); ++p) {
          const Eigen::Vector3d expected =
              motions.At(poses[p])[joint] * samples.rest()[v] -
              PoseVertices(body, poses[p])[v];
          ASSERT_NEAR(errors[p], expected[axis], 1e-6)
              << v << " " << joint << " " << axis << " " << p;
        }
        for (std::size_t p = poses.size(); p < errors.size(); ++p) {
          ASSERT_EQ(errors[p], 0);
        }
      }
    }
  }
}

}  // namespace
}  // namespace sweepfit
