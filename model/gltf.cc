// SPDX-License-Identifier: Apache-2.0
#include "model/gltf.h"

#include <glog/logging.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "model/correctives.h"
#include "model/export_names.h"
#include "model/file_io.h"
#include "model/helper_joints.h"
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

// The name of a helper beside that of its joint.
std::string HelperName(const HelperJoint& helper,
                       const std::array<std::string, kNumJoints>& names) {
  const std::string own(kJointNames[helper.joint]);
  CHECK(helper.name.starts_with(own)) << helper.name;
  return names[helper.joint] + helper.name.substr(own.size());
}

// The joints become nodes 0 to 20 in skeleton order, unrotated at rest, and
// the helpers follow.
void AddJointNodes(const JointFrames& rest,
                   const std::vector<HelperJoint>& helpers,
                   const std::array<std::string, kNumJoints>& names,
                   tinygltf::Model* model) {
  const auto add =
      [&](const std::string& name, int parent, Eigen::Vector3d offset) {
        const int index = static_cast<int>(model->nodes.size());
        tinygltf::Node node;
        node.name = name;
        if (parent >= 0) {
          offset -= rest.joint_in_world[parent];
          model->nodes[parent].children.push_back(index);
        }
        node.translation = {offset.x(), offset.y(), offset.z()};
        model->nodes.push_back(node);
      };
  for (int j = 0; j < kNumJoints; ++j) {
    add(names[j], kJointParents[j], rest.joint_in_world[j]);
  }
  for (const HelperJoint& helper : helpers) {
    add(HelperName(helper, names), helper.parent, helper.joint_in_rest);
  }
}

int AddSkin(const JointFrames& rest,
            const std::vector<HelperJoint>& helpers,
            Buffer* buffer,
            tinygltf::Model* model) {
  std::vector<float> inverse_bind;
  tinygltf::Skin skin;
  skin.name = "skeleton";
  skin.skeleton = kRoot;
  const int num_joints = kNumJoints + static_cast<int>(helpers.size());
  for (int j = 0; j < num_joints; ++j) {
    skin.joints.push_back(j);
    const Eigen::Vector3d& joint_in_world =
        j < kNumJoints ? rest.joint_in_world[j]
                       : helpers[j - kNumJoints].joint_in_rest;
    Eigen::Matrix4f joint_from_world = Eigen::Matrix4f::Identity();
    joint_from_world.topRightCorner<3, 1>() = -joint_in_world.cast<float>();
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

// A morph target: position offsets, sparse, since most vertices stay.
int AddMorphTarget(const std::vector<Eigen::Vector3d>& offset,
                   const SplitMesh& mesh,
                   Buffer* buffer,
                   tinygltf::Model* model) {
  constexpr double kVisible = 5e-5;  // metres
  std::vector<std::uint32_t> indices;
  std::vector<float> values;
  for (std::size_t i = 0; i < mesh.body_vertex.size(); ++i) {
    const Eigen::Vector3d& d = offset[mesh.body_vertex[i]];
    if (d.norm() < kVisible) continue;
    indices.push_back(static_cast<std::uint32_t>(i));
    Append(d, &values);
  }
  if (indices.empty()) {  // a sparse accessor needs an entry
    indices.push_back(0);
    values.assign(3, 0);
  }
  tinygltf::Accessor accessor;
  accessor.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
  accessor.type = TINYGLTF_TYPE_VEC3;
  accessor.count = mesh.body_vertex.size();
  const bool is_dense = indices.size() == mesh.body_vertex.size();
  accessor.minValues.assign(3, is_dense ? values[0] : 0);
  accessor.maxValues = accessor.minValues;
  for (int c = 0; is_dense && c < 3; ++c) {
    accessor.minValues[c] = accessor.maxValues[c] = values[c];
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    double& low = accessor.minValues[i % 3];
    double& high = accessor.maxValues[i % 3];
    low = std::min<double>(low, values[i]);
    high = std::max<double>(high, values[i]);
  }
  accessor.sparse.isSparse = true;
  accessor.sparse.count = static_cast<int>(indices.size());
  accessor.sparse.indices.bufferView = buffer->AddView(
      indices.data(), indices.size() * sizeof(indices[0]), /*target=*/0);
  accessor.sparse.indices.byteOffset = 0;
  accessor.sparse.indices.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
  accessor.sparse.values.bufferView = buffer->AddView(
      values.data(), values.size() * sizeof(values[0]), /*target=*/0);
  accessor.sparse.values.byteOffset = 0;
  model->accessors.push_back(accessor);
  return static_cast<int>(model->accessors.size()) - 1;
}

tinygltf::Primitive BuildPrimitive(const Body& body,
                                   const SkinWeights& weights,
                                   const std::vector<Correctives>& correctives,
                                   Buffer* buffer,
                                   tinygltf::Model* model) {
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
  for (const Correctives& clip : correctives) {
    for (const std::vector<Eigen::Vector3d>& target : clip.target) {
      primitive.targets.push_back(
          {{"POSITION", AddMorphTarget(target, mesh, buffer, model)}});
    }
  }
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

bool IsConstant(const std::vector<float>& keys,
                const std::vector<float>& value) {
  constexpr float kSame = 1e-6f;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (std::abs(keys[i] - value[i % value.size()]) > kSame) return false;
  }
  return true;
}

// Writes one clip's channels.
class AnimationWriter {
 public:
  AnimationWriter(const Body& body,
                  const std::vector<HelperJoint>& helpers,
                  const JointMotions& joint_motions,
                  const Clip& clip,
                  const std::string& path,
                  Buffer* buffer)
      : body_(body),
        helpers_(helpers),
        joint_motions_(joint_motions),
        clip_(clip),
        buffer_(buffer) {
    animation_.name = clip.name;
    times_ = buffer->Add(KeyTimes(clip, path),
                         TINYGLTF_COMPONENT_TYPE_FLOAT,
                         TINYGLTF_TYPE_SCALAR,
                         /*target=*/0,
                         /*with_bounds=*/true);
  }

  // Rotations of all joints, and translations of those that move in their
  // parent's frame: the root, and shoulders whose collar bone turns.
  void AddJoints() {
    std::vector<int> moving = {kRoot};
    if (MovesCollar(clip_, 0)) moving.push_back(kLShoulder);
    if (MovesCollar(clip_, 1)) moving.push_back(kRShoulder);
    for (const int joint : moving) {
      Add(joint,
          "translation",
          TranslationKeys(clip_, body_.skeleton, joint),
          TINYGLTF_TYPE_VEC3);
    }
    for (int j = 0; j < kNumJoints; ++j) {
      Add(j, "rotation", RotationKeys(clip_, j), TINYGLTF_TYPE_VEC4);
    }
  }

  // The helpers' motion in the frames of the joints they hang on, where there
  // is any.
  void AddHelpers() {
    if (helpers_.empty()) return;
    const JointFrames rest = RestFrames(body_.skeleton);
    std::vector<std::vector<RigidMotion>> motions;
    for (const Pose& pose : clip_.pose)
      motions.push_back(joint_motions_.At(pose));
    for (std::size_t h = 0; h < helpers_.size(); ++h) {
      const HelperJoint& helper = helpers_[h];
      std::vector<float> rotations, translations;
      Eigen::Quaterniond previous = Eigen::Quaterniond::Identity();
      for (const std::vector<RigidMotion>& motion : motions) {
        const RigidMotion& parent = motion[helper.parent];
        const RigidMotion& own = motion[kNumJoints + h];
        const Eigen::Matrix3d parent_from_world = parent.rotation.transpose();
        Eigen::Quaterniond rotation(
            Eigen::Matrix3d(parent_from_world * own.rotation));
        rotation.normalize();
        if (rotation.dot(previous) < 0) rotation.coeffs() *= -1;
        previous = rotation;
        for (int i = 0; i < 4; ++i) {
          rotations.push_back(static_cast<float>(rotation.coeffs()[i]));
        }
        Append(
            parent_from_world * (own * helper.joint_in_rest -
                                 parent * rest.joint_in_world[helper.parent]),
            &translations);
      }
      const int node = kNumJoints + static_cast<int>(h);
      std::vector<float> offset;
      Append(helper.joint_in_rest - rest.joint_in_world[helper.parent],
             &offset);
      if (!IsConstant(rotations, {0, 0, 0, 1})) {
        Add(node, "rotation", rotations, TINYGLTF_TYPE_VEC4);
      }
      if (!IsConstant(translations, offset)) {
        Add(node, "translation", translations, TINYGLTF_TYPE_VEC3);
      }
    }
  }

  // Weights of all targets of the file; those of other clips stay 0.
  void AddMorphs(int node,
                 const Correctives& own,
                 std::size_t first,
                 std::size_t count) {
    if (count == 0) return;
    std::vector<float> keys;
    for (const std::vector<double>& weights : own.weight) {
      for (std::size_t t = 0; t < count; ++t) {
        const bool is_own = t >= first && t < first + own.target.size();
        keys.push_back(is_own ? static_cast<float>(weights[t - first]) : 0);
      }
    }
    Add(node, "weights", keys, TINYGLTF_TYPE_SCALAR);
  }

  tinygltf::Animation Finish() { return std::move(animation_); }

 private:
  void Add(int node,
           const std::string& target_path,
           const std::vector<float>& keys,
           int type) {
    AddChannel(node,
               target_path,
               times_,
               buffer_->Add(keys, TINYGLTF_COMPONENT_TYPE_FLOAT, type, 0),
               &animation_);
  }

  const Body& body_;
  const std::vector<HelperJoint>& helpers_;
  const JointMotions& joint_motions_;
  const Clip& clip_;
  Buffer* buffer_;
  tinygltf::Animation animation_;
  int times_ = -1;
};

// Names of the targets where programs look for them.
tinygltf::Value TargetNames(const std::vector<Clip>& clips,
                            const std::vector<Correctives>& correctives) {
  tinygltf::Value::Array names;
  for (std::size_t c = 0; c < clips.size(); ++c) {
    for (std::size_t t = 0; t < correctives[c].target.size(); ++t) {
      names.emplace_back(clips[c].name + "_" + std::to_string(t));
    }
  }
  return tinygltf::Value(
      tinygltf::Value::Object{{"targetNames", tinygltf::Value(names)}});
}

tinygltf::Model BuildModel(const Body& body,
                           const BodyDeformer& deformer,
                           const SkinWeights& weights,
                           const std::vector<Clip>& clips,
                           const std::vector<Correctives>& correctives,
                           const GltfOptions& options,
                           const std::string& path) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "sweepfit";
  Buffer buffer(&model);
  const JointFrames rest = RestFrames(body.skeleton);
  AddJointNodes(rest, weights.helpers, ExportNames(options.names), &model);

  tinygltf::Mesh mesh;
  mesh.name = options.mesh_name;
  mesh.primitives.push_back(
      BuildPrimitive(body, weights, correctives, &buffer, &model));
  const std::size_t num_targets = mesh.primitives.back().targets.size();
  if (num_targets > 0) {
    mesh.weights.assign(num_targets, 0.0);
    mesh.extras = TargetNames(clips, correctives);
  }
  model.meshes.push_back(mesh);
  // Viewers ignore the transform of a skinned mesh's node: keep it at the root.
  tinygltf::Node node;
  node.name = options.mesh_name;
  node.mesh = 0;
  node.skin = AddSkin(rest, weights.helpers, &buffer, &model);
  model.nodes.push_back(node);
  const int mesh_node = static_cast<int>(model.nodes.size()) - 1;
  tinygltf::Scene scene;
  scene.name = "scene";
  scene.nodes = {mesh_node, kRoot};
  model.scenes.push_back(scene);
  model.defaultScene = 0;

  AddMaterial(options.texture_png, &buffer, &model);
  std::size_t first_target = 0;
  const JointMotions joint_motions(body, weights.helpers, deformer);
  for (std::size_t c = 0; c < clips.size(); ++c) {
    AnimationWriter writer(
        body, weights.helpers, joint_motions, clips[c], path, &buffer);
    writer.AddJoints();
    writer.AddHelpers();
    if (!correctives.empty()) {
      writer.AddMorphs(mesh_node, correctives[c], first_target, num_targets);
      first_target += correctives[c].target.size();
    }
    model.animations.push_back(writer.Finish());
  }
  buffer.Finish();
  return model;
}

}  // namespace

std::vector<ClipReport> SaveGlb(const Body& body,
                                const SkinWeights& weights,
                                const std::vector<Clip>& clips,
                                const GltfOptions& options,
                                const std::string& path) {
  CHECK_EQ(weights.joint.size(), body.binding.size());
  CHECK_EQ(weights.weight.size(), body.binding.size());
  CHECK_EQ(body.topology.uv.size(), body.topology.quads.size());
  const BodyDeformer deformer(body);
  std::vector<Correctives> correctives;
  std::vector<ClipReport> reports;
  for (const Clip& clip : clips) {
    KeyTimes(clip, path);  // bad clips are told before work is done for them
    if (!options.correctives) continue;
    correctives.push_back(BakeCorrectives(
        body, deformer, weights, clip.pose, CorrectiveOptions()));
    const Correctives& c = correctives.back();
    reports.push_back({clip.name,
                       static_cast<int>(c.target.size()),
                       c.rms_without,
                       c.max_without,
                       c.rms_with,
                       c.max_with});
  }
  const tinygltf::Model model =
      BuildModel(body, deformer, weights, clips, correctives, options, path);
  std::ostringstream stream;
  tinygltf::TinyGLTF writer;
  if (!writer.WriteGltfSceneToStream(
          &model, stream, /*prettyPrint=*/false, /*writeBinary=*/true)) {
    throw InputError(path + ": cannot be written");
  }
  WriteWholeFile(stream.str(), path);
  return reports;
}

}  // namespace sweepfit
