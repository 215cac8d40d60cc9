// SPDX-License-Identifier: Apache-2.0
#include "experiments/metrics.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include "experiments/random.h"
#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// Anti-aliased disc: coverage by the signed distance to its edge.
cv::Mat1f Disc(double center_x, double center_y, double radius) {
  cv::Mat1f mask(120, 140);
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      const double inside = radius - std::hypot(x - center_x, y - center_y);
      mask(y, x) = static_cast<float>(std::clamp(inside + 0.5, 0.0, 1.0));
    }
  }
  return mask;
}

// An octahedron refined four times onto the sphere: 2048 triangles.
TriangleMesh Sphere(double radius) {
  TriangleMesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    mesh.vertices.push_back(Vector3d::Unit(axis));
    mesh.vertices.push_back(-Vector3d::Unit(axis));
  }
  for (int x : {0, 1}) {
    for (int y : {2, 3}) {
      for (int z : {4, 5}) {
        const bool even = (x + y + z) % 2 == 0;
        mesh.triangles.push_back(even ? Triangle{x, y, z} : Triangle{x, z, y});
      }
    }
  }
  for (int level = 0; level < 4; ++level) {
    std::map<std::pair<int, int>, int> middle;
    const auto between = [&](int a, int b) {
      const auto [entry, is_new] = middle.try_emplace(
          std::minmax(a, b), static_cast<int>(mesh.vertices.size()));
      if (is_new) {
        mesh.vertices.push_back(
            (mesh.vertices[a] + mesh.vertices[b]).normalized());
      }
      return entry->second;
    };
    std::vector<Triangle> finer;
    for (const auto& [a, b, c] : mesh.triangles) {
      const int ab = between(a, b), bc = between(b, c), ca = between(c, a);
      for (const Triangle& t : {Triangle{a, ab, ca},
                                Triangle{ab, b, bc},
                                Triangle{ca, bc, c},
                                Triangle{ab, bc, ca}}) {
        finer.push_back(t);
      }
    }
    mesh.triangles = finer;
  }
  for (Vector3d& v : mesh.vertices) v *= radius;
  return mesh;
}

JointPositions SomeJoints() {
  Random random(5);
  JointPositions joints;
  for (Vector3d& p : joints) {
    p = {random.Uniform(-1, 1), random.Uniform(0, 2), random.Uniform(-1, 1)};
  }
  return joints;
}

TEST(CompareMasks, EqualMasksHaveNoError) {
  const cv::Mat1f disc = Disc(60, 60, 30);
  const SilhouetteError error = CompareMasks(disc, disc);
  EXPECT_EQ(error.iou, 1);
  EXPECT_LT(error.boundary_p95, 1e-6);
}

TEST(CompareMasks, ConcentricDiscsDifferByTheirRadii) {
  const SilhouetteError error =
      CompareMasks(Disc(60, 60, 32), Disc(60, 60, 30));
  EXPECT_NEAR(error.iou, 30.0 * 30 / (32 * 32), 2e-3);
  EXPECT_NEAR(error.boundary_mean, 2, 0.02);
  EXPECT_NEAR(error.boundary_p95, 2, 0.08);
  EXPECT_NEAR(error.signed_mean, 2, 0.02);
  EXPECT_NEAR(
      CompareMasks(Disc(60, 60, 30), Disc(60, 60, 32)).signed_mean, -2, 0.02);
}

TEST(CompareMasks, ShiftedDiscsHaveMeanDistanceOfTheShiftsNormalPart) {
  const SilhouetteError error =
      CompareMasks(Disc(60.0, 60, 40), Disc(61.5, 60, 40));
  // Mean of |1.5 cos(angle)| over the circle.
  EXPECT_NEAR(error.boundary_mean, 1.5 * 2 / std::numbers::pi, 0.02);
  EXPECT_NEAR(error.boundary_p95, 1.5, 0.08);
  EXPECT_NEAR(error.signed_mean, 0, 0.01);
}

TEST(CompareMasks, EmptyMasks) {
  const cv::Mat1f empty(120, 140, 0.0f);
  EXPECT_EQ(CompareMasks(empty, empty).iou, 1);
  EXPECT_EQ(CompareMasks(empty, empty).boundary_mean, 0);
  const SilhouetteError lost = CompareMasks(empty, Disc(60, 60, 30));
  EXPECT_EQ(lost.iou, 0);
  EXPECT_TRUE(std::isinf(lost.boundary_mean));
  EXPECT_EQ(lost.signed_mean, -std::numeric_limits<double>::infinity());
}

TEST(CompareMasks, TheFramesEdgeIsNoBoundary) {
  cv::Mat1f left(50, 60, 0.0f), wider(50, 60, 0.0f);
  left.colRange(0, 20) = 1;
  wider.colRange(0, 23) = 1;
  const SilhouetteError error = CompareMasks(wider, left);
  EXPECT_NEAR(error.boundary_mean, 3, 1e-6);
  EXPECT_NEAR(error.signed_mean, 3, 1e-6);
}

TEST(CompareJoints, CountsWhatItSays) {
  const JointPositions truth = SomeJoints();
  JointPositions joints = truth;
  joints[kLElbow] += Vector3d(0, 0.03, 0.04);
  const JointError error = CompareJoints(joints, truth);
  EXPECT_NEAR(error.mpjpe, 0.05 / 21, 1e-12);
  EXPECT_NEAR(error.limb_mpjpe, 0.05 / 12, 1e-12);
  EXPECT_NEAR(error.per_joint[kLElbow], 0.05, 1e-12);
  const auto change = [&](int a, int b) {
    return std::abs((joints[a] - joints[b]).norm() -
                    (truth[a] - truth[b]).norm());
  };
  EXPECT_NEAR(error.bone_length_mae,
              (change(kLShoulder, kLElbow) + change(kLElbow, kLWrist)) / 16,
              1e-12);
}

TEST(CompareJoints, ShoulderBreadthIsNoBone) {
  const JointPositions truth = SomeJoints();
  JointPositions joints = truth;
  for (int j : {kLShoulder, kLElbow, kLWrist, kLHandEnd}) {
    joints[j] += Vector3d(0.1, 0, 0);
  }
  EXPECT_NEAR(CompareJoints(joints, truth).bone_length_mae, 0, 1e-12);
}

TEST(CompareJoints, SimilarityAlignmentUndoesASimilarityButNoMirror) {
  const JointPositions truth = SomeJoints();
  const Eigen::AngleAxisd turn(1.1, Vector3d(1, 2, -1).normalized());
  JointPositions turned, mirrored;
  for (int j = 0; j < kNumJoints; ++j) {
    turned[j] = 1.3 * (turn * truth[j]) + Vector3d(1, -2, 3);
    mirrored[j] = truth[j].cwiseProduct(Vector3d(-1, 1, 1));
  }
  EXPECT_NEAR(CompareJoints(turned, truth).pa_mpjpe, 0, 1e-9);
  EXPECT_GT(CompareJoints(turned, truth).mpjpe, 1);
  EXPECT_GT(CompareJoints(mirrored, truth).pa_mpjpe, 0.1);
}

TEST(CompareSurfaces, ConcentricSpheresDifferByTheirRadii) {
  const TriangleMesh small = Sphere(1), large = Sphere(1.02);
  const SurfaceError outside = CompareSurfaces(large, small, 5000, 1);
  // The flat facets of 0.09 rad lie up to 0.2 % inside the sphere.
  EXPECT_NEAR(outside.mean, 0.02, 5e-4);
  EXPECT_NEAR(outside.median, 0.02, 5e-4);
  EXPECT_NEAR(outside.p95, 0.02, 2e-3);
  EXPECT_NEAR(outside.signed_mean, outside.mean, 1e-9);
  const SurfaceError inside = CompareSurfaces(small, large, 5000, 1);
  EXPECT_NEAR(inside.signed_mean, -inside.mean, 1e-9);
}

TEST(CompareSurfaces, ShiftedSpheresMatchTheClosedForm) {
  const TriangleMesh truth = Sphere(1);
  TriangleMesh shifted = truth;
  for (Vector3d& v : shifted.vertices) v.x() += 0.1;
  const SurfaceError error = CompareSurfaces(shifted, truth, 20000, 1);
  // Distance | |s + 0.1 x| - 1 | ~ 0.1 |cos|, whose mean over a sphere is half.
  EXPECT_NEAR(error.mean, 0.05, 1e-3);
  EXPECT_NEAR(error.max, 0.1, 2e-3);
  EXPECT_NEAR(error.signed_mean, 0.1 * 0.1 / 3, 1e-3);
}

TEST(CompareSurfaces, SameSeedSameNumbers) {
  const TriangleMesh small = Sphere(1), large = Sphere(1.02);
  const SurfaceError a = CompareSurfaces(large, small, 1000, 7);
  const SurfaceError b = CompareSurfaces(large, small, 1000, 7);
  const SurfaceError c = CompareSurfaces(large, small, 1000, 8);
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_NE(a.mean, c.mean);
}

TEST(LoadTruthJoints, ReadsByNameAndNamesWhatIsWrong) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "joints.json";
  const auto write = [&](const std::string& text) {
    std::ofstream(path) << text;
  };
  const auto message = [&]() -> std::string {
    try {
      LoadTruthJoints(path);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message().find("joints.json"), std::string::npos);
  std::string all;
  for (int j = 0; j < kNumJoints; ++j) {
    all = "\"" + std::string(kJointNames[j]) + "\":[" + std::to_string(j) +
          ",2,3]" + (j > 0 ? "," : "") + all;
  }
  write("{\"unit\":\"m\",\"joints\":{" + all + "}}");
  EXPECT_EQ(LoadTruthJoints(path)[kLKnee], Vector3d(kLKnee, 2, 3));
  write("{\"unit\":\"mm\",\"joints\":{" + all + "}}");
  EXPECT_NE(message().find("unit"), std::string::npos);
  write("{\"joints\":{\"root\":[0,0,0]}}");
  EXPECT_NE(message().find("joints.spine"), std::string::npos);
  write("{\"joints\":{\"root\":[0,\"x\",0]}}");
  EXPECT_NE(message().find("joints.root"), std::string::npos);
  write("{\"joints\":");
  EXPECT_NE(message().find("JSON"), std::string::npos);
}

}  // namespace
}  // namespace sweepfit
