// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "model/body.h"

namespace sweepfit {

// A person as other programs write them: names of Mixamo, T pose, an armature
// in centimetres with Z up below a node that scales and turns it, bones whose
// frames point anywhere, more bones than ours (three of the spine, collars, a
// twist bone, fingers, toes), up to eight influences per vertex as normalised
// integers, every triangle with vertices of its own (flat normals, seams
// everywhere), two primitives with a material each and a material too many,
// holes in the eye sockets, and eyeballs in a mesh with a skin of its own.
struct ForeignRig {
  std::string prefix = "mixamorig:";
  // The nodes hold the person seated with bent elbows; the skin was bound in T
  // pose.
  bool bent_nodes = false;
  bool texture_coordinates = true;
  // Faces left out around so many vertices of the back: holes too large.
  bool open_back = false;

  // The .glb for this person, any body of quads or triangles.
  std::string Glb(const Body& person) const;
};

namespace foreign_rig {

using Eigen::Matrix4d;
using Eigen::Vector3d;

struct Bone {
  std::string name;
  int parent;  // -1: none
  Vector3d head, tail;
};

// Writes accessors one after the other.
class Buffer {
 public:
  template <typename T>
  int Add(const std::vector<T>& values,
          int component_type,
          const std::string& type,
          int width,
          bool normalized = false) {
    const std::size_t size = values.size() * sizeof(T);
    views_.push_back(
        {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", size}});
    nlohmann::json accessor = {{"bufferView", views_.size() - 1},
                               {"componentType", component_type},
                               {"count", values.size() / width},
                               {"type", type}};
    if (normalized) accessor["normalized"] = true;
    if (type == "VEC3") {
      std::vector<T> low(values.begin(), values.begin() + 3), high = low;
      for (std::size_t i = 0; i < values.size(); ++i) {
        low[i % 3] = std::min(low[i % 3], values[i]);
        high[i % 3] = std::max(high[i % 3], values[i]);
      }
      accessor["min"] = low;
      accessor["max"] = high;
    }
    accessors_.push_back(accessor);
    const std::size_t start = bytes_.size();
    bytes_.resize((start + size + 3) / 4 * 4);
    std::memcpy(bytes_.data() + start, values.data(), size);
    return static_cast<int>(accessors_.size()) - 1;
  }

  std::string File(nlohmann::json gltf) const {
    gltf["bufferViews"] = views_;
    gltf["accessors"] = accessors_;
    gltf["buffers"] = {{{"byteLength", bytes_.size()}}};
    std::string text = gltf.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string file = "glTF";
    const auto word = [&file](std::size_t value) {
      const auto number = static_cast<std::uint32_t>(value);
      file.append(reinterpret_cast<const char*>(&number), 4);
    };
    word(2);
    word(12 + 8 + text.size() + 8 + bytes_.size());
    word(text.size());
    file += "JSON" + text;
    word(bytes_.size());
    file.append("BIN\0", 4);
    return file + bytes_;
  }

 private:
  std::string bytes_;
  nlohmann::json views_ = nlohmann::json::array();
  nlohmann::json accessors_ = nlohmann::json::array();
};

// The pose in which arms and legs are straight, arms level.
inline Pose TPose(const Skeleton& skeleton) {
  Pose pose;
  std::array<Eigen::Quaterniond, kNumJoints> world;
  world.fill(Eigen::Quaterniond::Identity());
  for (const double side : {1.0, -1.0}) {
    const int shoulder = side > 0 ? kLShoulder : kRShoulder;
    for (int joint = shoulder; joint < shoulder + 3; ++joint) {
      world[joint] = Eigen::Quaterniond::FromTwoVectors(
          skeleton.rest_direction[joint + 1], Vector3d(side, 0, 0));
      pose.rotation[joint] =
          world[kJointParents[joint]].conjugate() * world[joint];
    }
  }
  return pose;
}

inline std::vector<Bone> Bones(const JointFrames& frames) {
  const auto& at = frames.joint_in_world;
  std::vector<Bone> bones;
  const auto add = [&bones](const std::string& name,
                            const std::string& parent,
                            const Vector3d& head,
                            const Vector3d& tail) {
    int above = -1;
    for (std::size_t b = 0; b < bones.size(); ++b) {
      if (bones[b].name == parent) above = static_cast<int>(b);
    }
    bones.push_back({name, above, head, tail});
  };
  const auto between = [](const Vector3d& a, const Vector3d& b, double t) {
    return Vector3d((1 - t) * a + t * b);
  };
  const Vector3d hips = at[kRoot] + Vector3d(0, 0.02, 0);
  const auto spine = [&](double t) { return between(hips, at[kNeck], t); };
  add("Hips", "", hips, spine(0.2));
  add("Spine", "Hips", spine(0.2), spine(0.45));
  add("Spine1", "Spine", spine(0.45), spine(0.7));
  add("Spine2", "Spine1", spine(0.7), at[kNeck]);
  add("Neck", "Spine2", at[kNeck], at[kHead]);
  add("Head", "Neck", at[kHead], at[kHeadEnd]);
  add("HeadTop_End", "Head", at[kHeadEnd], at[kHeadEnd] + Vector3d(0, 0.05, 0));
  for (const std::string side : {"Left", "Right"}) {
    const int arm = side == "Left" ? kLShoulder : kRShoulder;
    add(side + "Shoulder",
        "Spine2",
        between(at[kNeck], at[arm], 0.15),
        at[arm]);
    add(side + "Arm", side + "Shoulder", at[arm], at[arm + 1]);
    add(side + "ForeArm", side + "Arm", at[arm + 1], at[arm + 2]);
    const Vector3d& wrist = at[arm + 2];
    const Vector3d& tip = at[arm + 3];
    add(side + "ForeArmTwist",
        side + "ForeArm",
        between(at[arm + 1], wrist, 0.5),
        wrist);
    add(side + "Hand", side + "ForeArm", wrist, between(wrist, tip, 0.5));
    add(side + "HandMiddle1",
        side + "Hand",
        between(wrist, tip, 0.5),
        between(wrist, tip, 0.75));
    add(side + "HandMiddle2",
        side + "HandMiddle1",
        between(wrist, tip, 0.75),
        tip);
    const int leg = side == "Left" ? kLHip : kRHip;
    add(side + "UpLeg", "Hips", at[leg], at[leg + 1]);
    add(side + "Leg", side + "UpLeg", at[leg + 1], at[leg + 2]);
    Vector3d ball = between(at[leg + 2], at[leg + 3], 0.65);
    ball.y() = at[leg + 3].y() + 0.01;
    add(side + "Foot", side + "Leg", at[leg + 2], ball);
    add(side + "ToeBase", side + "Foot", ball, at[leg + 3]);
  }
  return bones;
}

// Bones that may move a part of the body.
inline bool MayMove(BodyPart part, const std::string& bone) {
  const auto has = [&bone](const char* text) {
    return bone.find(text) != std::string::npos;
  };
  const bool left = has("Left"), right = has("Right");
  switch (part) {
    case BodyPart::kHead:
      return has("Head") && !has("End");
    case BodyPart::kLArm:
    case BodyPart::kLHand:
      return has("Spine2") ||
             (left && (has("Arm") || has("Hand") || has("Shoulder")));
    case BodyPart::kRArm:
    case BodyPart::kRHand:
      return has("Spine2") ||
             (right && (has("Arm") || has("Hand") || has("Shoulder")));
    case BodyPart::kLLeg:
    case BodyPart::kLFoot:
      return has("Hips") || (left && (has("Leg") || has("Foot") || has("Toe")));
    case BodyPart::kRLeg:
    case BodyPart::kRFoot:
      return has("Hips") ||
             (right && (has("Leg") || has("Foot") || has("Toe")));
    default:
      return !has("Hand") && !has("ForeArm") && !has("Foot") && !has("Toe") &&
             !has("End") && !(bone == "LeftLeg" || bone == "RightLeg");
  }
}

// Eight bones by distance, (bone, weight).
inline std::vector<std::pair<int, double>> Weights(
    const std::vector<Bone>& bones, BodyPart part, const Vector3d& point) {
  std::vector<std::pair<int, double>> all;
  for (std::size_t b = 0; b < bones.size(); ++b) {
    if (!MayMove(part, bones[b].name)) continue;
    const Vector3d along = bones[b].tail - bones[b].head;
    const double t = std::clamp(
        along.dot(point - bones[b].head) / along.squaredNorm(), 0.0, 1.0);
    const double distance = (point - bones[b].head - t * along).norm();
    all.emplace_back(static_cast<int>(b), std::pow(distance + 0.005, -6));
  }
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
    return a.second > b.second;
  });
  if (all.size() > 8) all.resize(8);
  double sum = 0;
  for (const auto& [bone, weight] : all) sum += weight;
  for (auto& [bone, weight] : all) weight /= sum;
  return all;
}

}  // namespace foreign_rig

inline std::string ForeignRig::Glb(const Body& person) const {
  using namespace foreign_rig;
  const Pose pose = TPose(person.skeleton);
  const std::vector<Vector3d> vertices = PoseVertices(person, pose);
  const std::vector<Bone> bones =
      Bones(ForwardKinematics(person.skeleton, pose));
  const int num_bones = static_cast<int>(bones.size());

  // The armature's frame: centimetres, Z up.
  Matrix4d scene_from_armature = Matrix4d::Identity();
  scene_from_armature.topLeftCorner<3, 3>() =
      0.01 * Eigen::AngleAxisd(-std::numbers::pi / 2, Vector3d::UnitX())
                 .toRotationMatrix();
  const Matrix4d armature_from_scene = scene_from_armature.inverse();
  const auto to_armature = [&](const Vector3d& point) {
    return Vector3d((armature_from_scene * point.homogeneous()).head<3>());
  };
  std::vector<Matrix4d> armature_from_bone;
  for (const Bone& bone : bones) {
    const Vector3d y =
        (to_armature(bone.tail) - to_armature(bone.head)).normalized();
    const Vector3d x = y.cross(Vector3d(0.3, 0.2, 0.9)).normalized();
    Matrix4d frame = Matrix4d::Identity();
    frame.col(0).head<3>() = x;
    frame.col(1).head<3>() = y;
    frame.col(2).head<3>() = x.cross(y);
    frame.col(3).head<3>() = to_armature(bone.head);
    armature_from_bone.push_back(frame);
  }

  using Json = nlohmann::json;
  Json nodes = Json::array();
  nodes.push_back({{"name", "Armature"},
                   {"scale", {0.01, 0.01, 0.01}},
                   {"rotation", {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)}}});
  std::vector<std::vector<int>> children(num_bones + 1);
  std::vector<float> inverse;
  Json skin_joints = Json::array();
  int head = 0;
  for (int b = 0; b < num_bones; ++b) {
    const Bone& bone = bones[b];
    if (bone.name == "Head") head = b;
    Matrix4d local = armature_from_bone[b];
    if (bone.parent >= 0) {
      local = armature_from_bone[bone.parent].inverse() * local;
    }
    if (bent_nodes) {
      // About the armature's X: the person's left.
      const double degrees = bone.name.ends_with("UpLeg")  ? -80
                             : bone.name.ends_with("tLeg") ? 85
                             : bone.name.ends_with("eArm") ? -60
                                                           : 0;
      const Vector3d axis =
          armature_from_bone[b].topLeftCorner<3, 3>().transpose() *
          Vector3d::UnitX();
      const Vector3d about =
          bone.name.ends_with("eArm") ? Vector3d::UnitZ() : axis;
      Matrix4d turn = Matrix4d::Identity();
      turn.topLeftCorner<3, 3>() =
          Eigen::AngleAxisd(degrees * std::numbers::pi / 180, about)
              .toRotationMatrix();
      local = local * turn;
    }
    Json matrix = Json::array();
    for (int i = 0; i < 16; ++i) matrix.push_back(local(i % 4, i / 4));
    nodes.push_back({{"name", prefix + bone.name}, {"matrix", matrix}});
    children[bone.parent + 1].push_back(b + 1);
    const Matrix4d bone_from_mesh = armature_from_bone[b].inverse();
    for (int i = 0; i < 16; ++i) {
      inverse.push_back(static_cast<float>(bone_from_mesh(i % 4, i / 4)));
    }
    skin_joints.push_back(b + 1);
  }

  // Eye sockets: faces around the foremost vertex of either side of the face.
  std::array<int, 2> socket = {-1, -1};
  std::vector<bool> back(vertices.size(), false);
  const double head_height = bones[head].head.y();
  for (int v = 0; v < person.num_vertices(); ++v) {
    const Vector3d& p = vertices[v];
    if (open_back && person.topology.part[v] == BodyPart::kTrunk &&
        p.z() < -0.03) {
      back[v] = true;
    }
    if (person.topology.part[v] != BodyPart::kHead) continue;
    if (std::abs(p.x()) < 0.02 || p.y() < head_height + 0.08) continue;
    int& best = socket[p.x() > 0 ? 0 : 1];
    if (best < 0 || p.z() > vertices[best].z()) best = v;
  }

  Buffer buffer;
  struct Corners {
    std::vector<float> position, normal, uv;
    std::array<std::vector<std::uint16_t>, 2> joint, weight;
  };
  const auto add_triangle = [&](const std::array<Vector3d, 3>& points,
                                const std::array<Eigen::Vector2f, 3>& uv,
                                const auto& weights_of,
                                Corners* out) {
    const Vector3d normal =
        (points[1] - points[0]).cross(points[2] - points[0]).normalized();
    for (int k = 0; k < 3; ++k) {
      const Vector3d place = to_armature(points[k]);
      const std::vector<std::pair<int, double>> weights = weights_of(k);
      for (int i = 0; i < 3; ++i) {
        out->position.push_back(static_cast<float>(place[i]));
        out->normal.push_back(static_cast<float>(normal[i]));
      }
      out->uv.push_back(uv[k].x());
      out->uv.push_back(1 - uv[k].y());
      for (std::size_t i = 0; i < 8; ++i) {
        const bool used = i < weights.size() && weights[i].second > 1e-4;
        out->joint[i / 4].push_back(
            static_cast<std::uint16_t>(used ? weights[i].first : 0));
        out->weight[i / 4].push_back(static_cast<std::uint16_t>(
            used ? std::lround(65535 * weights[i].second) : 0));
      }
    }
  };
  const auto primitive = [&](const Corners& corners, int material) {
    constexpr int kFloat = 5126, kShort = 5123;
    Json attributes = {
        {"POSITION", buffer.Add(corners.position, kFloat, "VEC3", 3)},
        {"NORMAL", buffer.Add(corners.normal, kFloat, "VEC3", 3)}};
    if (texture_coordinates) {
      attributes["TEXCOORD_0"] = buffer.Add(corners.uv, kFloat, "VEC2", 2);
    }
    for (int set = 0; set < 2; ++set) {
      const std::string suffix = "_" + std::to_string(set);
      attributes["JOINTS" + suffix] =
          buffer.Add(corners.joint[set], kShort, "VEC4", 4);
      attributes["WEIGHTS" + suffix] =
          buffer.Add(corners.weight[set], kShort, "VEC4", 4, true);
    }
    return Json{{"attributes", attributes}, {"material", material}};
  };

  std::vector<std::vector<std::pair<int, double>>> weights;
  for (int v = 0; v < person.num_vertices(); ++v) {
    weights.push_back(Weights(bones, person.topology.part[v], vertices[v]));
  }
  std::array<Corners, 2> body;  // head, all else
  for (std::size_t q = 0; q < person.topology.quads.size(); ++q) {
    const Quad& quad = person.topology.quads[q];
    const auto& uv = person.topology.uv[q];
    bool left_out = false;
    int of_head = 0;
    for (const int v : quad) {
      left_out = left_out || v == socket[0] || v == socket[1] || back[v];
      of_head += person.topology.part[v] == BodyPart::kHead;
    }
    if (left_out) continue;
    for (const std::array<int, 3> k : {std::array{0, 1, 2}, {0, 2, 3}}) {
      if (quad[k[1]] == quad[k[2]]) continue;
      add_triangle(
          {vertices[quad[k[0]]], vertices[quad[k[1]]], vertices[quad[k[2]]]},
          {uv[k[0]], uv[k[1]], uv[k[2]]},
          [&](int i) { return weights[quad[k[i]]]; },
          &body[of_head == 4 ? 0 : 1]);
    }
  }
  Corners eyes;
  for (const int v : socket) {
    constexpr double kRadius = 0.01;
    for (int face = 0; face < 8; ++face) {
      std::array<Vector3d, 3> points;
      const std::array<double, 3> sign = {
          face & 1 ? -1.0 : 1.0, face & 2 ? -1.0 : 1.0, face & 4 ? -1.0 : 1.0};
      const bool even = sign[0] * sign[1] * sign[2] > 0;
      for (int i = 0; i < 3; ++i) {
        const int axis = even ? i : 2 - i;
        points[i] = vertices[v] - Vector3d(0, 0, 0.012) +
                    kRadius * sign[axis] * Vector3d::Unit(axis);
      }
      add_triangle(
          points,
          {Eigen::Vector2f(0, 0), {0.1f, 0}, {0, 0.1f}},
          [](int) {
            return std::vector<std::pair<int, double>>{{0, 1.0}};
          },
          &eyes);
    }
  }
  const std::vector<float> inverse_of_head(inverse.begin() + 16 * head,
                                           inverse.begin() + 16 * head + 16);
  Json skins = {
      {{"joints", skin_joints},
       {"inverseBindMatrices", buffer.Add(inverse, 5126, "MAT4", 16)}},
      {{"joints", {head + 1}},
       {"inverseBindMatrices", buffer.Add(inverse_of_head, 5126, "MAT4", 16)}}};
  Json meshes = {
      {{"name", "Body"},
       {"primitives", {primitive(body[0], 0), primitive(body[1], 1)}}},
      {{"name", "Eyes"}, {"primitives", {primitive(eyes, 0)}}}};
  for (int mesh = 0; mesh < 2; ++mesh) {
    children[0].push_back(static_cast<int>(nodes.size()));
    nodes.push_back({{"name", mesh == 0 ? "Hips" : "Eyes"},  // of no account
                     {"mesh", mesh},
                     {"skin", mesh}});
  }
  for (int n = 0; n <= num_bones; ++n) {
    if (!children[n].empty()) nodes[n]["children"] = children[n];
  }
  return buffer.File(
      {{"asset", {{"version", "2.0"}}},
       {"scene", 0},
       {"scenes", {{{"nodes", {0}}}}},
       {"nodes", nodes},
       {"meshes", meshes},
       {"skins", skins},
       {"materials",
        {{{"name", "Face"}}, {{"name", "Skin"}}, {{"name", "Unused"}}}}});
}

}  // namespace sweepfit
