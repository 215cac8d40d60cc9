// SPDX-License-Identifier: Apache-2.0
#include "experiments/portraits.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "capture/render.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// Grey of a surface that sees everything and of one that sees nothing.
constexpr double kOpenGrey = 245;
constexpr double kShutGrey = 70;
// From where the light comes, x right, y down, z away.
const Vector3d kLightInCamera(-0.6, -0.7, -0.7);
// The surroundings that darken a surface, in statures.
constexpr double kReach = 0.12;

// How much of its half space each vertex sees, 0 to 1, weighted by cosine.
std::vector<double> Openness(const TriangleMesh& mesh, double reach) {
  constexpr int kRays = 64;
  const RayScene scene(mesh);
  const std::vector<Vector3d> normals = VertexNormals(mesh);
  std::vector<double> openness(mesh.vertices.size());
  tbb::parallel_for(size_t{0}, mesh.vertices.size(), [&](size_t v) {
    const Vector3d& normal = normals[v];
    const Vector3d x = normal.unitOrthogonal();
    const Vector3d y = normal.cross(x);
    int free = 0;
    for (int i = 0; i < kRays; ++i) {
      // A spiral of directions, dense in proportion to the cosine.
      const double across = std::sqrt((i + 0.5) / kRays);
      const double turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
      const Vector3d direction = across * std::cos(turn) * x +
                                 across * std::sin(turn) * y +
                                 std::sqrt(1 - across * across) * normal;
      const RayScene::Hit hit =
          scene.Intersect(mesh.vertices[v] + 1e-3 * reach * normal, direction);
      if (hit.triangle < 0 || hit.distance > reach) ++free;
    }
    openness[v] = static_cast<double>(free) / kRays;
  });
  return openness;
}

struct Aspect {
  std::string name;
  double azimuth, elevation;  // degrees
};

// A mesh with its greys that can be looked at from anywhere.
class Sitter {
 public:
  Sitter(const TriangleMesh& mesh, double reach)
      : mesh_(mesh),
        normals_(VertexNormals(mesh)),
        openness_(Openness(mesh, reach)) {}

  // Only triangles whose corners are all `wanted` are drawn.
  cv::Mat3b Draw(const Camera& camera,
                 const std::function<bool(int)>& wanted) const {
    TriangleMesh shown;
    shown.vertices = mesh_.vertices;
    for (const Triangle& triangle : mesh_.triangles) {
      if (std::all_of(triangle.begin(), triangle.end(), wanted))
        shown.triangles.push_back(triangle);
    }
    const Eigen::Matrix3d& axes = camera.camera_from_world;
    const Vector3d to_light = axes.transpose() * kLightInCamera.normalized();
    std::vector<cv::Vec3b> color;
    for (size_t v = 0; v < normals_.size(); ++v) {
      const double lit = std::max(0.0, 0.3 + 0.7 * normals_[v].dot(to_light));
      const double grey = kShutGrey + (kOpenGrey - kShutGrey) * openness_[v] *
                                          (0.45 + 0.55 * lit);
      const auto code = cv::saturate_cast<unsigned char>(grey);
      color.push_back({code, code, code});
    }
    return RenderShaded(camera, shown, color);
  }

 private:
  TriangleMesh mesh_;
  std::vector<Vector3d> normals_;
  std::vector<double> openness_;
};

// A close-up: around a point, as far as `radius` statures, of some parts.
struct CloseUp {
  std::string name;
  Vector3d center;
  double radius;
  double azimuth, elevation;  // degrees
  std::vector<BodyPart> parts;
};

std::vector<CloseUp> CloseUps(const Body& body) {
  const JointFrames frames = RestFrames(body.skeleton);
  const auto& joint = frames.joint_in_world;
  const Vector3d down = -0.02 * body.stature * Vector3d::UnitY();
  const Vector3d head = (joint[kHead] + joint[kHeadEnd]) / 2 + 1.2 * down;
  const Vector3d hand =
      joint[kLWrist] + 0.55 * (joint[kLHandEnd] - joint[kLWrist]);
  const Vector3d foot =
      joint[kLAnkle] + Vector3d(0, 0, 0.03 * body.stature) + 0.5 * down;
  const Vector3d arm_pit = joint[kLShoulder] + down;
  const Vector3d crotch = joint[kRoot] + down;
  const std::vector<BodyPart> all = {};
  const std::vector<BodyPart> arm = {BodyPart::kLArm, BodyPart::kLHand};
  const std::vector<BodyPart> leg = {BodyPart::kLLeg, BodyPart::kLFoot};
  const std::vector<BodyPart> trunk = {
      BodyPart::kTrunk, BodyPart::kHead, BodyPart::kLLeg, BodyPart::kRLeg};
  return {{"head_front", head, 0.080, 0, 0, all},
          {"head_three_quarter", head, 0.080, 40, 8, all},
          {"head_left", head, 0.080, 90, 0, all},
          {"head_back", head, 0.080, 150, 5, all},
          {"hand_back", hand, 0.06, 75, 45, arm},
          {"hand_palm", hand, 0.06, -90, -45, arm},
          {"hand_thumb", hand, 0.06, 0, 10, arm},
          {"hand_tips", hand, 0.06, 60, -35, arm},
          {"foot_above", foot, 0.08, 20, 50, leg},
          {"foot_outside", foot, 0.08, 90, 5, leg},
          {"foot_inside", foot, 0.08, -80, 12, leg},
          {"foot_heel", foot, 0.08, 160, 15, leg},
          {"armpit_front", arm_pit, 0.12, 15, -15, all},
          {"armpit_back", arm_pit, 0.12, 160, 0, all},
          {"armpit_below", arm_pit, 0.12, 70, -35, all},
          {"shoulder_above", arm_pit, 0.12, 30, 45, all},
          {"crotch_front", crotch, 0.12, 0, -5, trunk},
          {"crotch_back", crotch, 0.12, 180, 0, trunk},
          {"crotch_below", crotch, 0.12, 10, -50, trunk},
          {"hip_left", crotch, 0.12, 90, 0, trunk},
          {"knee_front", joint[kLKnee], 0.12, 10, 0, leg},
          {"knee_left", joint[kLKnee], 0.12, 90, 0, leg},
          {"knee_back", joint[kLKnee], 0.12, 180, 0, leg},
          {"elbow", joint[kLElbow], 0.10, 170, 10, arm}};
}

}  // namespace

std::vector<Portrait> DrawPortraits(const Body& body, int height) {
  TriangleMesh mesh;
  mesh.vertices = RestVertices(body);
  mesh.triangles = TriangulateQuads(body.topology.quads, mesh.vertices);
  const Sitter sitter(mesh, kReach * body.stature);
  std::vector<Portrait> portraits;
  for (const Aspect& aspect : {Aspect{"front", 0, 0},
                               Aspect{"three_quarter", 40, 5},
                               Aspect{"left", 90, 0},
                               Aspect{"back", 180, 0}}) {
    const Camera camera = LookAtMesh(mesh,
                                     aspect.azimuth,
                                     aspect.elevation,
                                     std::max(1, height * 2 / 3),
                                     height);
    portraits.push_back(
        {aspect.name, sitter.Draw(camera, [](int) { return true; })});
  }
  const int side = std::max(1, height * 2 / 3);
  for (const CloseUp& view : CloseUps(body)) {
    const double radius = view.radius * body.stature;
    // The ends of three axes stand for what is to be seen.
    TriangleMesh frame;
    for (int axis = 0; axis < 3; ++axis) {
      for (double sign : {-1.0, 1.0}) {
        frame.vertices.push_back(view.center +
                                 sign * radius * Vector3d::Unit(axis));
      }
    }
    const Camera camera =
        LookAtMesh(frame, view.azimuth, view.elevation, side, side);
    const auto wanted = [&](int v) {
      return view.parts.empty() ||
             std::find(view.parts.begin(),
                       view.parts.end(),
                       body.topology.part[v]) != view.parts.end();
    };
    portraits.push_back({view.name, sitter.Draw(camera, wanted)});
  }
  return portraits;
}

cv::Mat3b DrawPortraitSheet(const std::vector<Portrait>& portraits,
                            int per_row) {
  int width = 0, height = 0;
  for (size_t first = 0; first < portraits.size();) {
    int row_width = 0, row_height = 0;
    const size_t last = std::min(first + per_row, portraits.size());
    for (; first < last; ++first) {
      row_width += portraits[first].picture.cols;
      row_height = std::max(row_height, portraits[first].picture.rows);
    }
    width = std::max(width, row_width);
    height += row_height;
  }
  cv::Mat3b sheet(height, width, cv::Vec3b(255, 255, 255));
  int y = 0;
  for (size_t first = 0; first < portraits.size();) {
    int x = 0, row_height = 0;
    const size_t last = std::min(first + per_row, portraits.size());
    for (; first < last; ++first) {
      const cv::Mat3b& picture = portraits[first].picture;
      picture.copyTo(sheet(cv::Rect(cv::Point(x, y), picture.size())));
      x += picture.cols;
      row_height = std::max(row_height, picture.rows);
    }
    y += row_height;
  }
  return sheet;
}

}  // namespace sweepfit
