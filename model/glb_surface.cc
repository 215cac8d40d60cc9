// SPDX-License-Identifier: Apache-2.0
#include "model/glb_surface.h"

#include <tiny_gltf.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <optional>

#include "model/file_io.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

using Eigen::Matrix4d;
using Eigen::Vector3d;

// Reads numbers from accessors and checks everything that tinygltf does not.
class GlbReader {
 public:
  explicit GlbReader(const std::string& path) : path_(path) {
    const std::string bytes = ReadWholeFile(path);
    if (bytes.size() < 20 || bytes.compare(0, 4, "glTF") != 0) {
      Fail("not a binary glTF file");
    }
    std::uint32_t length = 0;
    std::memcpy(&length, bytes.data() + 8, sizeof(length));
    if (length > bytes.size()) {
      Fail("cut short: " + std::to_string(bytes.size()) + " of " +
           std::to_string(length) + " bytes");
    }
    tinygltf::TinyGLTF loader;
    // Pictures are of no interest.
    loader.SetImageLoader([](tinygltf::Image*,
                             const int,
                             std::string*,
                             std::string*,
                             int,
                             int,
                             const unsigned char*,
                             int,
                             void*) { return true; },
                          nullptr);
    std::string error, warning;
    bool loaded = false;
    try {
      loaded = loader.LoadBinaryFromMemory(
          &model_,
          &error,
          &warning,
          reinterpret_cast<const unsigned char*>(bytes.data()),
          static_cast<unsigned int>(bytes.size()));
    } catch (const std::exception& exception) {
      error = exception.what();
    }
    if (!loaded) {
      std::replace(error.begin(), error.end(), '\n', ' ');
      Fail("cannot be read as glTF: " + error);
    }
    for (const std::string& extension : model_.extensionsRequired) {
      if (extension == "KHR_draco_mesh_compression" ||
          extension == "EXT_meshopt_compression") {
        Fail("needs " + extension + "; export it without compression");
      }
    }
    PlaceNodes();
  }

  SkinnedSurface Read() {
    SkinnedSurface surface;
    PlaceBoundJoints();
    for (std::size_t n = 0; n < model_.nodes.size(); ++n) {
      const tinygltf::Node& node = model_.nodes[n];
      if (node.mesh < 0 || node.skin < 0) continue;
      Check(node.mesh, model_.meshes.size(), "mesh of a node");
      const tinygltf::Mesh& mesh = model_.meshes[node.mesh];
      surface.mesh_name.push_back(mesh.name.empty() ? node.name : mesh.name);
      for (const tinygltf::Primitive& primitive : mesh.primitives) {
        Append(primitive, node.skin, &surface);
      }
    }
    if (surface.triangles.empty()) Fail("holds no mesh with a skin");
    for (std::size_t n = 0; n < model_.nodes.size(); ++n) {
      surface.node_name.push_back(model_.nodes[n].name);
      surface.as_nodes.nodes.push_back(
          scene_from_node_[n].topRightCorner<3, 1>());
      surface.as_bound.nodes.push_back(
          (*scene_from_bound_[n]).topRightCorner<3, 1>());
    }
    surface.node_parent = parent_;
    surface.is_joint.assign(model_.nodes.size(), false);
    for (const tinygltf::Skin& skin : model_.skins) {
      for (const int joint : skin.joints) surface.is_joint[joint] = true;
    }
    return surface;
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw InputError(path_ + ": " + what);
  }

  void Check(int index, std::size_t size, const char* what) const {
    if (index < 0 || static_cast<std::size_t>(index) >= size) {
      Fail(std::string("the ") + what +
           " is out of range: " + std::to_string(index));
    }
  }

  Matrix4d LocalMatrix(const tinygltf::Node& node) const {
    Matrix4d matrix = Matrix4d::Identity();
    if (node.matrix.size() == 16) {
      for (int i = 0; i < 16; ++i) matrix(i % 4, i / 4) = node.matrix[i];
    } else {
      Eigen::Affine3d local = Eigen::Affine3d::Identity();
      if (node.translation.size() == 3) {
        local.translate(Vector3d(node.translation.data()));
      }
      if (node.rotation.size() == 4) {
        local.rotate(Eigen::Quaterniond(node.rotation[3],
                                        node.rotation[0],
                                        node.rotation[1],
                                        node.rotation[2])
                         .normalized());
      }
      if (node.scale.size() == 3) local.scale(Vector3d(node.scale.data()));
      matrix = local.matrix();
    }
    if (!matrix.allFinite()) {
      Fail("node '" + node.name + "' has a transform that is no number");
    }
    return matrix;
  }

  void PlaceNodes() {
    const std::size_t num = model_.nodes.size();
    parent_.assign(num, -1);
    for (std::size_t n = 0; n < num; ++n) {
      for (const int child : model_.nodes[n].children) {
        Check(child, num, "child of a node");
        if (parent_[child] >= 0) Fail("a node has two parents");
        parent_[child] = static_cast<int>(n);
      }
    }
    scene_from_node_.resize(num);
    for (std::size_t n = 0; n < num; ++n) {
      Matrix4d matrix = Matrix4d::Identity();
      std::size_t depth = 0;
      for (int at = static_cast<int>(n); at >= 0; at = parent_[at]) {
        if (++depth > num) Fail("the nodes form a circle");
        matrix = LocalMatrix(model_.nodes[at]) * matrix;
      }
      scene_from_node_[n] = matrix;
    }
    // Joints tell how large the person is.
    Eigen::AlignedBox3d box;
    for (const tinygltf::Skin& skin : model_.skins) {
      for (const int joint : skin.joints) {
        Check(joint, num, "joint of a skin");
        box.extend(Vector3d(scene_from_node_[joint].topRightCorner<3, 1>()));
      }
    }
    cell_ = box.isEmpty() ? 1 : 1e-6 * std::max(1e-9, box.diagonal().norm());
  }

  // The numbers of an accessor, row by row.
  std::vector<double> Numbers(int index, int width, const char* what) const {
    Check(index, model_.accessors.size(), what);
    const tinygltf::Accessor& accessor = model_.accessors[index];
    if (accessor.sparse.isSparse) {
      Fail(std::string(what) + " are stored sparsely, which is not read");
    }
    if (tinygltf::GetNumComponentsInType(accessor.type) != width) {
      Fail(std::string(what) + " have the wrong number of components");
    }
    Check(accessor.bufferView, model_.bufferViews.size(), what);
    const tinygltf::BufferView& view = model_.bufferViews[accessor.bufferView];
    Check(view.buffer, model_.buffers.size(), what);
    const std::vector<unsigned char>& data = model_.buffers[view.buffer].data;
    const int stride = accessor.ByteStride(view);
    const int size = tinygltf::GetComponentSizeInBytes(accessor.componentType);
    if (stride <= 0 || size <= 0 || size * width > stride) {
      Fail(std::string(what) + " have an unknown layout");
    }
    const auto within =
        [](std::size_t offset, std::size_t length, std::size_t whole) {
          return offset <= whole && length <= whole - offset;
        };
    const std::size_t count = accessor.count;
    if (count > data.size() ||
        !within(view.byteOffset, view.byteLength, data.size()) ||
        !within(accessor.byteOffset,
                count == 0 ? 0 : (count - 1) * stride + size * width,
                view.byteLength)) {
      Fail(std::string(what) + " reach beyond the end of their buffer");
    }
    std::vector<double> numbers;
    numbers.reserve(count * width);
    const unsigned char* start =
        data.data() + view.byteOffset + accessor.byteOffset;
    for (std::size_t row = 0; row < count; ++row) {
      for (int i = 0; i < width; ++i) {
        numbers.push_back(Number(start + row * stride + i * size,
                                 accessor.componentType,
                                 accessor.normalized,
                                 what));
      }
    }
    return numbers;
  }

  template <typename T>
  static T Copy(const unsigned char* from) {
    T value;
    std::memcpy(&value, from, sizeof(T));
    return value;
  }

  double Number(const unsigned char* from,
                int type,
                bool normalized,
                const char* what) const {
    double value = 0;
    switch (type) {
      case TINYGLTF_COMPONENT_TYPE_FLOAT:
        value = Copy<float>(from);
        break;
      case TINYGLTF_COMPONENT_TYPE_BYTE:
        value = Copy<std::int8_t>(from);
        if (normalized) value = std::max(value / 127.0, -1.0);
        break;
      case TINYGLTF_COMPONENT_TYPE_SHORT:
        value = Copy<std::int16_t>(from);
        if (normalized) value = std::max(value / 32767.0, -1.0);
        break;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        value = *from / (normalized ? 255.0 : 1.0);
        break;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        value = Copy<std::uint16_t>(from) / (normalized ? 65535.0 : 1.0);
        break;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        value = Copy<std::uint32_t>(from);
        break;
      default:
        Fail(std::string(what) + " have a type that is not read");
    }
    if (!std::isfinite(value)) {
      Fail(std::string(what) + " hold a value that is no number");
    }
    return value;
  }

  // The inverse bind matrices of a skin: joint from mesh.
  std::vector<Matrix4d> JointFromMesh(const tinygltf::Skin& skin) const {
    std::vector<double> inverse;
    if (skin.inverseBindMatrices >= 0) {
      inverse = Numbers(skin.inverseBindMatrices, 16, "inverse bind matrices");
      if (inverse.size() < 16 * skin.joints.size()) {
        Fail("there are fewer inverse bind matrices than joints");
      }
    }
    std::vector<Matrix4d> joint_from_mesh(skin.joints.size(),
                                          Matrix4d::Identity());
    if (inverse.empty()) return joint_from_mesh;
    for (std::size_t j = 0; j < skin.joints.size(); ++j) {
      joint_from_mesh[j] = Eigen::Map<const Matrix4d>(&inverse[16 * j]);
      // Exporters leave rounding in the last row.
      joint_from_mesh[j].row(3) = Eigen::RowVector4d(0, 0, 0, 1);
      if (!(std::abs(joint_from_mesh[j].determinant()) > 0)) {
        Fail("the inverse bind matrix of '" +
             model_.nodes[skin.joints[j]].name + "' is singular");
      }
    }
    return joint_from_mesh;
  }

  int DepthOf(int node) const {
    int depth = 0;
    while ((node = parent_[node]) >= 0) ++depth;
    return depth;
  }

  // Where the joints were when the skins were bound. A skin says so but for a
  // motion of the whole: the joint that is highest in the hierarchy stays where
  // the nodes have it; further skins agree with the first where they share a
  // joint. Nodes that are in no skin keep their place before their parent.
  void PlaceBoundJoints() {
    scene_from_bound_.resize(model_.nodes.size());
    std::vector<std::size_t> order(model_.skins.size());
    for (std::size_t s = 0; s < order.size(); ++s) order[s] = s;
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) {
      return model_.skins[a].joints.size() > model_.skins[b].joints.size();
    });
    joint_from_mesh_.resize(model_.skins.size());
    scene_from_mesh_.resize(model_.skins.size());
    for (const std::size_t s : order) {
      const tinygltf::Skin& skin = model_.skins[s];
      joint_from_mesh_[s] = JointFromMesh(skin);
      if (skin.joints.empty()) continue;
      std::size_t key = 0;
      const auto rank = [&](std::size_t j) {
        return std::pair(!scene_from_bound_[skin.joints[j]].has_value(),
                         DepthOf(skin.joints[j]));
      };
      for (std::size_t j = 1; j < skin.joints.size(); ++j) {
        if (rank(j) < rank(key)) key = j;
      }
      const int node = skin.joints[key];
      scene_from_mesh_[s] = (scene_from_bound_[node] ? *scene_from_bound_[node]
                                                     : scene_from_node_[node]) *
                            joint_from_mesh_[s][key];
      for (std::size_t j = 0; j < skin.joints.size(); ++j) {
        if (scene_from_bound_[skin.joints[j]]) continue;
        scene_from_bound_[skin.joints[j]] =
            scene_from_mesh_[s] * joint_from_mesh_[s][j].inverse();
      }
    }
    for (std::size_t n = 0; n < model_.nodes.size(); ++n) {
      std::vector<int> above;  // without a place, the node first
      int at = static_cast<int>(n);
      while (at >= 0 && !scene_from_bound_[at]) {
        above.push_back(at);
        at = parent_[at];
      }
      while (!above.empty()) {
        const int node = above.back();
        above.pop_back();
        scene_from_bound_[node] = parent_[node] < 0
                                      ? scene_from_node_[node]
                                      : *scene_from_bound_[parent_[node]] *
                                            LocalMatrix(model_.nodes[node]);
      }
    }
  }

  int AttributeOf(const tinygltf::Primitive& primitive,
                  const char* name,
                  const char* what) const {
    const auto found = primitive.attributes.find(name);
    if (found == primitive.attributes.end()) {
      Fail(std::string("a skinned mesh has no ") + what);
    }
    return found->second;
  }

  // Triples of indices of a primitive's vertices.
  std::vector<std::array<std::size_t, 3>> Triples(
      const tinygltf::Primitive& primitive, std::size_t num) const {
    std::vector<std::size_t> indices;
    if (primitive.indices >= 0) {
      for (const double index : Numbers(primitive.indices, 1, "indices")) {
        if (!(index >= 0 && index < static_cast<double>(num))) {
          Fail("an index of a triangle is out of range");
        }
        indices.push_back(static_cast<std::size_t>(index));
      }
    } else {
      for (std::size_t v = 0; v < num; ++v) indices.push_back(v);
    }
    std::vector<std::array<std::size_t, 3>> triples;
    switch (primitive.mode) {
      case -1:
      case TINYGLTF_MODE_TRIANGLES:
        if (indices.size() % 3 != 0) {
          Fail("indices do not make whole triangles");
        }
        for (std::size_t i = 0; i < indices.size(); i += 3) {
          triples.push_back({indices[i], indices[i + 1], indices[i + 2]});
        }
        break;
      case TINYGLTF_MODE_TRIANGLE_STRIP:
        for (std::size_t i = 2; i < indices.size(); ++i) {
          triples.push_back(
              {indices[i - 2], indices[i - 1 + i % 2], indices[i - i % 2]});
        }
        break;
      case TINYGLTF_MODE_TRIANGLE_FAN:
        for (std::size_t i = 2; i < indices.size(); ++i) {
          triples.push_back({indices[0], indices[i - 1], indices[i]});
        }
        break;
      default:
        Fail("a skinned mesh is not made of triangles");
    }
    return triples;
  }

  void Append(const tinygltf::Primitive& primitive,
              int skin_index,
              SkinnedSurface* surface) {
    Check(skin_index, model_.skins.size(), "skin of a node");
    const tinygltf::Skin& skin = model_.skins[skin_index];
    const std::vector<double> positions = Numbers(
        AttributeOf(primitive, "POSITION", "positions"), 3, "positions");
    const std::size_t num = positions.size() / 3;
    std::vector<double> uv;
    if (primitive.attributes.count("TEXCOORD_0")) {
      uv = Numbers(
          primitive.attributes.at("TEXCOORD_0"), 2, "texture coordinates");
      if (uv.size() != 2 * num) {
        Fail("there are not as many texture coordinates as positions");
      }
    }
    std::vector<std::vector<double>> joints, weights;
    for (int set = 0; set < 8; ++set) {
      const std::string suffix = "_" + std::to_string(set);
      if (set > 0 && !primitive.attributes.count("JOINTS" + suffix)) break;
      joints.push_back(
          Numbers(AttributeOf(primitive, ("JOINTS" + suffix).c_str(), "joints"),
                  4,
                  "joints of vertices"));
      weights.push_back(Numbers(
          AttributeOf(primitive, ("WEIGHTS" + suffix).c_str(), "weights"),
          4,
          "weights of vertices"));
      if (joints.back().size() != 4 * num || weights.back().size() != 4 * num) {
        Fail("there are not as many joints and weights as positions");
      }
    }
    std::vector<int> welded(num);
    std::vector<bool> mirrored(num);  // the nodes turn the surface inside out
    for (std::size_t v = 0; v < num; ++v) {
      Matrix4d blend = Matrix4d::Zero(), bound = Matrix4d::Zero();
      std::map<int, double> of_node;
      double sum = 0;
      for (std::size_t set = 0; set < joints.size(); ++set) {
        for (int i = 0; i < 4; ++i) {
          const double weight = weights[set][4 * v + i];
          if (weight <= 0) continue;
          const int joint = static_cast<int>(joints[set][4 * v + i]);
          Check(joint, skin.joints.size(), "joint of a vertex");
          const int node = skin.joints[joint];
          const Matrix4d& joint_from_mesh = joint_from_mesh_[skin_index][joint];
          blend += weight * (scene_from_node_[node] * joint_from_mesh);
          bound += weight * (*scene_from_bound_[node] * joint_from_mesh);
          of_node[node] += weight;
          sum += weight;
        }
      }
      if (!(sum > 1e-6)) Fail("a vertex follows no joint");
      mirrored[v] = blend.topLeftCorner<3, 3>().determinant() < 0;
      const Eigen::Vector4d position(
          positions[3 * v], positions[3 * v + 1], positions[3 * v + 2], 1);
      const Vector3d place = (blend * position).head<3>() / sum;
      const Vector3d place_bound = (bound * position).head<3>() / sum;
      if (!place.allFinite() || !place_bound.allFinite()) {
        Fail("positions hold a value that is no number");
      }
      welded[v] = Weld(place, surface);
      if (surface->weights.size() < surface->as_nodes.vertices.size()) {
        surface->as_bound.vertices.push_back(place_bound);
        surface->weights.emplace_back();
        for (const auto& [node, weight] : of_node) {
          surface->weights.back().emplace_back(node, weight / sum);
        }
      }
    }
    for (std::array<std::size_t, 3> corners : Triples(primitive, num)) {
      if (mirrored[corners[0]]) std::swap(corners[1], corners[2]);
      Triangle triangle;
      std::array<Eigen::Vector2f, 3> corner_uv;
      for (int k = 0; k < 3; ++k) {
        const std::size_t v = corners[k];
        triangle[k] = welded[v];
        corner_uv[k].setConstant(std::numeric_limits<float>::quiet_NaN());
        if (uv.empty()) continue;
        corner_uv[k] = {static_cast<float>(uv[2 * v]),
                        static_cast<float>(1 - uv[2 * v + 1])};
      }
      if (triangle[0] == triangle[1] || triangle[1] == triangle[2] ||
          triangle[2] == triangle[0]) {
        continue;
      }
      surface->triangles.push_back(triangle);
      surface->uv.push_back(corner_uv);
      surface->material.push_back(primitive.material);
      surface->mesh.push_back(static_cast<int>(surface->mesh_name.size()) - 1);
    }
  }

  // The vertex at this place, or a new one. Places are the same within a
  // millionth of a person.
  int Weld(const Vector3d& place, SkinnedSurface* surface) {
    std::array<std::int64_t, 3> key;
    for (int i = 0; i < 3; ++i) {
      const double at = place[i] / cell_;
      if (!(std::abs(at) < 1e15)) Fail("positions are out of all proportion");
      key[i] = std::llround(at);
    }
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dz = -1; dz <= 1; ++dz) {
          const auto found =
              places_.find({key[0] + dx, key[1] + dy, key[2] + dz});
          if (found == places_.end()) continue;
          if ((surface->as_nodes.vertices[found->second] - place).norm() <=
              cell_) {
            return found->second;
          }
        }
      }
    }
    const int vertex = static_cast<int>(surface->as_nodes.vertices.size());
    surface->as_nodes.vertices.push_back(place);
    places_.emplace(key, vertex);
    return vertex;
  }

  std::string path_;
  tinygltf::Model model_;
  std::vector<int> parent_;
  std::vector<Matrix4d> scene_from_node_;
  std::vector<std::optional<Matrix4d>> scene_from_bound_;  // per node
  std::vector<std::vector<Matrix4d>> joint_from_mesh_;     // per skin and joint
  std::vector<Matrix4d> scene_from_mesh_;                  // per skin, bound
  double cell_ = 0;  // side of a cell of the grid for welding
  std::map<std::array<std::int64_t, 3>, int> places_;
};

}  // namespace

SkinnedSurface LoadSkinnedSurface(const std::string& path) {
  return GlbReader(path).Read();
}

}  // namespace sweepfit
