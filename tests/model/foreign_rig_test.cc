// SPDX-License-Identifier: Apache-2.0
//
// Rigs as other programs write them become templates.
#include "tests/support/foreign_rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "model/file_io.h"
#include "model/input_error.h"
#include "model/template.h"
#include "model/template_import.h"
#include "model/texture_atlas.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;
using ::testing::Contains;
using ::testing::HasSubstr;

// Keeps what it is told.
class Listener : public Progress {
 public:
  void Stage(const std::string&, const std::string&) override {}
  void Warning(const std::string& text) override { warnings_.push_back(text); }
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  std::vector<std::string> warnings_;
};

class ForeignRigTest : public ::testing::Test {
 protected:
  static const Body& Person() {
    static const Body kBody = BuildTemplate({.sex = 0.8, .stature = 1.82});
    return kBody;
  }

  Body Import(const ForeignRig& rig, const std::string& names = "auto") {
    WriteWholeFile(rig.Glb(Person()), path_);
    return ImportTemplate(path_, names, &listener_);
  }

  // Joints, closed surface, sections, and postures are those of the person.
  void ExpectPerson(const Body& body) {
    for (int joint = 1; joint < kNumJoints; ++joint) {
      // Ends lie on the surface, the spine is where the rig has it, and the
      // trunk does not begin at the rig's root.
      if (joint == kSpine || joint == kNeck || joint + 1 == kNumJoints ||
          kJointParents[joint + 1] != joint) {
        continue;
      }
      const Vector3d expected = Person().skeleton.length[joint] *
                                Person().skeleton.rest_direction[joint];
      const Vector3d found =
          body.skeleton.length[joint] * body.skeleton.rest_direction[joint];
      EXPECT_LT((found - expected).norm(), 0.003) << kJointNames[joint];
    }
    const TriangleMesh mesh = Surface(body, RestVertices(body));
    const TriangleMesh expected = Surface(Person(), RestVertices(Person()));
    const MeshTopology topology = CheckTopology(mesh);
    EXPECT_TRUE(topology.IsClosedManifold());
    EXPECT_EQ(topology.num_components, 1);
    EXPECT_EQ(topology.euler_characteristic, 2);
    EXPECT_NEAR(EnclosedVolume(mesh) / EnclosedVolume(expected), 1, 0.0205);
    int mirrored = 0;
    for (int v = 0; v < body.num_vertices(); ++v) {
      mirrored += body.topology.mirror_vertex[v] != v;
    }
    EXPECT_GT(mirrored, 0.8 * body.num_vertices());
    CornerCoordinates uv;
    for (const auto& corners : body.topology.uv) {
      uv.push_back({corners[0], corners[1], corners[2]});
    }
    EXPECT_LT(OverlapShare(uv), 0.02);

    // Half a bend of elbow and knee.
    Pose pose;
    pose.rotation[kLElbow] =
        Eigen::AngleAxisd(0.8, Vector3d(1, 1, 0).normalized());
    pose.rotation[kRKnee] = Eigen::AngleAxisd(0.9, Vector3d::UnitX());
    pose.rotation[kLShoulder] = Eigen::AngleAxisd(0.4, Vector3d::UnitZ());
    EXPECT_LT(
        MeanDistance(PoseVertices(body, pose), PoseVertices(Person(), pose)),
        0.006);
  }

  static TriangleMesh Surface(const Body& body,
                              const std::vector<Vector3d>& vertices) {
    return {vertices, TriangulateQuads(body.topology.quads, vertices)};
  }

  // From some points of one to the nearest points of another set.
  static double MeanDistance(const std::vector<Vector3d>& points,
                             const std::vector<Vector3d>& others) {
    double sum = 0;
    int count = 0;
    for (std::size_t i = 0; i < points.size(); i += 37, ++count) {
      double nearest = 1;
      for (const Vector3d& other : others) {
        nearest = std::min(nearest, (points[i] - other).squaredNorm());
      }
      sum += std::sqrt(nearest);
    }
    return sum / count;
  }

  std::string ErrorOf(const ForeignRig& rig,
                      const std::string& names = "auto") {
    try {
      Import(rig, names);
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(path_));
      return error.what();
    }
    return "no error";
  }

  TemporaryFolder folder_;
  std::string path_ = (folder_.path() / "foreign.glb").string();
  Listener listener_;
};

TEST_F(ForeignRigTest, BecomesATemplate) {
  const Body body = Import({});
  ExpectPerson(body);
  EXPECT_NEAR(body.stature, Person().stature, 0.002);
  EXPECT_THAT(listener_.warnings(), Contains(HasSubstr("2 holes filled")));
  EXPECT_THAT(listener_.warnings(),
              Contains(HasSubstr("2 small pieces left out")));
}

TEST_F(ForeignRigTest, PrefixesDoNotMatter) {
  const Body with = Import({});
  for (const char* prefix : {"", "mixamorig9:", "Character1_"}) {
    const Body without = Import({.prefix = prefix});
    for (int joint = 1; joint < kNumJoints; ++joint) {
      EXPECT_EQ(without.skeleton.length[joint], with.skeleton.length[joint])
          << prefix << kJointNames[joint];
    }
  }
}

TEST_F(ForeignRigTest, BoundPostureIsTakenWhenTheNodesAreBent) {
  const Body body = Import({.bent_nodes = true});
  ExpectPerson(body);
  EXPECT_THAT(listener_.warnings(),
              Contains(HasSubstr("as the skin was bound")));
}

TEST_F(ForeignRigTest, TextureCoordinatesAreMade) {
  const Body body = Import({.texture_coordinates = false});
  ExpectPerson(body);
  EXPECT_THAT(listener_.warnings(),
              Contains(HasSubstr("new texture coordinates")));
}

TEST_F(ForeignRigTest, WhatCannotServeIsSaid) {
  EXPECT_THAT(ErrorOf({.open_back = true}), HasSubstr("must be closed"));
  const std::string unknown = ErrorOf({.prefix = "Bone"});
  EXPECT_THAT(unknown, HasSubstr("unmapped"));
  EXPECT_THAT(unknown, HasSubstr("BoneLeftForeArm"));
  EXPECT_THAT(unknown, HasSubstr("map file"));
}

TEST(TextureAtlasTest, BoxAtlasGivesEveryPlaceATexel) {
  const Body body = BuildTemplate({});
  const std::vector<Vector3d> rest = RestVertices(body);
  const TriangleMesh mesh{rest, TriangulateQuads(body.topology.quads, rest)};
  std::vector<int> group;
  for (const Triangle& triangle : mesh.triangles) {
    group.push_back(static_cast<int>(body.topology.part[triangle[0]]));
  }
  const CornerCoordinates uv = BoxAtlas(mesh, group);
  EXPECT_LT(OverlapShare(uv), 0.02);
  double area = 0;
  for (const auto& corners : uv) {
    for (const Eigen::Vector2f& corner : corners) {
      EXPECT_GE(corner.minCoeff(), 0);
      EXPECT_LE(corner.maxCoeff(), 1);
    }
    const Eigen::Vector2f a = corners[1] - corners[0];
    const Eigen::Vector2f b = corners[2] - corners[0];
    area += std::abs(a.x() * b.y() - a.y() * b.x()) / 2;
  }
  EXPECT_GT(area, 0.25);  // of the square
}

TEST(TextureAtlasTest, SquaresOfMaterialsAreSetSideBySide) {
  const TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}},
                          {{0, 1, 2}, {1, 3, 2}}};
  const std::array<Eigen::Vector2f, 3> whole = {
      Eigen::Vector2f(0, 0), Eigen::Vector2f(1, 0), Eigen::Vector2f(0, 1)};
  CornerCoordinates uv = {whole, whole};
  EXPECT_NEAR(OverlapShare(uv), 1, 0.01);
  EXPECT_THAT(FitTextureAtlas(mesh, {3, 7}, {0, 0}, &uv),
              HasSubstr("side by side"));
  EXPECT_EQ(OverlapShare(uv), 0);
  // Once more nothing is to do.
  EXPECT_EQ(FitTextureAtlas(mesh, {3, 7}, {0, 0}, &uv), "");
}

}  // namespace
}  // namespace sweepfit
