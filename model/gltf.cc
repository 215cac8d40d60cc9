// SPDX-License-Identifier: Apache-2.0
#include "model/gltf.h"

#include <glog/logging.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "model/file_io.h"
#include "model/input_error.h"
#include "model/mesh.h"

namespace sweepfit {
namespace {

// The mesh as glTF wants it: one texture coordinate per vertex, so vertices on
// a UV seam appear once per side.
struct SplitMesh {
  std::vector<int> body_vertex;     // per split vertex
  std::vector<Eigen::Vector2f> uv;  // v up
  std::vector<Triangle> triangles;  // of split vertices
};

SplitMesh SplitAtSeams(const Body& body,
                       const std::vector<Eigen::Vector3d>& rest) {
  SplitMesh mesh;
  std::vector<std::vector<int>> copies(rest.size());
  std::vector<Quad> quads;
  quads.reserve(body.topology.quads.size());
  for (std::size_t q = 0; q < body.topology.quads.size(); ++q) {
    Quad split;
    for (int corner = 0; corner < 4; ++corner) {
      const int vertex = body.topology.quads[q][corner];
      const Eigen::Vector2f& uv = body.topology.uv[q][corner];
      const auto found = std::find_if(
          copies[vertex].begin(), copies[vertex].end(), [&](int copy) {
            return mesh.uv[copy] == uv;
          });
      if (found != copies[vertex].end()) {
        split[corner] = *found;
        continue;
      }
      split[corner] = static_cast<int>(mesh.uv.size());
      copies[vertex].push_back(split[corner]);
      mesh.body_vertex.push_back(vertex);
      mesh.uv.push_back(uv);
    }
    quads.push_back(split);
  }
  std::vector<Eigen::Vector3d> positions;
  positions.reserve(mesh.body_vertex.size());
  for (const int vertex : mesh.body_vertex) positions.push_back(rest[vertex]);
  mesh.triangles = TriangulateQuads(quads, positions);
  return mesh;
}

// Collects accessors and their bytes; every accessor has a buffer view of its
// own, which starts at a multiple of four.
class Buffer {
 public:
  explicit Buffer(tinygltf::Model* model) : model_(model) {}

  template <typename Scalar>
  int Add(const std::vector<Scalar>& values,
          int component_type,
          int type,
          int target,
          bool with_bounds = false) {
    const int width = tinygltf::GetNumComponentsInType(type);
    CHECK(!values.empty());
    CHECK_EQ(values.size() % width, 0u);
    tinygltf::Accessor accessor;
    accessor.bufferView =
        AddView(values.data(), values.size() * sizeof(Scalar), target);
    accessor.byteOffset = 0;
    accessor.componentType = component_type;
    accessor.type = type;
    accessor.count = values.size() / width;
    if (with_bounds) SetBounds(values, width, &accessor);
    model_->accessors.push_back(accessor);
    return static_cast<int>(model_->accessors.size()) - 1;
  }

  int AddView(const void* data, std::size_t size, int target) {
    bytes_.resize((bytes_.size() + 3) / 4 * 4, 0);
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = bytes_.size();
    view.byteLength = size;
    view.target = target;
    const auto* begin = static_cast<const unsigned char*>(data);
    bytes_.insert(bytes_.end(), begin, begin + size);
    model_->bufferViews.push_back(view);
    return static_cast<int>(model_->bufferViews.size()) - 1;
  }

  void Finish() {
    bytes_.resize((bytes_.size() + 3) / 4 * 4, 0);
    model_->buffers.emplace_back();
    model_->buffers.back().data = std::move(bytes_);
  }

 private:
  template <typename Scalar>
  static void SetBounds(const std::vector<Scalar>& values,
                        int width,
                        tinygltf::Accessor* accessor) {
    accessor->minValues.assign(values.begin(), values.begin() + width);
    accessor->maxValues = accessor->minValues;
    for (std::size_t i = 0; i < values.size(); ++i) {
      double& low = accessor->minValues[i % width];
      double& high = accessor->maxValues[i % width];
      low = std::min<double>(low, values[i]);
      high = std::max<double>(high, values[i]);
    }
  }

  tinygltf::Model* model_;
  std::vector<unsigned char> bytes_;
};

// The joints become nodes 0 to 20 in skeleton order, unrotated at rest.
void AddJointNodes(const JointFrames& rest, tinygltf::Model* model) {
  for (int j = 0; j < kNumJoints; ++j) {
    tinygltf::Node node;
    node.name = std::string(kJointNames[j]);
    const int parent = kJointParents[j];
    Eigen::Vector3d offset = rest.joint_in_world[j];
    if (parent >= 0) {
      offset -= rest.joint_in_world[parent];
      model->nodes[parent].children.push_back(j);
    }
    node.translation = {offset.x(), offset.y(), offset.z()};
    model->nodes.push_back(node);
  }
}

int AddSkin(const JointFrames& rest, Buffer* buffer, tinygltf::Model* model) {
  std::vector<float> inverse_bind;
  tinygltf::Skin skin;
  skin.name = "skeleton";
  skin.skeleton = kRoot;
  for (int j = 0; j < kNumJoints; ++j) {
    skin.joints.push_back(j);
    Eigen::Matrix4f joint_from_world = Eigen::Matrix4f::Identity();
    joint_from_world.topRightCorner<3, 1>() =
        -rest.joint_in_world[j].cast<float>();
    inverse_bind.insert(inverse_bind.end(),
                        joint_from_world.data(),
                        joint_from_world.data() + 16);  // column major, both
  }
  skin.inverseBindMatrices = buffer->Add(inverse_bind,
                                         TINYGLTF_COMPONENT_TYPE_FLOAT,
                                         TINYGLTF_TYPE_MAT4,
                                         /*target=*/0);
  model->skins.push_back(skin);
  return static_cast<int>(model->skins.size()) - 1;
}

// The weights of one vertex as floats whose sum is 1 to rounding; joint 0
// where the weight is 0.
void AppendInfluences(const std::array<int, 4>& joint,
                      const std::array<double, 4>& weight,
                      std::vector<std::uint8_t>* joints_out,
                      std::vector<float>* weights_out) {
  double sum = 0;
  for (const double w : weight) sum += w;
  CHECK_GT(sum, 0);
  std::array<float, 4> rounded;
  float others = 0;
  for (int i = 3; i >= 1; --i) {
    rounded[i] = static_cast<float>(weight[i] / sum);
    others += rounded[i];
  }
  rounded[0] = 1.0f - others;  // the heaviest takes the rounding
  for (int i = 0; i < 4; ++i) {
    weights_out->push_back(rounded[i]);
    joints_out->push_back(
        static_cast<std::uint8_t>(rounded[i] > 0 ? joint[i] : 0));
  }
}

void Append(const Eigen::Vector3d& value, std::vector<float>* out) {
  for (int i = 0; i < 3; ++i) out->push_back(static_cast<float>(value[i]));
}

tinygltf::Primitive BuildPrimitive(const Body& body,
                                   const SkinWeights& weights,
                                   Buffer* buffer) {
  const std::vector<Eigen::Vector3d> rest = RestVertices(body);
  const std::vector<Eigen::Vector3d> normals =
      VertexNormals({rest, TriangulateQuads(body.topology.quads, rest)});
  const SplitMesh mesh = SplitAtSeams(body, rest);
  std::vector<float> positions, normals_out, uvs, weights_out;
  std::vector<std::uint8_t> joints_out;
  for (std::size_t i = 0; i < mesh.body_vertex.size(); ++i) {
    const int v = mesh.body_vertex[i];
    Append(rest[v], &positions);
    Append(normals[v], &normals_out);
    uvs.push_back(mesh.uv[i].x());
    uvs.push_back(1.0f - mesh.uv[i].y());  // glTF's v runs down
    AppendInfluences(
        weights.joint[v], weights.weight[v], &joints_out, &weights_out);
  }
  std::vector<std::uint32_t> indices;
  for (const Triangle& triangle : mesh.triangles) {
    indices.insert(indices.end(), triangle.begin(), triangle.end());
  }
  constexpr int kFloat = TINYGLTF_COMPONENT_TYPE_FLOAT;
  constexpr int kVertices = TINYGLTF_TARGET_ARRAY_BUFFER;
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.material = 0;
  primitive.indices = buffer->Add(indices,
                                  TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT,
                                  TINYGLTF_TYPE_SCALAR,
                                  TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
  primitive.attributes["POSITION"] = buffer->Add(
      positions, kFloat, TINYGLTF_TYPE_VEC3, kVertices, /*with_bounds=*/true);
  primitive.attributes["NORMAL"] =
      buffer->Add(normals_out, kFloat, TINYGLTF_TYPE_VEC3, kVertices);
  primitive.attributes["TEXCOORD_0"] =
      buffer->Add(uvs, kFloat, TINYGLTF_TYPE_VEC2, kVertices);
  primitive.attributes["JOINTS_0"] =
      buffer->Add(joints_out,
                  TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE,
                  TINYGLTF_TYPE_VEC4,
                  kVertices);
  primitive.attributes["WEIGHTS_0"] =
      buffer->Add(weights_out, kFloat, TINYGLTF_TYPE_VEC4, kVertices);
  return primitive;
}

void AddMaterial(const std::vector<std::uint8_t>& png,
                 Buffer* buffer,
                 tinygltf::Model* model) {
  tinygltf::Material material;
  material.name = "skin";
  material.pbrMetallicRoughness.metallicFactor = 0;
  material.pbrMetallicRoughness.roughnessFactor = 0.9;
  if (png.empty()) {
    material.pbrMetallicRoughness.baseColorFactor = {0.6, 0.6, 0.6, 1};
  } else {
    tinygltf::Image image;
    image.name = "texture";
    image.mimeType = "image/png";
    image.bufferView = buffer->AddView(png.data(), png.size(), /*target=*/0);
    model->images.push_back(image);
    tinygltf::Sampler sampler;
    sampler.magFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
    sampler.minFilter = TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_LINEAR;
    sampler.wrapS = sampler.wrapT = TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
    model->samplers.push_back(sampler);
    tinygltf::Texture texture;
    texture.source = 0;
    texture.sampler = 0;
    model->textures.push_back(texture);
    material.pbrMetallicRoughness.baseColorTexture.index = 0;
  }
  model->materials.push_back(material);
}

// Key times as floats, strictly ascending and not negative.
std::vector<float> KeyTimes(const Clip& clip, const std::string& path) {
  if (clip.time.empty() || clip.time.size() != clip.pose.size()) {
    throw InputError(path + ": clip '" + clip.name +
                     "' needs one posture per key time and at least one");
  }
  std::vector<float> times(clip.time.begin(), clip.time.end());
  for (std::size_t i = 0; i < times.size(); ++i) {
    const bool ascends = i == 0 ? times[i] >= 0 : times[i] > times[i - 1];
    if (!std::isfinite(times[i]) || !ascends) {
      throw InputError(path + ": key times of clip '" + clip.name +
                       "' do not ascend from 0 at key " + std::to_string(i));
    }
  }
  return times;
}

// The rotations of one joint, each on the side of its predecessor, so that
// interpolation takes the short way.
std::vector<float> RotationKeys(const Clip& clip, int joint) {
  std::vector<float> keys;
  Eigen::Quaterniond previous = Eigen::Quaterniond::Identity();
  for (const Pose& pose : clip.pose) {
    Eigen::Quaterniond rotation = pose.rotation[joint].normalized();
    if (rotation.dot(previous) < 0) rotation.coeffs() *= -1;
    previous = rotation;
    for (int i = 0; i < 4; ++i) {
      keys.push_back(static_cast<float>(rotation.coeffs()[i]));  // x y z w
    }
  }
  return keys;
}

// Where a joint is in its parent's frame, per key: at its rest place, but for
// shoulders, which the collar bones carry about.
std::vector<float> TranslationKeys(const Clip& clip,
                                   const Skeleton& skeleton,
                                   int joint) {
  std::vector<float> keys;
  for (const Pose& pose : clip.pose) {
    const JointFrames frames = ForwardKinematics(skeleton, pose);
    const int parent = kJointParents[joint];
    if (parent < 0) {
      Append(frames.joint_in_world[joint], &keys);
    } else {
      Append(frames.world_from_joint[parent].transpose() *
                 (frames.joint_in_world[joint] - frames.joint_in_world[parent]),
             &keys);
    }
  }
  return keys;
}

bool MovesCollar(const Clip& clip, int side) {
  return std::any_of(
      clip.pose.begin(), clip.pose.end(), [side](const Pose& pose) {
        return pose.collar[side].vec().norm() > 1e-9;
      });
}

void AddChannel(int joint,
                const std::string& target_path,
                int times,
                int values,
                tinygltf::Animation* animation) {
  tinygltf::AnimationSampler sampler;
  sampler.input = times;
  sampler.output = values;
  sampler.interpolation = "LINEAR";
  animation->samplers.push_back(sampler);
  tinygltf::AnimationChannel channel;
  channel.sampler = static_cast<int>(animation->samplers.size()) - 1;
  channel.target_node = joint;
  channel.target_path = target_path;
  animation->channels.push_back(channel);
}

// Rotations of all joints, and translations of those that move in their
// parent's frame: the root, and shoulders whose collar bone turns.
void AddAnimation(const Clip& clip,
                  const Skeleton& skeleton,
                  const std::string& path,
                  Buffer* buffer,
                  tinygltf::Model* model) {
  constexpr int kFloat = TINYGLTF_COMPONENT_TYPE_FLOAT;
  tinygltf::Animation animation;
  animation.name = clip.name;
  const int times = buffer->Add(KeyTimes(clip, path),
                                kFloat,
                                TINYGLTF_TYPE_SCALAR,
                                /*target=*/0,
                                /*with_bounds=*/true);
  std::vector<int> moving = {kRoot};
  if (MovesCollar(clip, 0)) moving.push_back(kLShoulder);
  if (MovesCollar(clip, 1)) moving.push_back(kRShoulder);
  for (const int joint : moving) {
    AddChannel(joint,
               "translation",
               times,
               buffer->Add(TranslationKeys(clip, skeleton, joint),
                           kFloat,
                           TINYGLTF_TYPE_VEC3,
                           0),
               &animation);
  }
  for (int j = 0; j < kNumJoints; ++j) {
    AddChannel(
        j,
        "rotation",
        times,
        buffer->Add(RotationKeys(clip, j), kFloat, TINYGLTF_TYPE_VEC4, 0),
        &animation);
  }
  model->animations.push_back(animation);
}

tinygltf::Model BuildModel(const Body& body,
                           const SkinWeights& weights,
                           const std::vector<Clip>& clips,
                           const GltfOptions& options,
                           const std::string& path) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "sweepfit";
  Buffer buffer(&model);
  const JointFrames rest = RestFrames(body.skeleton);
  AddJointNodes(rest, &model);

  tinygltf::Mesh mesh;
  mesh.name = options.mesh_name;
  mesh.primitives.push_back(BuildPrimitive(body, weights, &buffer));
  model.meshes.push_back(mesh);
  // Viewers ignore the transform of a skinned mesh's node: keep it at the root.
  tinygltf::Node node;
  node.name = options.mesh_name;
  node.mesh = 0;
  node.skin = AddSkin(rest, &buffer, &model);
  model.nodes.push_back(node);
  tinygltf::Scene scene;
  scene.name = "scene";
  scene.nodes = {static_cast<int>(model.nodes.size()) - 1, kRoot};
  model.scenes.push_back(scene);
  model.defaultScene = 0;

  AddMaterial(options.texture_png, &buffer, &model);
  for (const Clip& clip : clips) {
    AddAnimation(clip, body.skeleton, path, &buffer, &model);
  }
  buffer.Finish();
  return model;
}

}  // namespace

void SaveGlb(const Body& body,
             const SkinWeights& weights,
             const std::vector<Clip>& clips,
             const GltfOptions& options,
             const std::string& path) {
  CHECK_EQ(weights.joint.size(), body.binding.size());
  CHECK_EQ(weights.weight.size(), body.binding.size());
  CHECK_EQ(body.topology.uv.size(), body.topology.quads.size());
  const tinygltf::Model model = BuildModel(body, weights, clips, options, path);
  std::ostringstream stream;
  tinygltf::TinyGLTF writer;
  if (!writer.WriteGltfSceneToStream(
          &model, stream, /*prettyPrint=*/false, /*writeBinary=*/true)) {
    throw InputError(path + ": cannot be written");
  }
  WriteWholeFile(stream.str(), path);
}

}  // namespace sweepfit
