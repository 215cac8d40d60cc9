// SPDX-License-Identifier: Apache-2.0
#include "model/template_import.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nanoflann.hpp>
#include <numbers>

#include "model/glb_surface.h"
#include "model/input_error.h"
#include "model/joint_names.h"
#include "model/skeleton.h"
#include "model/surface_repair.h"
#include "model/sweep.h"
#include "model/template.h"
#include "model/texture_atlas.h"

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;

using SweepWeights = std::vector<std::vector<std::pair<int, double>>>;

// Points as nanoflann wants them.
struct Cloud {
  const std::vector<Vector3d>& points;

  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<Eigen::Index>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

// The person in the making.
class Importer {
 public:
  Importer(const std::string& path, const std::string& names)
      : path_(path), surface_(LoadSkinnedSurface(path)) {
    match_ = MatchJointNames(NamesOfSkeleton(), names, path);
    TakePosture();
    TurnUpright();
    const std::string fault = RepairSurface(&surface_, &vertices_, &notes_);
    if (!fault.empty()) Fail(fault);
    ScaleToMetres();
    AssignNodes();
    PlaceJoints();
  }

  const std::vector<std::string>& notes() const { return notes_; }

  Body Make() {
    Body body;
    MakeTopology(&body);
    body.skeleton = SkeletonOf(joints_);
    double lowest = 0, highest = 0;
    for (const Vector3d& vertex : vertices_) {
      lowest = std::min(lowest, vertex.y());
      highest = std::max(highest, vertex.y());
    }
    body.stature = highest - lowest;
    constexpr double kDensity = 1000;  // kg per cubic metre
    body.mass = kDensity * EnclosedVolume({vertices_, surface_.triangles});
    TemplateOptions options;
    options.stature = std::clamp(body.stature, 0.6, 2.5);
    const Body pattern = BuildTemplate(options);
    Bind(vertices_, pattern, &body);
    if (HeldOtherwise(body.skeleton, pattern.skeleton)) {
      TakeRestPose(pattern, &body);
    }
    return body;
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw InputError(path_ + ": " + what);
  }

  const std::string& NameOf(int joint) const {
    return surface_.node_name[match_.index[joint]];
  }

  // -------------------------------------------------------------- surface

  // Names of joints and of what stands above or below them; those of other
  // nodes, such as meshes, are of no account.
  std::vector<std::string> NamesOfSkeleton() const {
    const std::size_t num = surface_.node_name.size();
    std::vector<bool> of_skeleton = surface_.is_joint;
    for (std::size_t n = 0; n < num; ++n) {
      bool below = false;
      for (int at = static_cast<int>(n); at >= 0;
           at = surface_.node_parent[at]) {
        below = below || surface_.is_joint[at];
        if (surface_.is_joint[n]) of_skeleton[at] = true;
      }
      if (below) of_skeleton[n] = true;
    }
    std::vector<std::string> names = surface_.node_name;
    for (std::size_t n = 0; n < num; ++n) {
      if (!of_skeleton[n]) names[n].clear();
    }
    return names;
  }

  // How far elbows, knees and trunk are bent, radians.
  double BendOf(const std::vector<Vector3d>& nodes) const {
    const auto at = [&](int joint) { return nodes[match_.index[joint]]; };
    const auto angle = [](const Vector3d& a, const Vector3d& b) {
      return std::atan2(a.cross(b).norm(), a.dot(b));
    };
    double bend = 0;
    for (const int first : {kLShoulder, kRShoulder, kLHip, kRHip}) {
      bend += angle(at(first + 1) - at(first), at(first + 2) - at(first + 1));
    }
    const Vector3d trunk = at(kNeck) - (at(kLHip) + at(kRHip)) / 2;
    for (const int hip : {kLHip, kRHip}) {
      bend += angle(trunk, at(hip) - at(hip + 1));
    }
    return bend;
  }

  void TakePosture() {
    constexpr double kClearly = 20 * std::numbers::pi / 180;
    const bool bound = BendOf(surface_.as_bound.nodes) + kClearly <
                       BendOf(surface_.as_nodes.nodes);
    if (bound) {
      notes_.push_back(
          "the nodes hold the person bent: taken as the skin was bound");
    }
    const SkinnedSurface::Posture& posture =
        bound ? surface_.as_bound : surface_.as_nodes;
    vertices_ = posture.vertices;
    nodes_ = posture.nodes;
  }

  // Along +Y, facing +Z, the middle between the hips at the origin.
  void TurnUpright() {
    const auto at = [this](int joint) -> const Vector3d& {
      return nodes_[match_.index[joint]];
    };
    const auto turn = [&](const Vector3d& from, const Vector3d& to) {
      // Half a turn could be about any axis across.
      const Matrix3d rotation =
          from.normalized().dot(to) < -0.999
              ? Eigen::AngleAxisd(
                    std::numbers::pi,
                    to.y() > 0 ? Vector3d::UnitX() : Vector3d::UnitY())
                    .toRotationMatrix()
              : Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
      for (Vector3d& vertex : vertices_) vertex = rotation * vertex;
      for (Vector3d& node : nodes_) node = rotation * node;
    };
    const Vector3d hips = (at(kLHip) + at(kRHip)) / 2;
    for (Vector3d& vertex : vertices_) vertex -= hips;
    for (Vector3d& node : nodes_) node -= hips;
    const Vector3d up = at(kNeck);
    int axis = 0;
    const double along = up.cwiseAbs().maxCoeff(&axis);
    if (!(along > 0.8 * up.norm())) {
      Fail("the person must stand upright along an axis: '" + NameOf(kNeck) +
           "' is not above the hips");
    }
    turn(std::copysign(1.0, up[axis]) * Vector3d::Unit(axis),
         Vector3d::UnitY());
    if (axis != 1 || up.y() < 0) {
      notes_.push_back(std::string("the person stood along ") +
                       (up[axis] < 0 ? "-" : "+") + "XYZ"[axis]);
    }
    Vector3d left = at(kLHip) - at(kRHip);
    left.y() = 0;
    if (!(left.norm() > 1e-3 * up.norm())) {
      Fail("'" + NameOf(kLHip) + "' and '" + NameOf(kRHip) +
           "' are at the same place");
    }
    turn(left, Vector3d::UnitX());
  }

  // The whole height counts; what units a file has does not matter much,
  // because a fit sets the stature.
  void ScaleToMetres() {
    Eigen::AlignedBox3d box;
    for (const Vector3d& vertex : vertices_) box.extend(vertex);
    const double height = box.sizes().y();
    double scale = 0;
    for (const double unit : {1.0, 0.01, 0.001}) {
      if (unit * height >= 0.6 && unit * height <= 2.5) scale = unit;
    }
    if (scale == 0) {
      constexpr double kStature = 1.70;
      scale = kStature / height;
      char text[80];
      std::snprintf(text,
                    sizeof(text),
                    "the person is %.3g units tall: scaled to %.2f m",
                    height,
                    kStature);
      notes_.push_back(text);
    }
    for (Vector3d& vertex : vertices_) vertex *= scale;
    for (Vector3d& node : nodes_) node *= scale;
  }

  // --------------------------------------------------------------- joints

  // The joint of ours that carries each node: itself or the nearest above.
  void AssignNodes() {
    const int num = static_cast<int>(surface_.node_name.size());
    joint_of_node_.assign(num, kRoot);
    for (int node = 0; node < num; ++node) {
      for (int at = node; at >= 0; at = surface_.node_parent[at]) {
        const auto found =
            std::find(match_.index.begin(), match_.index.end(), at);
        if (found == match_.index.end()) continue;
        joint_of_node_[node] = static_cast<int>(found - match_.index.begin());
        break;
      }
    }
    for (int joint = 1; joint < kNumJoints; ++joint) {
      if (match_.index[joint] < 0) continue;
      int above = kJointParents[joint];
      if (joint == kLShoulder || joint == kRShoulder ||
          match_.index[above] < 0) {
        above = kRoot;
      }
      int at = surface_.node_parent[match_.index[joint]];
      while (at >= 0 && at != match_.index[above]) {
        at = surface_.node_parent[at];
      }
      if (at < 0) {
        Fail("'" + NameOf(joint) + "', mapped to " +
             std::string(kJointNames[joint]) + ", does not hang on '" +
             NameOf(above) + "', mapped to " + std::string(kJointNames[above]));
      }
    }
    // The heaviest joint of each vertex.
    for (const auto& weights : surface_.weights) {
      std::array<double, kNumJoints> of_joint{};
      for (const auto& [node, weight] : weights) {
        of_joint[joint_of_node_[node]] += weight;
      }
      weight_of_joint_.push_back(of_joint);
      main_joint_.push_back(
          static_cast<int>(std::max_element(of_joint.begin(), of_joint.end()) -
                           of_joint.begin()));
    }
  }

  // The furthest that the vertices of a joint and its end reach in a direction
  // from the joint, and the mean of those that nearly reach as far.
  Vector3d TipOf(int joint, const Vector3d& direction) const {
    const Vector3d& start = joints_[joint];
    double furthest = 0;
    for (std::size_t v = 0; v < main_joint_.size(); ++v) {
      if (!Carries(joint, v)) continue;
      furthest = std::max(furthest, direction.dot(vertices_[v] - start));
    }
    Vector3d mean = Vector3d::Zero();
    int count = 0;
    for (std::size_t v = 0; v < main_joint_.size(); ++v) {
      if (!Carries(joint, v)) continue;
      if (direction.dot(vertices_[v] - start) < 0.95 * furthest) {
        continue;
      }
      mean += vertices_[v] - start;
      ++count;
    }
    if (count == 0) {
      Fail("no vertex follows '" + NameOf(joint) + "', mapped to " +
           std::string(kJointNames[joint]));
    }
    mean /= count;
    return start + mean + (furthest - direction.dot(mean)) * direction;
  }

  bool Carries(int joint, std::size_t vertex) const {
    return main_joint_[vertex] == joint || main_joint_[vertex] == joint + 1;
  }

  Vector3d MeanOf(int joint) const {
    Vector3d mean = Vector3d::Zero();
    int count = 0;
    for (std::size_t v = 0; v < main_joint_.size(); ++v) {
      if (!Carries(joint, v)) continue;
      mean += vertices_[v];
      ++count;
    }
    return count > 0 ? Vector3d(mean / count) : joints_[joint];
  }

  void PlaceJoints() {
    joints_.fill(Vector3d::Zero());
    for (int joint = 1; joint < kNumJoints; ++joint) {
      if (match_.index[joint] >= 0) {
        joints_[joint] = nodes_[match_.index[joint]];
      }
    }
    // Rigs put their root anywhere near; ours lies between the hips.
    joints_[kRoot].setZero();
    const double trunk = joints_[kNeck].norm();
    constexpr double kSpineShare = 0.28;  // of the way to the neck
    if (match_.index[kSpine] < 0 || joints_[kSpine].norm() < 0.1 * trunk ||
        joints_[kSpine].norm() > 0.8 * trunk) {
      joints_[kSpine] = kSpineShare * joints_[kNeck];
    }
    // Our own skeleton says where its bones end; others end where the next
    // joint is, or nowhere.
    if (match_.map != "sweepfit" || match_.index[kHeadEnd] < 0) {
      joints_[kHeadEnd] = TipOf(kHead, Vector3d::UnitY());
      joints_[kHeadEnd].x() = joints_[kHead].x();
      joints_[kHeadEnd].z() = joints_[kHead].z();
    }
    for (const int wrist : {kLWrist, kRWrist}) {
      const int end = wrist + 1;
      if (match_.map == "sweepfit" && match_.index[end] >= 0) continue;
      const Vector3d towards =
          match_.index[end] >= 0 ? joints_[end] : MeanOf(wrist);
      const Vector3d along = (towards - joints_[wrist]).normalized();
      const Vector3d tip = TipOf(wrist, along);
      joints_[end] = joints_[wrist] + along.dot(tip - joints_[wrist]) * along;
    }
    for (const int ankle : {kLAnkle, kRAnkle}) {
      const int end = ankle + 1;
      if (match_.map == "sweepfit" && match_.index[end] >= 0) continue;
      Vector3d along = (match_.index[end] >= 0 ? joints_[end] : MeanOf(ankle)) -
                       joints_[ankle];
      along.y() = 0;
      if (along.norm() < 1e-6) along = Vector3d::UnitZ();
      joints_[end] = TipOf(ankle, along.normalized());
    }
    for (const int ankle : {kLAnkle, kRAnkle}) {
      const Vector3d foot = joints_[ankle + 1] - joints_[ankle];
      if (foot.z() < -0.3 * foot.norm()) {
        Fail("the foot of '" + NameOf(ankle) +
             "' points backwards: are left and right exchanged?");
      }
    }
    for (int joint = 1; joint < kNumJoints; ++joint) {
      const double length =
          (joints_[joint] - joints_[kJointParents[joint]]).norm();
      constexpr double kShortest = 0.005;  // metres
      if (!(length > kShortest)) {
        Fail("the bone from " + std::string(kJointNames[kJointParents[joint]]) +
             " to " + std::string(kJointNames[joint]) + " has no length");
      }
    }
  }

  static Skeleton SkeletonOf(const std::array<Vector3d, kNumJoints>& joints) {
    Skeleton skeleton;
    skeleton.rest_direction[kRoot] = Vector3d::UnitY();
    skeleton.length[kRoot] = 0;
    for (int joint = 1; joint < kNumJoints; ++joint) {
      const Vector3d bone = joints[joint] - joints[kJointParents[joint]];
      skeleton.length[joint] = bone.norm();
      skeleton.rest_direction[joint] = bone.normalized();
    }
    return skeleton;
  }

  // ------------------------------------------------------------- topology

  static BodyPart PartOf(int joint) {
    switch (joint) {
      case kHead:
      case kHeadEnd:
        return BodyPart::kHead;
      case kLShoulder:
      case kLElbow:
        return BodyPart::kLArm;
      case kLWrist:
      case kLHandEnd:
        return BodyPart::kLHand;
      case kRShoulder:
      case kRElbow:
        return BodyPart::kRArm;
      case kRWrist:
      case kRHandEnd:
        return BodyPart::kRHand;
      case kLHip:
      case kLKnee:
        return BodyPart::kLLeg;
      case kLAnkle:
      case kLFootEnd:
        return BodyPart::kLFoot;
      case kRHip:
      case kRKnee:
        return BodyPart::kRLeg;
      case kRAnkle:
      case kRFootEnd:
        return BodyPart::kRFoot;
      default:
        return BodyPart::kTrunk;
    }
  }

  void MakeTopology(Body* body) {
    BodyTopology& topology = body->topology;
    for (const int joint : main_joint_) topology.part.push_back(PartOf(joint));
    std::vector<int> group;
    for (const Triangle& triangle : surface_.triangles) {
      group.push_back(static_cast<int>(topology.part[triangle[0]]));
    }
    const std::string note = FitTextureAtlas({vertices_, surface_.triangles},
                                             surface_.material,
                                             group,
                                             &surface_.uv);
    if (!note.empty()) notes_.push_back(note);
    for (std::size_t t = 0; t < surface_.triangles.size(); ++t) {
      const Triangle& triangle = surface_.triangles[t];
      const auto& uv = surface_.uv[t];
      topology.quads.push_back(
          {triangle[0], triangle[1], triangle[2], triangle[2]});
      topology.uv.push_back({uv[0], uv[1], uv[2], uv[2]});
    }
    FindMirror(&topology);
  }

  // The vertex nearest to each one's mirror image, where they are each other's;
  // else itself.
  void FindMirror(BodyTopology* topology) const {
    const Cloud cloud{vertices_};
    using Tree = nanoflann::KDTreeSingleIndexAdaptor<
        nanoflann::L2_Simple_Adaptor<double, Cloud>,
        Cloud,
        3,
        std::size_t>;
    Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams());
    tree.buildIndex();
    const int num = static_cast<int>(vertices_.size());
    std::vector<int> nearest(num);
    constexpr double kTolerance = 0.005;  // metres
    for (int v = 0; v < num; ++v) {
      const Vector3d image = vertices_[v].cwiseProduct(Vector3d(-1, 1, 1));
      std::size_t found = 0;
      double distance = 0;
      tree.knnSearch(image.data(), 1, &found, &distance);
      nearest[v] =
          distance < kTolerance * kTolerance ? static_cast<int>(found) : v;
    }
    for (int v = 0; v < num; ++v) {
      topology->mirror_vertex.push_back(nearest[nearest[v]] == v ? nearest[v]
                                                                 : v);
    }
  }

  // ---------------------------------------------------- sections, binding

  // The sweep that has the joint in its chain, the bones of which start there.
  static int SweepOf(const std::vector<Sweep>& sweeps, int joint) {
    for (std::size_t s = 0; s < sweeps.size(); ++s) {
      const std::vector<int>& chain = sweeps[s].chain;
      const auto found = std::find(chain.begin(), chain.end(), joint);
      if (found != chain.end() && found + 1 != chain.end()) {
        return static_cast<int>(s);
      }
    }
    // Ends of bones.
    return SweepOf(sweeps, kJointParents[joint]);
  }

  // Sweeps and binding of the body for these vertices at rest.
  void Bind(const std::vector<Vector3d>& vertices,
            const Body& pattern,
            Body* body) const {
    body->sweeps = pattern.sweeps;
    for (const Sweep& sweep : body->sweeps) CheckReference(sweep, *body);
    SweepWeights weights(vertices.size());
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      std::vector<double> of_sweep(body->sweeps.size(), 0.0);
      for (int joint = 0; joint < kNumJoints; ++joint) {
        if (weight_of_joint_[v][joint] > 0) {
          of_sweep[SweepOf(body->sweeps, joint)] += weight_of_joint_[v][joint];
        }
      }
      constexpr double kNegligible = 1e-3;
      for (std::size_t s = 0; s < of_sweep.size(); ++s) {
        if (of_sweep[s] > kNegligible) {
          weights[v].emplace_back(static_cast<int>(s), of_sweep[s]);
        }
      }
      std::stable_sort(
          weights[v].begin(),
          weights[v].end(),
          [](const auto& a, const auto& b) { return a.second > b.second; });
      if (weights[v].size() > 3) weights[v].resize(3);
    }
    for (std::size_t s = 0; s < body->sweeps.size(); ++s) {
      Measure(vertices, weights, static_cast<int>(s), body);
    }
    BindVertices(vertices, weights, body);
  }

  void CheckReference(const Sweep& sweep, const Body& body) const {
    const int joint = sweep.chain[1];
    const Vector3d& along = body.skeleton.rest_direction[joint];
    if (along.cross(sweep.rest_reference).norm() < 0.1) {
      Fail("at rest the bone to " + std::string(kJointNames[joint]) +
           (sweep.rest_reference.y() != 0 ? " points up or down"
                                          : " points to the front or back"));
    }
  }

  using Segment = std::pair<Vector2d, Vector2d>;

  // Where the part of the surface that mostly follows a sweep meets a plane; in
  // coordinates (e1, e2) from its origin.
  static std::vector<Segment> Cut(const std::vector<Vector3d>& vertices,
                                  const std::vector<Triangle>& part,
                                  const SectionFrame& frame) {
    std::vector<Segment> segments;
    for (const Triangle& triangle : part) {
      std::array<Vector3d, 3> p;
      for (int i = 0; i < 3; ++i) {
        p[i] = frame.world_from_section.transpose() *
               (vertices[triangle[i]] - frame.center_in_world);
      }
      std::vector<Vector2d> crossings;
      for (int i = 0; i < 3; ++i) {
        const Vector3d& a = p[i];
        const Vector3d& b = p[(i + 1) % 3];
        if ((a.z() < 0) == (b.z() < 0)) continue;
        const double t = a.z() / (a.z() - b.z());
        crossings.push_back(((1 - t) * a + t * b).head<2>());
      }
      if (crossings.size() == 2)
        segments.emplace_back(crossings[0], crossings[1]);
    }
    return segments;
  }

  // The furthest hit of a ray from a centre, 0 for none.
  static double FurthestHit(const std::vector<Segment>& segments,
                            const Vector2d& center,
                            const Vector2d& direction) {
    double furthest = 0;
    const Vector2d across(-direction.y(), direction.x());
    for (const auto& [a, b] : segments) {
      const double sa = across.dot(a - center), sb = across.dot(b - center);
      if ((sa < 0) == (sb < 0)) continue;
      const double t = sa / (sa - sb);
      furthest =
          std::max(furthest, direction.dot((1 - t) * a + t * b - center));
    }
    return furthest;
  }

  // Fills what no ray hit from the neighbours around the section. False when
  // too little was hit.
  static bool FillGaps(std::vector<double>* radii) {
    const int num = static_cast<int>(radii->size());
    const int hits = static_cast<int>(std::count_if(
        radii->begin(), radii->end(), [](double r) { return r > 0; }));
    if (3 * hits < num) return false;
    const std::vector<double> seen = *radii;
    for (int k = 0; k < num; ++k) {
      if (seen[k] > 0) continue;
      int before = 1, after = 1;
      while (seen[(k - before + num) % num] <= 0) ++before;
      while (seen[(k + after) % num] <= 0) ++after;
      (*radii)[k] = (after * seen[(k - before + num) % num] +
                     before * seen[(k + after) % num]) /
                    (before + after);
    }
    return true;
  }

  static Vector2d CentroidOf(const std::vector<double>& radii) {
    Vector2d sum = Vector2d::Zero();
    double area = 0;
    const int num = static_cast<int>(radii.size());
    const auto point = [&](int k) {
      const double theta = 2 * std::numbers::pi * (k % num) / num;
      return Vector2d(radii[k % num] *
                      Vector2d(std::cos(theta), std::sin(theta)));
    };
    for (int k = 0; k < num; ++k) {
      const Vector2d a = point(k), b = point(k + 1);
      const double twice = a.x() * b.y() - a.y() * b.x();
      area += twice;
      sum += twice * (a + b) / 3;
    }
    return area > 0 ? Vector2d(sum / area) : Vector2d(Vector2d::Zero());
  }

  // Replaces the sections of a sweep by those of the surface; the corners of
  // its axis depend on the radii, so twice.
  static void Measure(const std::vector<Vector3d>& vertices,
                      const SweepWeights& weights,
                      int index,
                      Body* body) {
    Sweep& sweep = body->sweeps[index];
    std::vector<bool> mostly(vertices.size());
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      mostly[v] = !weights[v].empty() && weights[v][0].first == index;
    }
    std::vector<Triangle> part;
    for (const Quad& quad : body->topology.quads) {
      if (mostly[quad[0]] + mostly[quad[1]] + mostly[quad[2]] >= 2) {
        part.push_back({quad[0], quad[1], quad[2]});
      }
    }
    const Sweep pattern = sweep;
    const JointFrames frames = RestFrames(body->skeleton);
    constexpr double kThinnest = 0.003;  // metres
    for (int round = 0; round < 2; ++round) {
      Sweep on_axis = sweep;
      on_axis.center_offset.setZero();
      const SweepAxis axis(on_axis, body->skeleton, frames);
      for (int row = 0; row < sweep.num_rows(); ++row) {
        const std::vector<Segment> segments =
            Cut(vertices, part, axis.At(sweep.key_u[row]));
        Vector2d center = pattern.center_offset.col(row);
        std::vector<double> radii(sweep.num_columns());
        bool seen = false;
        for (int step = 0; step < 4; ++step) {
          for (int k = 0; k < sweep.num_columns(); ++k) {
            const double theta = 2 * std::numbers::pi * k / sweep.num_columns();
            radii[k] = FurthestHit(
                segments, center, {std::cos(theta), std::sin(theta)});
          }
          seen = FillGaps(&radii);
          if (!seen || step == 3) break;
          center += CentroidOf(radii);
        }
        if (!seen) {
          center = pattern.center_offset.col(row);
          for (int k = 0; k < sweep.num_columns(); ++k) {
            radii[k] = pattern.radius(row, k);
          }
        }
        sweep.center_offset.col(row) = center;
        for (int k = 0; k < sweep.num_columns(); ++k) {
          sweep.radius(row, k) = std::max(radii[k], kThinnest);
        }
      }
    }
  }

  // ------------------------------------------------------------ rest pose

  static bool IsLimb(int joint) {
    return joint == kLElbow || joint == kLWrist || joint == kLHandEnd ||
           joint == kLKnee || joint == kLAnkle || joint == kRElbow ||
           joint == kRWrist || joint == kRHandEnd || joint == kRKnee ||
           joint == kRAnkle;
  }

  static bool HeldOtherwise(const Skeleton& ours, const Skeleton& pattern) {
    constexpr double kClose = 15 * std::numbers::pi / 180;
    for (int joint = 1; joint < kNumJoints; ++joint) {
      if (IsLimb(joint) &&
          ours.rest_direction[joint].dot(pattern.rest_direction[joint]) <
              std::cos(kClose)) {
        return true;
      }
    }
    return false;
  }

  // Swings the limbs to where the pattern's are, by the sweeps, and makes that
  // the rest pose. Feet keep their direction.
  void TakeRestPose(const Body& pattern, Body* body) const {
    const Skeleton& skeleton = body->skeleton;
    Pose pose;
    std::array<Quaterniond, kNumJoints> world_from_joint;
    world_from_joint.fill(Quaterniond::Identity());
    for (int joint = 1; joint < kNumJoints; ++joint) {
      const int child = joint + 1;
      if (child < kNumJoints && kJointParents[child] == joint &&
          IsLimb(child)) {
        world_from_joint[joint] =
            Quaterniond::FromTwoVectors(skeleton.rest_direction[child],
                                        pattern.skeleton.rest_direction[child]);
      }
      pose.rotation[joint] =
          world_from_joint[kJointParents[joint]].conjugate() *
          world_from_joint[joint];
    }
    // Ends follow what carries them.
    const std::vector<Vector3d> vertices = PoseVertices(*body, pose);
    const JointFrames frames = ForwardKinematics(skeleton, pose);
    body->skeleton = SkeletonOf(frames.joint_in_world);
    Bind(vertices, pattern, body);
  }

  std::string path_;
  SkinnedSurface surface_;
  std::vector<Vector3d> vertices_;  // in the posture that was taken
  std::vector<Vector3d> nodes_;
  std::vector<std::string> notes_;
  JointMatch match_;
  std::vector<int> joint_of_node_;
  std::vector<std::array<double, kNumJoints>> weight_of_joint_;  // per vertex
  std::vector<int> main_joint_;                                  // per vertex
  std::array<Vector3d, kNumJoints> joints_;
};

}  // namespace

Body ImportTemplate(const std::string& path,
                    const std::string& names,
                    Progress* progress) {
  Importer importer(path, names);
  Body body = importer.Make();
  if (progress != nullptr) {
    for (const std::string& note : importer.notes()) {
      progress->Warning(path + ": " + note);
    }
  }
  return body;
}

}  // namespace sweepfit
