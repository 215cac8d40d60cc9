// SPDX-License-Identifier: Apache-2.0
#include "model/bend_shape.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "model/body.h"
#include "model/joint_limits.h"
#include "model/mesh.h"
#include "model/self_intersection.h"
#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

// A straight arm as one tube, its sections circles or, `off_axis`, circles
// beside the axis.
Body Tube(double off_axis) {
  Body body;
  body.skeleton = ToySkeleton();
  body.skeleton.rest_direction[kLElbow] = Eigen::Vector3d::UnitX();
  body.skeleton.rest_direction[kLWrist] = Eigen::Vector3d::UnitX();
  Sweep sweep = ToySweep(
      "l_arm", {kLShoulder, kLElbow, kLWrist}, Eigen::Vector3d::UnitZ(), 0.045);
  sweep.rigid_end = false;
  sweep.radius.setConstant(0.045);
  sweep.log_ratio.setZero();
  sweep.center_offset.setZero();
  sweep.center_offset.row(0).setConstant(off_axis);
  body.sweeps = {sweep};
  std::vector<Eigen::Vector3d> vertices;
  AddToyTube(body.sweeps[0],
             body.skeleton,
             121,
             BodyPart::kLArm,
             &body.topology,
             &vertices);
  BindVertices(vertices,
               std::vector<std::vector<std::pair<int, double>>>(vertices.size(),
                                                                {{0, 1.0}}),
               &body);
  return body;
}

double Volume(const Body& body, const std::vector<Eigen::Vector3d>& vertices) {
  return EnclosedVolume(
      {vertices, TriangulateQuads(body.topology.quads, vertices)});
}

Pose BentElbow(const Body& body, double degrees, double hinge_degrees = 0) {
  const Eigen::Vector3d& bone = body.skeleton.rest_direction[kLElbow];
  const Eigen::AngleAxisd around(hinge_degrees * kDegree, bone);
  const Eigen::Vector3d hinge =
      around * bone.cross(Eigen::Vector3d::UnitZ()).normalized();
  Pose pose;
  pose.rotation[kLElbow] = Eigen::AngleAxisd(degrees * kDegree, hinge);
  return pose;
}

TEST(BendShape, TubesKeepTheirVolume) {
  // Sections beside the axis gain or lose by the theorem of Pappus unless
  // their moment is taken into account.
  for (const double off_axis : {0.0, 0.009, -0.009}) {
    const Body body = Tube(off_axis);
    const double rest = Volume(body, RestVertices(body));
    for (const double degrees : {10., 30., 60., 90., 120., 135.}) {
      for (const double hinge : {0., 70., 180.}) {
        const double bent =
            Volume(body, PoseVertices(body, BentElbow(body, degrees, hinge)));
        // The part of the tube that bends is a third of it.
        EXPECT_NEAR(bent / rest, 1, degrees <= 90 ? 0.004 : 0.01)
            << off_axis << " " << degrees << " " << hinge;
      }
    }
  }
}

TEST(BendShape, FoldsTouchButDoNotCross) {
  const Body body = Tube(0);
  for (const double degrees : {60., 90., 120., 140.}) {
    const std::vector<Eigen::Vector3d> vertices =
        PoseVertices(body, BentElbow(body, degrees));
    const TriangleMesh mesh{vertices,
                            TriangulateQuads(body.topology.quads, vertices)};
    EXPECT_EQ(SelfIntersections(mesh).size(), 0u) << degrees;
  }
}

TEST(BendShape, ChangesContinuouslyWithTheBend) {
  const Body body = Tube(0.009);
  std::vector<Eigen::Vector3d> last = RestVertices(body);
  for (double degrees = 0.5; degrees <= 140; degrees += 0.5) {
    const std::vector<Eigen::Vector3d> vertices =
        PoseVertices(body, BentElbow(body, degrees));
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      // The tip is 0.3 m from the elbow: 2.6 mm for half a degree.
      ASSERT_LT((vertices[v] - last[v]).norm(), 0.0045)
          << degrees << " " << body.binding[v].attachment[0].u;
    }
    last = vertices;
  }
}

TEST(BendShape, ASmallBendChangesLittle) {
  // What captured postures show: the sections of an arm bent by ten degrees
  // keep their shape within two per cent of the radius.
  const Body body = Tube(0);
  const BodyDeformer deformer(body);
  const std::vector<VertexMotion> motions =
      deformer.Motions(BentElbow(body, 10));
  const JointFrames frames =
      ForwardKinematics(body.skeleton, BentElbow(body, 10));
  const SweepAxis axis(body.sweeps[0], body.skeleton, frames);
  for (int v = 0; v < body.num_vertices(); ++v) {
    const SweepAttachment& a = body.binding[v].attachment[0];
    const Eigen::Vector3d& rest = deformer.rest_vertices()[v];
    const double radius = (motions[v].rotation * rest + motions[v].translation -
                           axis.At(a.u).center_in_world)
                              .norm();
    const double at_rest = std::hypot(a.rho * 0.045, a.tau);
    EXPECT_NEAR(radius / at_rest, 1, 0.02) << a.u;
  }
}

TEST(BendShape, TwistKeepsTheVolume) {
  const Body body = Tube(0);
  const double rest = Volume(body, RestVertices(body));
  Pose pose;
  pose.rotation[kLElbow] =
      Eigen::AngleAxisd(90 * kDegree, body.skeleton.rest_direction[kLWrist]);
  EXPECT_NEAR(Volume(body, PoseVertices(body, pose)) / rest, 1, 0.005);
}

}  // namespace
}  // namespace sweepfit
