// SPDX-License-Identifier: Apache-2.0
#include "model/gltf.h"

#include <gtest/gtest.h>
#include <tiny_gltf.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <set>
#include <tuple>

#include "model/export_names.h"
#include "model/file_io.h"
#include "model/input_error.h"
#include "tests/support/toy_body.h"
#include "tests/support/toy_uv.h"

namespace sweepfit {
namespace {

constexpr int kRings = 10;

// One grey pixel.
const std::vector<std::uint8_t> kPng = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d,
    0x49, 0x48, 0x44, 0x52, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01,
    0x08, 0x02, 0x00, 0x00, 0x00, 0x90, 0x77, 0x53, 0xde, 0x00, 0x00, 0x00,
    0x0c, 0x49, 0x44, 0x41, 0x54, 0x08, 0x1d, 0x63, 0x68, 0x68, 0x68, 0x00,
    0x00, 0x03, 0x04, 0x01, 0x81, 0xd9, 0xf6, 0xb9, 0xbb, 0x00, 0x00, 0x00,
    0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

Body TexturedToy() {
  Body body = ToyBody(kRings);
  AssignToyUv(kRings, &body);
  return body;
}

std::vector<Clip> TwoClips() {
  Pose raised = RandomPose(0.7, 3);
  raised.collar[0] = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ());
  return {{"still", {0}, {RandomPose(0.5, 1)}},
          {"moving", {0, 0.5, 1.25}, {Pose(), RandomPose(0.9, 2), raised}}};
}

const SkinWeights& ToyWeights() {
  static const auto* weights =
      new SkinWeights(FitSkinWeights(TexturedToy(), 12, 1).weights);
  return *weights;
}

std::vector<int> NearestVertices(const std::vector<Eigen::Vector3d>& points,
                                 const std::vector<Eigen::Vector3d>& vertices) {
  std::vector<int> nearest;
  for (const Eigen::Vector3d& point : points) {
    int best = 0;
    for (std::size_t v = 1; v < vertices.size(); ++v) {
      if ((vertices[v] - point).squaredNorm() <
          (vertices[best] - point).squaredNorm()) {
        best = static_cast<int>(v);
      }
    }
    nearest.push_back(best);
    EXPECT_LT((vertices[best] - point).norm(), 1e-6);
  }
  return nearest;
}

class GlbTest : public testing::Test {
 protected:
  GlbTest()
      : path_((std::filesystem::path(testing::TempDir()) /
               ("sweepfit_gltf_" +
                std::string(testing::UnitTest::GetInstance()
                                ->current_test_info()
                                ->name()) +
                "_" + std::to_string(getpid()) + ".glb"))
                  .string()) {}
  ~GlbTest() override { std::filesystem::remove(path_); }

  void Save(const std::vector<Clip>& clips,
            const std::vector<std::uint8_t>& png) {
    GltfOptions options;
    options.texture_png = png;
    SaveGlb(TexturedToy(), ToyWeights(), clips, options, path_);
  }

  // Node index and parent of every skin joint, from the file.
  std::vector<int> Parents() const {
    std::vector<int> parents(model_.nodes.size(), -1);
    for (std::size_t n = 0; n < model_.nodes.size(); ++n) {
      for (const int child : model_.nodes[n].children) {
        parents[child] = static_cast<int>(n);
      }
    }
    return parents;
  }

  // Plays one key of a clip as a viewer would: positions of the vertices.
  std::vector<Eigen::Vector3d> Play(std::size_t clip, std::size_t key) const {
    const std::vector<int>& skin = model_.skins[0].joints;
    std::vector<Eigen::Vector3d> rest = ReadPoints(Attribute("POSITION"));
    const auto joints = Read<std::uint8_t>(Attribute("JOINTS_0"));
    const auto weights = Read<float>(Attribute("WEIGHTS_0"));
    const auto inverse_bind = Read<float>(model_.skins[0].inverseBindMatrices);
    const tinygltf::Animation& animation = model_.animations[clip];
    std::vector<Eigen::Affine3d> local(model_.nodes.size(),
                                       Eigen::Affine3d::Identity());
    for (const int n : skin) {
      local[n].translation() =
          Eigen::Map<const Eigen::Vector3d>(model_.nodes[n].translation.data());
    }
    int num_rotations = 0;
    for (const tinygltf::AnimationChannel& channel : animation.channels) {
      const tinygltf::AnimationSampler& sampler =
          animation.samplers[channel.sampler];
      const auto values = Read<float>(sampler.output);
      if (channel.target_path == "translation") {
        local[channel.target_node].translation() =
            Eigen::Vector3d(values[key][0], values[key][1], values[key][2]);
      } else if (channel.target_path == "rotation") {
        num_rotations += channel.target_node < kNumJoints;
        const Eigen::Quaterniond rotation(
            values[key][3], values[key][0], values[key][1], values[key][2]);
        EXPECT_NEAR(rotation.norm(), 1, 1e-6);
        local[channel.target_node].linear() = rotation.toRotationMatrix();
      } else {
        EXPECT_EQ(channel.target_path, "weights");
        const std::size_t count = primitive().targets.size();
        for (std::size_t t = 0; t < count; ++t) {
          const double weight = values.at(key * count + t)[0];
          EXPECT_GE(weight, 0);
          EXPECT_LE(weight, 1);
          if (weight != 0) AddTarget(t, weight, &rest);
        }
      }
    }
    EXPECT_EQ(num_rotations, kNumJoints);
    const std::vector<int> parents = Parents();
    std::vector<Eigen::Affine3d> world(model_.nodes.size());
    std::vector<Eigen::Affine3d> skinning(skin.size());
    for (std::size_t j = 0; j < skin.size(); ++j) {
      const int n = skin[j];
      EXPECT_LT(parents[n], n);
      world[n] = parents[n] < 0 ? local[n] : world[parents[n]] * local[n];
      skinning[j] =
          world[n] * Eigen::Affine3d(Eigen::Map<const Eigen::Matrix4f>(
                                         inverse_bind[j].data())
                                         .cast<double>());
    }
    std::vector<Eigen::Vector3d> posed(rest.size(), Eigen::Vector3d::Zero());
    for (std::size_t v = 0; v < rest.size(); ++v) {
      for (int i = 0; i < 4; ++i) {
        posed[v] += double{weights[v][i]} * (skinning[joints[v][i]] * rest[v]);
      }
    }
    return posed;
  }

  // Adds a sparse morph target.
  void AddTarget(std::size_t target,
                 double weight,
                 std::vector<Eigen::Vector3d>* points) const {
    const tinygltf::Accessor& accessor =
        model_.accessors.at(primitive().targets[target].at("POSITION"));
    EXPECT_EQ(accessor.count, points->size());
    ASSERT_TRUE(accessor.sparse.isSparse);
    const auto data = [&](int view) {
      return model_.buffers[0].data.data() +
             model_.bufferViews[view].byteOffset;
    };
    for (int i = 0; i < accessor.sparse.count; ++i) {
      std::uint32_t vertex = 0;
      float value[3];
      std::memcpy(&vertex, data(accessor.sparse.indices.bufferView) + 4 * i, 4);
      std::memcpy(value, data(accessor.sparse.values.bufferView) + 12 * i, 12);
      (*points)[vertex] +=
          weight * Eigen::Vector3d(value[0], value[1], value[2]);
    }
  }

  void SaveAndLoad(const GltfOptions& options = {}) {
    GltfOptions textured = options;
    textured.texture_png = kPng;
    reports_ =
        SaveGlb(TexturedToy(), ToyWeights(), TwoClips(), textured, path_);
    tinygltf::TinyGLTF loader;
    std::string error, warning;
    ASSERT_TRUE(loader.LoadBinaryFromFile(&model_, &error, &warning, path_))
        << error;
    EXPECT_EQ(error, "");
    EXPECT_EQ(warning, "");
  }

  // The elements of an accessor, one row each.
  template <typename Scalar>
  std::vector<std::vector<Scalar>> Read(int accessor_index) const {
    const tinygltf::Accessor& accessor = model_.accessors.at(accessor_index);
    const tinygltf::BufferView& view =
        model_.bufferViews.at(accessor.bufferView);
    const int width = tinygltf::GetNumComponentsInType(accessor.type);
    EXPECT_EQ(tinygltf::GetComponentSizeInBytes(accessor.componentType),
              static_cast<int>(sizeof(Scalar)));
    EXPECT_EQ(view.byteOffset % 4, 0u);
    EXPECT_EQ(view.byteLength, accessor.count * width * sizeof(Scalar));
    std::vector<std::vector<Scalar>> rows(accessor.count,
                                          std::vector<Scalar>(width));
    const unsigned char* data = model_.buffers[0].data.data() + view.byteOffset;
    for (std::vector<Scalar>& row : rows) {
      std::memcpy(row.data(), data, width * sizeof(Scalar));
      data += width * sizeof(Scalar);
    }
    return rows;
  }

  std::vector<Eigen::Vector3d> ReadPoints(int accessor) const {
    std::vector<Eigen::Vector3d> points;
    for (const std::vector<float>& row : Read<float>(accessor)) {
      points.emplace_back(row[0], row[1], row[2]);
    }
    return points;
  }

  const tinygltf::Primitive& primitive() const {
    return model_.meshes.at(0).primitives.at(0);
  }
  int Attribute(const std::string& name) const {
    return primitive().attributes.at(name);
  }

  std::string path_;
  tinygltf::Model model_;
  std::vector<ClipReport> reports_;
};

TEST_F(GlbTest, NodesAreTheSkeleton) {
  SaveAndLoad();
  const Body body = TexturedToy();
  ASSERT_EQ(model_.skins.size(), 1u);
  const std::vector<int>& joints = model_.skins[0].joints;
  const std::vector<HelperJoint>& helpers = ToyWeights().helpers;
  EXPECT_GT(helpers.size(), 5u);
  ASSERT_EQ(joints.size(), kNumJoints + helpers.size());
  for (std::size_t h = 0; h < helpers.size(); ++h) {
    const tinygltf::Node& node = model_.nodes.at(joints[kNumJoints + h]);
    EXPECT_EQ(node.name, helpers[h].name);
    EXPECT_EQ(Parents()[joints[kNumJoints + h]], joints[helpers[h].parent]);
  }
  for (int j = 0; j < kNumJoints; ++j) {
    const tinygltf::Node& node = model_.nodes.at(joints[j]);
    EXPECT_EQ(node.name, kJointNames[j]);
    EXPECT_TRUE(node.rotation.empty());
    EXPECT_TRUE(node.scale.empty());
    EXPECT_TRUE(node.matrix.empty());
    ASSERT_EQ(node.translation.size(), 3u);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(node.translation[i],
                  body.skeleton.length[j] * body.skeleton.rest_direction[j][i],
                  1e-12);
    }
    if (kJointParents[j] < 0) continue;
    const std::vector<int>& siblings =
        model_.nodes.at(joints[kJointParents[j]]).children;
    EXPECT_EQ(std::count(siblings.begin(), siblings.end(), joints[j]), 1);
  }
  // The skinned mesh and the root joint are the scene.
  ASSERT_EQ(model_.scenes.size(), 1u);
  int num_meshes = 0;
  std::set<int> roots(model_.scenes[0].nodes.begin(),
                      model_.scenes[0].nodes.end());
  EXPECT_EQ(roots.count(joints[0]), 1u);
  for (std::size_t n = 0; n < model_.nodes.size(); ++n) {
    if (model_.nodes[n].mesh < 0) continue;
    ++num_meshes;
    EXPECT_EQ(model_.nodes[n].skin, 0);
    EXPECT_EQ(roots.count(static_cast<int>(n)), 1u);
  }
  EXPECT_EQ(num_meshes, 1);
  EXPECT_EQ(model_.asset.generator, "sweepfit");
}

TEST_F(GlbTest, BindMatricesUndoTheRestPose) {
  SaveAndLoad();
  const std::vector<std::vector<float>> matrices =
      Read<float>(model_.skins[0].inverseBindMatrices);
  ASSERT_EQ(matrices.size(), model_.skins[0].joints.size());
  const std::vector<int> parents = Parents();
  std::vector<Eigen::Matrix4d> world_from_joint(matrices.size());
  for (std::size_t j = 0; j < matrices.size(); ++j) {
    ASSERT_EQ(model_.skins[0].joints[j], static_cast<int>(j));
    Eigen::Matrix4d local = Eigen::Matrix4d::Identity();
    local.topRightCorner<3, 1>() =
        Eigen::Map<const Eigen::Vector3d>(model_.nodes[j].translation.data());
    world_from_joint[j] =
        parents[j] < 0 ? local : world_from_joint[parents[j]] * local;
    const Eigen::Matrix4d inverse_bind =
        Eigen::Map<const Eigen::Matrix4f>(matrices[j].data()).cast<double>();
    EXPECT_LT((world_from_joint[j] * inverse_bind - Eigen::Matrix4d::Identity())
                  .cwiseAbs()
                  .maxCoeff(),
              1e-6);
  }
}

TEST_F(GlbTest, SplitsVerticesAtSeamsOnly) {
  SaveAndLoad();
  const Body body = TexturedToy();
  const std::vector<Eigen::Vector3d> rest = RestVertices(body);
  std::set<std::tuple<int, float, float>> expected;
  for (std::size_t q = 0; q < body.topology.quads.size(); ++q) {
    for (int c = 0; c < 4; ++c) {
      const Eigen::Vector2f& uv = body.topology.uv[q][c];
      expected.insert({body.topology.quads[q][c], uv.x(), uv.y()});
    }
  }
  EXPECT_GT(expected.size(), rest.size());
  const std::vector<Eigen::Vector3d> points = ReadPoints(Attribute("POSITION"));
  EXPECT_EQ(points.size(), expected.size());

  // Every triangle is half of its quad, with the quad's corners and UVs.
  const auto uv = Read<float>(Attribute("TEXCOORD_0"));
  const auto index = Read<std::uint32_t>(primitive().indices);
  ASSERT_EQ(index.size(), 6 * body.topology.quads.size());
  for (std::size_t i = 0; i < index.size(); ++i) {
    const std::size_t quad = i / 6;
    const std::uint32_t vertex = index[i][0];
    bool found = false;
    for (int c = 0; c < 4; ++c) {
      const Eigen::Vector2f& corner = body.topology.uv[quad][c];
      found = found ||
              ((points[vertex] - rest[body.topology.quads[quad][c]]).norm() <
                   1e-6 &&
               std::abs(uv[vertex][0] - corner.x()) < 1e-6 &&
               std::abs(uv[vertex][1] - (1 - corner.y())) < 1e-6);
    }
    EXPECT_TRUE(found) << "index " << i;
  }
}

TEST_F(GlbTest, SeamVerticesAgree) {
  SaveAndLoad();
  const auto positions = Read<float>(Attribute("POSITION"));
  const auto normals = Read<float>(Attribute("NORMAL"));
  const auto joints = Read<std::uint8_t>(Attribute("JOINTS_0"));
  const auto weights = Read<float>(Attribute("WEIGHTS_0"));
  std::map<std::vector<float>, std::size_t> first;
  int num_copies = 0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const auto [entry, is_new] = first.emplace(positions[i], i);
    if (is_new) continue;
    ++num_copies;
    EXPECT_EQ(normals[i], normals[entry->second]);
    EXPECT_EQ(joints[i], joints[entry->second]);
    EXPECT_EQ(weights[i], weights[entry->second]);
  }
  EXPECT_GT(num_copies, 0);
  EXPECT_EQ(first.size(), TexturedToy().binding.size());
}

TEST_F(GlbTest, WeightsSumToOneAndNormalsAreUnit) {
  SaveAndLoad();
  const auto joints = Read<std::uint8_t>(Attribute("JOINTS_0"));
  const auto weights = Read<float>(Attribute("WEIGHTS_0"));
  const auto normals = Read<float>(Attribute("NORMAL"));
  for (std::size_t v = 0; v < weights.size(); ++v) {
    double sum = 0;
    for (int i = 0; i < 4; ++i) {
      sum += weights[v][i];
      EXPECT_GE(weights[v][i], 0);
      EXPECT_LT(joints[v][i], kNumJoints + ToyWeights().helpers.size());
      if (weights[v][i] == 0) {
        EXPECT_EQ(joints[v][i], 0);
      }
    }
    EXPECT_NEAR(sum, 1, 1e-6);
    EXPECT_NEAR(
        Eigen::Map<const Eigen::Vector3f>(normals[v].data()).norm(), 1, 1e-5);
  }
}

TEST_F(GlbTest, BoundsAreThoseOfThePositions) {
  SaveAndLoad();
  const tinygltf::Accessor& accessor = model_.accessors[Attribute("POSITION")];
  ASSERT_EQ(accessor.minValues.size(), 3u);
  const auto positions = Read<float>(Attribute("POSITION"));
  for (int i = 0; i < 3; ++i) {
    float low = positions[0][i];
    float high = positions[0][i];
    for (const auto& position : positions) {
      low = std::min(low, position[i]);
      high = std::max(high, position[i]);
    }
    EXPECT_EQ(accessor.minValues[i], low);
    EXPECT_EQ(accessor.maxValues[i], high);
  }
}

// Compares the file, played at the keys of its clips, with our own skinning.
TEST_F(GlbTest, ClipsPlayAsPosed) {
  GltfOptions options;
  options.correctives = false;
  SaveAndLoad(options);
  EXPECT_TRUE(primitive().targets.empty());
  const Body body = TexturedToy();
  const std::vector<int> vertex_of =
      NearestVertices(ReadPoints(Attribute("POSITION")), RestVertices(body));
  const std::vector<Clip> clips = TwoClips();
  ASSERT_EQ(model_.animations.size(), clips.size());
  for (std::size_t c = 0; c < clips.size(); ++c) {
    EXPECT_EQ(model_.animations[c].name, clips[c].name);
    const auto times = Read<float>(model_.animations[c].samplers[0].input);
    for (std::size_t key = 0; key < clips[c].time.size(); ++key) {
      EXPECT_FLOAT_EQ(times[key][0], static_cast<float>(clips[c].time[key]));
      const std::vector<Eigen::Vector3d> posed = Play(c, key);
      const std::vector<Eigen::Vector3d> expected =
          PoseVerticesLbs(body, ToyWeights(), clips[c].pose[key]);
      for (std::size_t v = 0; v < posed.size(); ++v) {
        ASSERT_LT((posed[v] - expected[vertex_of[v]]).norm(), 1e-5);
      }
    }
  }
}

TEST_F(GlbTest, CorrectivesBringClipsToTheSweeps) {
  SaveAndLoad();
  const Body body = TexturedToy();
  const std::vector<int> vertex_of =
      NearestVertices(ReadPoints(Attribute("POSITION")), RestVertices(body));
  const std::vector<Clip> clips = TwoClips();
  ASSERT_EQ(reports_.size(), clips.size());
  for (std::size_t c = 0; c < clips.size(); ++c) {
    EXPECT_GT(reports_[c].num_targets, 0);
    EXPECT_LE(reports_[c].rms, 0.001);
    EXPECT_LT(reports_[c].rms, 0.5 * reports_[c].rms_without);
    for (std::size_t key = 0; key < clips[c].time.size(); ++key) {
      const std::vector<Eigen::Vector3d> posed = Play(c, key);
      const std::vector<Eigen::Vector3d> expected =
          PoseVertices(body, clips[c].pose[key]);
      double sum = 0;
      for (std::size_t v = 0; v < posed.size(); ++v) {
        sum += (posed[v] - expected[vertex_of[v]]).squaredNorm();
      }
      EXPECT_LT(std::sqrt(sum / posed.size()), 0.002);
    }
  }
  const tinygltf::Value& names = model_.meshes[0].extras.Get("targetNames");
  EXPECT_EQ(names.ArrayLen(), primitive().targets.size());
  EXPECT_EQ(model_.meshes[0].weights.size(), primitive().targets.size());
}

TEST_F(GlbTest, JointsAreNamedByPreset) {
  for (const std::string& preset : ExportNamePresets()) {
    GltfOptions options;
    options.names = preset;
    SaveAndLoad(options);
    std::set<std::string> names;
    for (const int n : model_.skins[0].joints)
      names.insert(model_.nodes[n].name);
    EXPECT_EQ(names.size(), model_.skins[0].joints.size()) << preset;
    for (const std::string& name : ExportNames(preset)) {
      EXPECT_TRUE(names.contains(name)) << name;
    }
  }
  EXPECT_EQ(ExportNames("mixamo")[kLElbow], "mixamorig:LeftForeArm");
  EXPECT_EQ(ExportNames("unreal")[kRKnee], "calf_r");
  EXPECT_EQ(ExportNames("vrm")[kRShoulder], "rightUpperArm");
  EXPECT_THROW(ExportNames("maya"), InputError);
}

TEST_F(GlbTest, RotationsTakeTheShortWay) {
  Pose first;
  Pose second;
  second.rotation[kLElbow] = Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX());
  second.rotation[kLElbow].coeffs() *= -1;  // the same rotation
  Save({{"clip", {0, 1}, {first, second}}}, kPng);
  tinygltf::TinyGLTF loader;
  std::string error, warning;
  ASSERT_TRUE(loader.LoadBinaryFromFile(&model_, &error, &warning, path_));
  for (const tinygltf::AnimationChannel& channel :
       model_.animations[0].channels) {
    if (channel.target_path != "rotation") continue;
    const auto keys =
        Read<float>(model_.animations[0].samplers[channel.sampler].output);
    ASSERT_EQ(keys.size(), 2u);
    EXPECT_GT(Eigen::Map<const Eigen::Vector4f>(keys[0].data())
                  .dot(Eigen::Map<const Eigen::Vector4f>(keys[1].data())),
              0.9f);
  }
}

TEST_F(GlbTest, CarriesTheTextureOrAGreyMaterial) {
  SaveAndLoad();
  ASSERT_EQ(model_.images.size(), 1u);
  EXPECT_EQ(model_.images[0].width, 1);
  const tinygltf::BufferView& view =
      model_.bufferViews.at(model_.images[0].bufferView);
  const unsigned char* data = model_.buffers[0].data.data() + view.byteOffset;
  EXPECT_EQ(std::vector<std::uint8_t>(data, data + view.byteLength), kPng);
  const tinygltf::Material& material = model_.materials.at(0);
  EXPECT_EQ(material.pbrMetallicRoughness.baseColorTexture.index, 0);
  EXPECT_EQ(material.pbrMetallicRoughness.metallicFactor, 0);
  EXPECT_FALSE(material.doubleSided);

  Save({}, {});
  tinygltf::Model plain;
  tinygltf::TinyGLTF loader;
  std::string error, warning;
  ASSERT_TRUE(loader.LoadBinaryFromFile(&plain, &error, &warning, path_));
  EXPECT_TRUE(plain.images.empty());
  EXPECT_TRUE(plain.animations.empty());
  EXPECT_EQ(plain.materials.at(0).pbrMetallicRoughness.baseColorTexture.index,
            -1);
}

TEST_F(GlbTest, SameInputSameBytes) {
  Save(TwoClips(), kPng);
  const std::string first = ReadWholeFile(path_);
  Save(TwoClips(), kPng);
  EXPECT_EQ(first, ReadWholeFile(path_));
  EXPECT_EQ(first.size() % 4, 0u);
}

TEST_F(GlbTest, RefusesTimesThatDoNotAscend) {
  const Pose pose;
  for (const std::vector<double>& time : std::vector<std::vector<double>>{
           {0, 0}, {1, 0.5}, {-1, 0}, {0, std::nan("")}, {1, 1 + 1e-12}}) {
    EXPECT_THROW(Save({{"clip", time, {pose, pose}}}, kPng), InputError);
    EXPECT_FALSE(std::filesystem::exists(path_));
  }
  EXPECT_THROW(Save({{"clip", {}, {}}}, kPng), InputError);
  EXPECT_THROW(Save({{"clip", {0, 1}, {pose}}}, kPng), InputError);
}

TEST(SaveGlb, NamesAPathThatCannotBeWritten) {
  const std::string path =
      (std::filesystem::path(testing::TempDir()) / "no_such_folder" / "a.glb")
          .string();
  try {
    SaveGlb(TexturedToy(), ToyWeights(), {}, {}, path);
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(path), std::string::npos);
  }
}

}  // namespace
}  // namespace sweepfit
