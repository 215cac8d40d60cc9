// SPDX-License-Identifier: Apache-2.0
#include "model/template_import.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tiny_gltf.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <sstream>
#include <string>

#include "model/file_io.h"
#include "model/gltf.h"
#include "model/input_error.h"
#include "model/lbs.h"
#include "model/template.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

// The template as a GLB of its own, and what can be done to it.
class TemplateImportTest : public ::testing::Test {
 protected:
  static const Body& Template() {
    static const Body kBody = BuildTemplate({});
    return kBody;
  }

  // Every vertex follows the joint that its heaviest sweep has there.
  static SkinWeights RigidWeights() {
    const Body& body = Template();
    SkinWeights weights;
    for (const Binding& binding : body.binding) {
      std::array<int, 4> joint{};
      std::array<double, 4> weight{};
      for (int i = 0; i < 3; ++i) {
        const SweepAttachment& a = binding.attachment[i];
        if (a.sweep < 0) break;
        const Sweep& sweep = body.sweeps[a.sweep];
        const int bone = std::clamp(
            static_cast<int>(std::floor(a.u)), 0, sweep.num_bones() - 1);
        joint[i] = sweep.chain[bone];
        weight[i] = a.weight;
      }
      weights.joint.push_back(joint);
      weights.weight.push_back(weight);
    }
    return weights;
  }

  const std::string& Glb() const {
    static const std::string kBytes = [this] {
      SaveGlb(Template(), RigidWeights(), {}, {}, path_);
      return ReadWholeFile(path_);
    }();
    return kBytes;
  }

  tinygltf::Model Model() const {
    tinygltf::Model model;
    tinygltf::TinyGLTF loader;
    std::string error, warning;
    EXPECT_TRUE(loader.LoadBinaryFromMemory(
        &model,
        &error,
        &warning,
        reinterpret_cast<const unsigned char*>(Glb().data()),
        static_cast<unsigned>(Glb().size())))
        << error;
    return model;
  }

  Body Import(const tinygltf::Model& model, const std::string& names = "auto") {
    std::ostringstream stream;
    tinygltf::TinyGLTF writer;
    EXPECT_TRUE(writer.WriteGltfSceneToStream(&model, stream, false, true));
    return ImportBytes(stream.str(), names);
  }

  Body ImportBytes(const std::string& bytes,
                   const std::string& names = "auto") {
    WriteWholeFile(bytes, path_);
    return ImportTemplate(path_, names);
  }

  std::string ErrorOf(const std::function<void()>& import) {
    try {
      import();
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(path_));
      return error.what();
    }
    return "no error";
  }

  TemporaryFolder folder_;
  std::string path_ = (folder_.path() / "person.glb").string();
};

// The vertex of `points` nearest to a point, brute force on a few points.
double DistanceTo(const std::vector<Vector3d>& points, const Vector3d& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Vector3d& p : points)
    nearest = std::min(nearest, (p - point).norm());
  return nearest;
}

TEST_F(TemplateImportTest, OwnModelComesBack) {
  const Body& body = Template();
  const Body back = ImportBytes(Glb());
  ASSERT_EQ(back.num_vertices(), body.num_vertices());
  for (int joint = 1; joint < kNumJoints; ++joint) {
    EXPECT_LT(
        (back.skeleton.length[joint] * back.skeleton.rest_direction[joint] -
         body.skeleton.length[joint] * body.skeleton.rest_direction[joint])
            .norm(),
        1e-6)
        << kJointNames[joint];
  }
  const std::vector<Vector3d> rest = RestVertices(body);
  const std::vector<Vector3d> found = RestVertices(back);
  for (int v = 0; v < body.num_vertices(); v += 97) {
    EXPECT_LT(DistanceTo(found, rest[v]), 1e-6) << v;
  }
  // Closed, all triangles, with the texture coordinates of the file.
  TriangleMesh mesh{found, TriangulateQuads(back.topology.quads, found)};
  EXPECT_EQ(mesh.triangles.size(), 2 * body.topology.quads.size());
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_EQ(CheckTopology(mesh).euler_characteristic, 2);
  EXPECT_NEAR(
      EnclosedVolume(mesh),
      EnclosedVolume({rest, TriangulateQuads(body.topology.quads, rest)}),
      1e-6);
  double area = 0;
  for (const auto& uv : back.topology.uv) {
    const Eigen::Vector2f a = uv[1] - uv[0], b = uv[2] - uv[0];
    area += 0.5 * std::abs(a.x() * b.y() - a.y() * b.x());
  }
  EXPECT_GT(area, 0.2);
  EXPECT_LT(area, 1);
  // Left and right are each other's mirror image.
  int mirrored = 0;
  for (int v = 0; v < back.num_vertices(); ++v) {
    const int other = back.topology.mirror_vertex[v];
    EXPECT_EQ(back.topology.mirror_vertex[other], v);
    mirrored += other != v;
  }
  EXPECT_GT(mirrored, 0.9 * back.num_vertices());
}

TEST_F(TemplateImportTest, SectionsAreMeasured) {
  const Body& body = Template();
  const Body back = ImportBytes(Glb());
  ASSERT_EQ(back.sweeps.size(), body.sweeps.size());
  // Away from ends and branches sections are those of the template.
  const auto girth = [](const Body& b, const std::string& name, double u) {
    for (const Sweep& sweep : b.sweeps) {
      if (sweep.name != name) continue;
      double sum = 0;
      for (int k = 0; k < 64; ++k) {
        sum += Radius(sweep, u, 2 * M_PI * k / 64);
      }
      return sum / 64;
    }
    return 0.0;
  };
  for (const auto& [name, u] : {std::pair("l_leg", 0.6),
                                std::pair("r_leg", 1.4),
                                std::pair("l_arm", 0.6),
                                std::pair("r_arm", 1.5),
                                std::pair("trunk", 1.0)}) {
    EXPECT_NEAR(girth(back, name, u) / girth(body, name, u), 1, 0.06)
        << name << " " << u;
  }
}

TEST_F(TemplateImportTest, PosesLikeTheTemplate) {
  const Body& body = Template();
  const Body back = ImportBytes(Glb());
  Pose pose;
  pose.rotation[kLElbow] =
      Eigen::AngleAxisd(0.8, Vector3d(1, 1, 0).normalized());
  pose.rotation[kRKnee] = Eigen::AngleAxisd(0.9, Vector3d::UnitX());
  const std::vector<Vector3d> expected = PoseVertices(body, pose);
  const std::vector<Vector3d> found = PoseVertices(back, pose);
  // The exporter splits and the importer welds: vertices are found by place.
  const std::vector<Vector3d> rest = RestVertices(body);
  const std::vector<Vector3d> rest_back = RestVertices(back);
  double worst = 0;
  for (int v = 0; v < body.num_vertices(); v += 61) {
    for (int w = 0; w < back.num_vertices(); ++w) {
      if ((rest_back[w] - rest[v]).norm() > 1e-6) continue;
      worst = std::max(worst, (found[w] - expected[v]).norm());
    }
  }
  EXPECT_LT(worst, 0.01);
}

TEST_F(TemplateImportTest, OtherAxesUnitsAndNamesAreUnderstood) {
  tinygltf::Model model = Model();
  // Centimetres, facing -X, off the origin, Unreal's names.
  tinygltf::Node above;
  above.name = "Armature";
  above.scale = {100, 100, 100};
  above.rotation = {0, -std::sqrt(0.5), 0, std::sqrt(0.5)};
  above.translation = {300, 20, -50};
  above.children = {kRoot};
  model.nodes.push_back(above);
  for (int& node : model.scenes[0].nodes) {
    if (node == kRoot) node = static_cast<int>(model.nodes.size()) - 1;
  }
  const std::pair<int, const char*> names[] = {
      {kRoot, "pelvis"},          {kSpine, "spine_01"},
      {kNeck, "neck_01"},         {kHead, "head"},
      {kLShoulder, "upperarm_l"}, {kLElbow, "lowerarm_l"},
      {kLWrist, "hand_l"},        {kRShoulder, "upperarm_r"},
      {kRElbow, "lowerarm_r"},    {kRWrist, "hand_r"},
      {kLHip, "thigh_l"},         {kLKnee, "calf_l"},
      {kLAnkle, "foot_l"},        {kRHip, "thigh_r"},
      {kRKnee, "calf_r"},         {kRAnkle, "foot_r"},
      {kHeadEnd, "crown"},        {kLHandEnd, "middle_01_l"},
      {kRHandEnd, "middle_01_r"}, {kLFootEnd, "ball_l"},
      {kRFootEnd, "ball_r"}};
  for (const auto& [joint, name] : names) model.nodes[joint].name = name;
  const Body back = Import(model);
  const Body& body = Template();
  EXPECT_NEAR(back.stature, body.stature, 0.01);
  for (const int joint : {kNeck, kLElbow, kRKnee, kLAnkle}) {
    EXPECT_LT(
        (back.skeleton.length[joint] * back.skeleton.rest_direction[joint] -
         body.skeleton.length[joint] * body.skeleton.rest_direction[joint])
            .norm(),
        1e-5)
        << kJointNames[joint];
  }
  // Ends lie where the surface ends.
  EXPECT_NEAR(back.skeleton.length[kLHandEnd] / body.skeleton.length[kLHandEnd],
              1,
              0.1);
  EXPECT_NEAR(back.skeleton.length[kRFootEnd] / body.skeleton.length[kRFootEnd],
              1,
              0.15);
}

TEST_F(TemplateImportTest, ArmsAreBroughtToTheRestPose) {
  tinygltf::Model model = Model();
  // Nodes hold the arms out: 45 degrees about the front axis.
  const double half = M_PI / 8;
  model.nodes[kLShoulder].rotation = {0, 0, std::sin(half), std::cos(half)};
  model.nodes[kRShoulder].rotation = {0, 0, -std::sin(half), std::cos(half)};
  const Body back = Import(model);
  const Body& body = Template();
  for (const int joint : {kLElbow, kRElbow, kLWrist}) {
    EXPECT_LT((back.skeleton.rest_direction[joint] -
               body.skeleton.rest_direction[joint])
                  .norm(),
              1e-6)
        << kJointNames[joint];
  }
  const std::vector<Vector3d> found = RestVertices(back);
  TriangleMesh mesh{found, TriangulateQuads(back.topology.quads, found)};
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
}

TEST_F(TemplateImportTest, WhatCanBeMendedIs) {
  const Body body = Import(Model());
  const auto expect_same = [&](const tinygltf::Model& model) {
    const Body mended = Import(model);
    EXPECT_NEAR(mended.stature, 1.70, 0.01);
    for (int joint = 1; joint < kNumJoints; ++joint) {
      EXPECT_NEAR(mended.skeleton.length[joint] / mended.stature,
                  body.skeleton.length[joint] / body.stature,
                  1e-4)
          << kJointNames[joint];
    }
    const std::vector<Vector3d> rest = RestVertices(mended);
    const TriangleMesh mesh{rest,
                            TriangulateQuads(mended.topology.quads, rest)};
    EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
    EXPECT_GT(EnclosedVolume(mesh), 0);
  };
  tinygltf::Model lying = Model();  // Z up
  lying.nodes[kRoot].rotation = {std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
  expect_same(lying);
  tinygltf::Model large = Model();
  large.nodes[kRoot].scale = {7, 7, 7};
  expect_same(large);
  tinygltf::Model holed = Model();
  holed.accessors[holed.meshes[0].primitives[0].indices].count -= 3;
  expect_same(holed);
  tinygltf::Model inside_out = Model();
  const auto& accessor =
      inside_out.accessors[inside_out.meshes[0].primitives[0].indices];
  auto* index = reinterpret_cast<std::uint32_t*>(
      &inside_out.buffers[0]
           .data[inside_out.bufferViews[accessor.bufferView].byteOffset]);
  for (std::size_t i = 0; i < accessor.count; i += 3) {
    std::swap(index[i], index[i + 1]);
  }
  expect_same(inside_out);
}

TEST_F(TemplateImportTest, FaultsOfTheFileAreNamed) {
  EXPECT_THAT(ErrorOf([&] { ImportBytes(""); }),
              HasSubstr("not a binary glTF"));
  EXPECT_THAT(ErrorOf([&] { ImportBytes("HIERARCHY ROOT Hips OFFSET 0 0 0"); }),
              HasSubstr("not a binary glTF"));
  EXPECT_THAT(ErrorOf([&] { ImportBytes(Glb().substr(0, Glb().size() / 2)); }),
              HasSubstr("cut short"));
  std::string broken = Glb();
  broken[20] = '!';  // the JSON's first brace
  EXPECT_THAT(ErrorOf([&] { ImportBytes(broken); }),
              HasSubstr("cannot be read as glTF"));
  EXPECT_THROW(ImportTemplate((folder_.path() / "none.glb").string()),
               InputError);
}

struct Fault {
  std::string expected;
  std::function<void(tinygltf::Model*)> apply;

  friend void PrintTo(const Fault& fault, std::ostream* out) {
    *out << fault.expected;
  }
};

tinygltf::Primitive& Skinned(tinygltf::Model* model) {
  return model->meshes[0].primitives[0];
}

// Sets one component of an attribute.
template <typename T>
void Poke(tinygltf::Model* model, int accessor, std::size_t at, T value) {
  const tinygltf::BufferView& view =
      model->bufferViews[model->accessors[accessor].bufferView];
  std::memcpy(&model->buffers[0].data[view.byteOffset + at * sizeof(T)],
              &value,
              sizeof(T));
}

class GlbFaultTest : public TemplateImportTest,
                     public ::testing::WithParamInterface<Fault> {};

TEST_P(GlbFaultTest, IsNamed) {
  tinygltf::Model model = Model();
  GetParam().apply(&model);
  EXPECT_THAT(ErrorOf([&] { Import(model); }), HasSubstr(GetParam().expected));
}

INSTANTIATE_TEST_SUITE_P(
    All,
    GlbFaultTest,
    ::testing::Values(
        Fault{"no mesh with a skin",
              [](auto* m) {
                for (auto& node : m->nodes) node.skin = -1;
              }},
        Fault{"no weights",
              [](auto* m) { Skinned(m).attributes.erase("WEIGHTS_0"); }},
        Fault{"not made of triangles",
              [](auto* m) { Skinned(m).mode = TINYGLTF_MODE_LINE; }},
        Fault{"positions reach beyond the end",
              [](auto* m) {
                m->accessors[Skinned(m).attributes["POSITION"]].count = 1 << 20;
              }},
        Fault{"texture coordinates have the wrong number of components",
              [](auto* m) {
                Skinned(m).attributes["TEXCOORD_0"] =
                    Skinned(m).attributes["POSITION"];
              }},
        Fault{"joint of a vertex is out of range",
              [](auto* m) {
                Poke<std::uint8_t>(
                    m, Skinned(m).attributes["JOINTS_0"], 0, 200);
              }},
        Fault{"a vertex follows no joint",
              [](auto* m) {
                for (int i = 0; i < 4; ++i) {
                  Poke<float>(m, Skinned(m).attributes["WEIGHTS_0"], i, 0);
                }
              }},
        Fault{"positions hold a value that is no number",
              [](auto* m) {
                Poke<float>(m, Skinned(m).attributes["POSITION"], 7, NAN);
              }},
        Fault{"an index of a triangle is out of range",
              [](auto* m) {
                Poke<std::uint32_t>(m, Skinned(m).indices, 5, 1 << 30);
              }},
        Fault{"indices do not make whole triangles",
              [](auto* m) { m->accessors[Skinned(m).indices].count -= 1; }},
        Fault{"fewer inverse bind matrices",
              [](auto* m) {
                m->accessors[m->skins[0].inverseBindMatrices].count = 3;
              }},
        Fault{"the nodes form a circle",
              [](auto* m) { m->nodes[kHeadEnd].children = {kRoot}; }},
        Fault{"a node has two parents",
              [](auto* m) { m->nodes[kHeadEnd].children = {kLElbow}; }},
        Fault{"needs KHR_draco_mesh_compression",
              [](auto* m) {
                m->extensionsRequired = {"KHR_draco_mesh_compression"};
              }},
        Fault{"unmapped: l_knee (sought as l_knee)",
              [](auto* m) { m->nodes[kLKnee].name = "Knie"; }},
        Fault{"does not hang on",
              [](auto* m) {
                std::swap(m->nodes[kLKnee].name, m->nodes[kLAnkle].name);
              }},
        Fault{"must be closed but has",
              [](auto* m) {
                // The triangles of the last fifth.
                auto& count = m->accessors[Skinned(m).indices].count;
                count -= count / 15 * 3;
              }},
        Fault{"has only 1 triangles",
              [](auto* m) { m->accessors[Skinned(m).indices].count = 3; }},
        Fault{"must stand upright along an axis",
              [](auto* m) {
                m->nodes[kRoot].rotation = {
                    std::sin(M_PI / 8), 0, 0, std::cos(M_PI / 8)};
              }},
        Fault{"points backwards",
              [](auto* m) {
                for (const int joint : {kLHip, kLKnee, kLAnkle, kLFootEnd}) {
                  std::swap(m->nodes[joint].name,
                            m->nodes[MirrorJoint(joint)].name);
                }
              }},
        Fault{"has no length", [](auto* m) {
                m->nodes[kLWrist].translation = {0, 0, 0};
              }}));

}  // namespace
}  // namespace sweepfit
