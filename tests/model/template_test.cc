// SPDX-License-Identifier: Apache-2.0
#include "model/template.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "model/anthropometry.h"
#include "model/cross_section.h"
#include "model/input_error.h"
#include "model/mesh.h"
#include "model/self_intersection.h"
#include "model/template_tables.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

constexpr double kWaterLike = 985;  // kg / m^3

const Body& Man() {
  static const Body body = BuildTemplate({1.0, 1.7562, 0});
  return body;
}

const Body& Woman() {
  static const Body body = BuildTemplate({0.0, 1.6285, 0});
  return body;
}

TriangleMesh MeshOf(const Body& body) {
  TriangleMesh mesh;
  mesh.vertices = RestVertices(body);
  mesh.triangles = TriangulateQuads(body.topology.quads, mesh.vertices);
  return mesh;
}

double Floor(const Body& body) {
  double floor = std::numeric_limits<double>::infinity();
  for (const Vector3d& v : RestVertices(body)) floor = std::min(floor, v.y());
  return floor;
}

double Top(const Body& body) {
  double top = -std::numeric_limits<double>::infinity();
  for (const Vector3d& v : RestVertices(body)) top = std::max(top, v.y());
  return top;
}

// Perimeter of the convex hull by Andrew's monotone chains.
double HullPerimeter(std::vector<Eigen::Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) {
    return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y());
  });
  double length = 0;
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<Eigen::Vector2d> chain;
    for (const Eigen::Vector2d& p : points) {
      while (chain.size() > 1) {
        const Eigen::Vector2d a = chain.back() - chain[chain.size() - 2];
        const Eigen::Vector2d b = p - chain.back();
        if (a.x() * b.y() - a.y() * b.x() > 0) break;
        chain.pop_back();
      }
      chain.push_back(p);
    }
    for (size_t i = 1; i < chain.size(); ++i)
      length += (chain[i] - chain[i - 1]).norm();
    std::reverse(points.begin(), points.end());
  }
  return length;
}

// A tape around the given parts of the rest mesh in a plane.
double Tape(const Body& body,
            const std::set<BodyPart>& parts,
            const Vector3d& origin,
            const Vector3d& normal) {
  const std::vector<Vector3d> vertices = RestVertices(body);
  const Vector3d x = normal.unitOrthogonal();
  const Vector3d y = normal.cross(x);
  std::vector<Eigen::Vector2d> cut;
  for (const Quad& quad : body.topology.quads) {
    for (int i = 0; i < 4; ++i) {
      const int a = quad[i];
      const int b = quad[(i + 1) % 4];
      if (!parts.contains(body.topology.part[a]) ||
          !parts.contains(body.topology.part[b]))
        continue;
      const double side_a = (vertices[a] - origin).dot(normal);
      const double side_b = (vertices[b] - origin).dot(normal);
      if ((side_a < 0) == (side_b < 0)) continue;
      const double t = side_a / (side_a - side_b);
      const Vector3d p = vertices[a] + t * (vertices[b] - vertices[a]) - origin;
      cut.push_back({p.dot(x), p.dot(y)});
    }
  }
  return cut.size() < 3 ? 0 : HullPerimeter(cut);
}

double GirthOfMesh(const Body& body, const GirthTarget& target) {
  const double stature = body.stature;
  const JointFrames frames = RestFrames(body.skeleton);
  const auto& joint = frames.joint_in_world;
  const Vector3d up = Vector3d::UnitY();
  auto on_chain = [&](int a, int b, int c, double u) -> Vector3d {
    return u < 1 ? joint[a] + u * (joint[b] - joint[a])
                 : joint[b] + (u - 1) * (joint[c] - joint[b]);
  };
  if (target.part == "arm") {
    const Vector3d along = (joint[kLWrist] - joint[kLShoulder]).normalized();
    return Tape(body,
                {BodyPart::kLArm, BodyPart::kLHand},
                on_chain(kLShoulder, kLElbow, kLWrist, target.level),
                along);
  }
  if (target.part == "leg") {
    return Tape(body,
                {BodyPart::kLLeg, BodyPart::kLFoot},
                on_chain(kLHip, kLKnee, kLAnkle, target.level),
                up);
  }
  const Vector3d level(0, Floor(body) + target.level * stature, 0);
  if (target.part == "neck") {
    // Lower in front by 20 degrees about the middle of the neck.
    const Vector3d normal = Vector3d(
        0, std::cos(std::numbers::pi / 9), std::sin(std::numbers::pi / 9));
    return Tape(body,
                {BodyPart::kTrunk, BodyPart::kHead},
                level - Vector3d(0, 0, 0.0146 * stature),
                normal);
  }
  return Tape(
      body, {BodyPart::kTrunk, BodyPart::kLLeg, BodyPart::kRLeg}, level, up);
}

double CornerAngle(const Vector3d& before,
                   const Vector3d& at,
                   const Vector3d& after) {
  const Vector3d a = before - at;
  const Vector3d b = after - at;
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

TEST(TemplateTest, IsOneClosedOrientedQuadMeshOfGenusZero) {
  const TriangleMesh mesh = MeshOf(Man());
  const MeshTopology topology = CheckTopology(mesh);
  EXPECT_TRUE(topology.IsClosedManifold());
  EXPECT_EQ(topology.num_components, 1);
  EXPECT_EQ(topology.euler_characteristic, 2);
  EXPECT_GT(EnclosedVolume(mesh), 0);
  EXPECT_GT(Man().num_vertices(), 10000);
  EXPECT_LT(Man().num_vertices(), 16000);
  EXPECT_EQ(mesh.triangles.size(), 2 * Man().topology.quads.size());
  for (const Quad& quad : Man().topology.quads) {
    EXPECT_EQ(std::set<int>(quad.begin(), quad.end()).size(), 4u);
  }
}

TEST(TemplateTest, LeftAndRightMirrorEachOther) {
  for (const Body* body : {&Man(), &Woman()}) {
    const std::vector<Vector3d> vertices = RestVertices(*body);
    const std::vector<int>& mirror = body->topology.mirror_vertex;
    ASSERT_EQ(mirror.size(), vertices.size());
    double worst = 0;
    for (size_t v = 0; v < vertices.size(); ++v) {
      EXPECT_EQ(mirror[mirror[v]], static_cast<int>(v));
      const Vector3d& other = vertices[mirror[v]];
      worst = std::max(
          worst,
          (vertices[v] - Vector3d(-other.x(), other.y(), other.z())).norm());
    }
    EXPECT_LT(worst, 1e-6);
  }
}

TEST(TemplateTest, MirroredPostureGivesTheMirroredBody) {
  Pose left, right;
  const Vector3d axis = Vector3d(0.3, 0.5, -0.8).normalized();
  const Vector3d mirrored_axis(axis.x(), -axis.y(), -axis.z());
  for (int joint : {kLShoulder, kLElbow, kLWrist, kLHip, kLKnee, kLAnkle}) {
    left.rotation[joint] = Eigen::AngleAxisd(0.6, axis);
    right.rotation[MirrorJoint(joint)] = Eigen::AngleAxisd(0.6, mirrored_axis);
  }
  const auto a = PoseVertices(Man(), left);
  const auto b = PoseVertices(Man(), right);
  double worst = 0;
  for (size_t v = 0; v < a.size(); ++v) {
    const Vector3d& other = b[Man().topology.mirror_vertex[v]];
    worst = std::max(
        worst, (a[v] - Vector3d(-other.x(), other.y(), other.z())).norm());
  }
  EXPECT_LT(worst, 1e-6);
}

TEST(TemplateTest, RestPoseIsTheIdentity) {
  const auto rest = RestVertices(Woman());
  const auto posed = PoseVertices(Woman(), Pose());
  for (size_t v = 0; v < rest.size(); ++v)
    EXPECT_LT((rest[v] - posed[v]).norm(), 1e-9);
}

TEST(TemplateTest, BindingAgainGivesTheSameVertices) {
  Body body = Woman();
  const auto vertices = RestVertices(body);
  std::vector<std::vector<std::pair<int, double>>> weights;
  for (const Binding& binding : body.binding) {
    weights.emplace_back();
    double sum = 0;
    for (const SweepAttachment& attachment : binding.attachment) {
      if (attachment.sweep < 0) continue;
      weights.back().push_back({attachment.sweep, attachment.weight});
      sum += attachment.weight;
    }
    EXPECT_NEAR(sum, 1, 1e-12);
  }
  BindVertices(vertices, weights, &body);
  const auto again = RestVertices(body);
  for (size_t v = 0; v < vertices.size(); ++v)
    EXPECT_LT((vertices[v] - again[v]).norm(), 1e-6);
}

TEST(TemplateTest, OnlyTheCrotchFollowsALimbOfTheOtherSide) {
  const std::vector<Vector3d> vertices = RestVertices(Man());
  const double crotch_width = 0.015 * Man().stature;
  for (int v = 0; v < Man().num_vertices(); ++v) {
    for (const SweepAttachment& attachment : Man().binding[v].attachment) {
      if (attachment.sweep < 0) continue;
      const std::string& name = Man().sweeps[attachment.sweep].name;
      if (name[1] != '_') continue;
      const double own_side = vertices[v].x() * (name[0] == 'l' ? 1 : -1);
      if (own_side > 0) continue;
      EXPECT_EQ(name.substr(2), "leg") << "vertex " << v;
      EXPECT_GT(own_side, -crotch_width) << "vertex " << v << " and " << name;
      EXPECT_LE(attachment.weight, 0.5) << "vertex " << v << " and " << name;
    }
  }
}

TEST(TemplateTest, StandsInItsStature) {
  for (const Body* body : {&Man(), &Woman()}) {
    EXPECT_NEAR(
        Top(*body) - Floor(*body), body->stature, 0.005 * body->stature);
  }
}

TEST(TemplateTest, BonesFollowTheAnthropometricTable) {
  for (const Body* body : {&Man(), &Woman()}) {
    const double scale = body->skeleton.length[kLKnee] /
                         Anthropometry::Default().bone[kLKnee].Mean(body->sex);
    EXPECT_NEAR(scale, body->stature, 0.01 * body->stature);
    for (int joint = 1; joint < kNumJoints; ++joint) {
      EXPECT_NEAR(body->skeleton.length[joint],
                  scale * Anthropometry::Default().bone[joint].Mean(body->sex),
                  1e-12)
          << kJointNames[joint];
      EXPECT_NEAR(body->skeleton.rest_direction[joint].norm(), 1, 1e-12);
    }
  }
}

// Winding number of the mesh about a point: 1 inside, 0 outside.
double WindingNumber(const TriangleMesh& mesh, const Vector3d& point) {
  double sum = 0;
  for (const Triangle& triangle : mesh.triangles) {
    const Vector3d a = mesh.vertices[triangle[0]] - point;
    const Vector3d b = mesh.vertices[triangle[1]] - point;
    const Vector3d c = mesh.vertices[triangle[2]] - point;
    sum += 2 * std::atan2(a.dot(b.cross(c)),
                          a.norm() * b.norm() * c.norm() + a.dot(b) * c.norm() +
                              b.dot(c) * a.norm() + c.dot(a) * b.norm());
  }
  return sum / (4 * std::numbers::pi);
}

TEST(TemplateTest, JointsLieInsideAndEndsOnTheSurface) {
  for (const Body* body : {&Man(), &Woman()}) {
    const TriangleMesh mesh = MeshOf(*body);
    const JointFrames frames = RestFrames(body->skeleton);
    for (int joint = 0; joint < kNumJoints; ++joint) {
      const Vector3d& position = frames.joint_in_world[joint];
      const bool is_end = joint == kHeadEnd || joint == kLHandEnd ||
                          joint == kRHandEnd || joint == kLFootEnd ||
                          joint == kRFootEnd;
      if (!is_end) {
        EXPECT_NEAR(WindingNumber(mesh, position), 1, 1e-6)
            << kJointNames[joint];
        continue;
      }
      double nearest = std::numeric_limits<double>::infinity();
      for (const Vector3d& vertex : mesh.vertices)
        nearest = std::min(nearest, (vertex - position).norm());
      EXPECT_LT(nearest, 0.01 * body->stature) << kJointNames[joint];
    }
  }
}

TEST(TemplateTest, GirthsAreThoseOfTheTables) {
  for (const TemplateOptions& options : {TemplateOptions{0.0, 1.6285, 0},
                                         TemplateOptions{0.5, 1.70, 0},
                                         TemplateOptions{1.0, 1.7562, 0},
                                         TemplateOptions{0.0, 1.50, 0},
                                         TemplateOptions{1.0, 1.95, 0}}) {
    const Body body = BuildTemplate(options);
    const TemplateTables tables = TemplateTables::Default(body.sex);
    ASSERT_EQ(tables.girths.size(), 10u);
    for (const GirthTarget& target : tables.girths) {
      const double wanted = target.girth * body.stature;
      EXPECT_NEAR(GirthOfMesh(body, target), wanted, 0.02 * wanted)
          << target.name << " at sex " << body.sex << ", stature "
          << body.stature;
    }
  }
}

TEST(TemplateTest, GirthsFollowTheMass) {
  const Anthropometry& table = Anthropometry::Default();
  for (const TemplateOptions& options : {TemplateOptions{1.0, 1.7562, 110},
                                         TemplateOptions{1.0, 1.80, 65},
                                         TemplateOptions{0.5, 1.70, 85},
                                         TemplateOptions{0.0, 1.6285, 52},
                                         TemplateOptions{0.0, 1.60, 85}}) {
    const Body body = BuildTemplate(options);
    const TemplateTables tables = TemplateTables::Default(options.sex);
    const double mean_mass =
        tables.ponderal_index * std::pow(options.stature, 3);
    for (const GirthTarget& target : tables.girths) {
      const GirthRegression* regression =
          target.name == "chest"     ? &table.chest
          : target.name == "waist"   ? &table.waist
          : target.name == "buttock" ? &table.buttock
          : target.name == "thigh"   ? &table.thigh
          : target.name == "calf"    ? &table.calf
          : target.name == "neck"    ? &table.neck
          : target.name == "ankle"   ? &table.ankle
                                     : nullptr;
      const double factor =
          regression != nullptr
              ? regression->Girth(options.sex, options.mass, options.stature) /
                    regression->Girth(options.sex, mean_mass, options.stature)
              : std::pow(options.mass / mean_mass, target.mass_exponent);
      const double wanted = factor * target.girth * options.stature;
      EXPECT_NEAR(GirthOfMesh(body, target), wanted, 0.02 * wanted)
          << target.name << " at sex " << body.sex << ", " << body.stature
          << " m, " << body.mass << " kg";
    }
    EXPECT_NEAR(
        EnclosedVolume(MeshOf(body)) * kWaterLike, body.mass, 0.12 * body.mass);
  }
}

TEST(TemplateTest, WeighsWhatTheTableSays) {
  EXPECT_NEAR(EnclosedVolume(MeshOf(Man())) * kWaterLike, 85.5, 0.12 * 85.5);
  EXPECT_NEAR(EnclosedVolume(MeshOf(Woman())) * kWaterLike, 67.8, 0.12 * 67.8);
}

TEST(TemplateTest, QuadsAreWellShaped) {
  for (const Body* body : {&Man(), &Woman()}) {
    const std::vector<Vector3d> vertices = RestVertices(*body);
    int sharp = 0;
    int folded = 0;
    double least = 180;
    for (const Quad& quad : body->topology.quads) {
      double least_here = 180;
      Vector3d sum = Vector3d::Zero();
      std::array<Vector3d, 4> normal;
      for (int i = 0; i < 4; ++i) {
        const Vector3d& before = vertices[quad[(i + 3) % 4]];
        const Vector3d& at = vertices[quad[i]];
        const Vector3d& after = vertices[quad[(i + 1) % 4]];
        least_here = std::min(least_here, CornerAngle(before, at, after));
        normal[i] = (after - at).cross(before - at);
        sum += normal[i];
      }
      least = std::min(least, least_here);
      if (least_here < 20) ++sharp;
      for (const Vector3d& n : normal) {
        if (n.dot(sum) <= 0) {
          ++folded;
          break;
        }
      }
    }
    // Around the ears and at the arms' and fingers' roots a few are narrow.
    EXPECT_LE(sharp, 40);
    EXPECT_LE(folded, 8);
    EXPECT_GT(least, 8);
  }
}

TEST(TemplateTest, DoesNotCutItself) {
  for (const TemplateOptions& options : {TemplateOptions{0.0, 1.6285, 0},
                                         TemplateOptions{0.5, 1.70, 0},
                                         TemplateOptions{1.0, 1.7562, 0}}) {
    EXPECT_EQ(SelfIntersections(MeshOf(BuildTemplate(options))).size(), 0u)
        << "sex " << options.sex;
  }
}

double DepthAt(const Body& body, double level) {
  double front = -1, back = 1;
  const double height = Floor(body) + level * body.stature;
  for (const Vector3d& v : RestVertices(body)) {
    if (std::abs(v.y() - height) > 0.008 * body.stature) continue;
    if (std::abs(v.x()) > 0.12 * body.stature) continue;
    front = std::max(front, v.z());
    back = std::min(back, v.z());
  }
  return (front - back) / body.stature;
}

// ANSUR II, fractions of stature: chest, waist (omphalion), buttock.
TEST(TemplateTest, DepthsOfTheTrunkFollowTheSurvey) {
  EXPECT_NEAR(DepthAt(Man(), 0.7351), 0.1446, 0.008);
  EXPECT_NEAR(DepthAt(Man(), 0.6014), 0.1355, 0.008);
  EXPECT_NEAR(DepthAt(Man(), 0.5054), 0.1401, 0.008);
  EXPECT_NEAR(DepthAt(Woman(), 0.7194), 0.1520, 0.010);
  EXPECT_NEAR(DepthAt(Woman(), 0.6017), 0.1309, 0.008);
  EXPECT_NEAR(DepthAt(Woman(), 0.5118), 0.1431, 0.008);
}

// The hip joint lies below and behind the front spines of the hip bones
// (Harrington 2007: .24 of the pelvis' depth and 10 mm behind), that is in
// front of the middle of the body's depth, near the plumb line through the
// middle of the trunk (Kendall); the crotch is a hand's breadth below it.
TEST(TemplateTest, HipJointsLieWhereAnatomyPutsThem) {
  for (const Body* body : {&Man(), &Woman()}) {
    const double stature = body->stature;
    const Vector3d hip = RestFrames(body->skeleton).joint_in_world[kLHip];
    double front = -1, back = 1, crotch = -1;
    for (const Vector3d& v : RestVertices(*body)) {
      if (std::abs(v.y() - hip.y()) < 0.008 * stature &&
          std::abs(v.x()) < 0.12 * stature) {
        front = std::max(front, v.z());
        back = std::min(back, v.z());
      }
      const bool between_legs =
          std::abs(v.x()) < 1e-9 && std::abs(v.z()) < 0.02 * stature;
      if (between_legs && v.y() < hip.y()) crotch = std::max(crotch, v.y());
    }
    const double share = (front - hip.z()) / (front - back);
    EXPECT_GT(share, 0.38);
    EXPECT_LT(share, 0.52);
    EXPECT_NEAR((hip.y() - crotch) / stature, 0.035, 0.012);
  }
}

TEST(TemplateTest, EveryHandAndFootHasFiveDigits) {
  // A digit's tip stands farther out than all vertices around it.
  std::vector<std::vector<int>> neighbors(Man().num_vertices());
  for (const Quad& quad : Man().topology.quads) {
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 4; ++k) {
        if (k != i) neighbors[quad[i]].push_back(quad[k]);
      }
    }
  }
  const std::vector<Vector3d> vertices = RestVertices(Man());
  const auto joint = RestFrames(Man().skeleton).joint_in_world;
  auto count_tips = [&](BodyPart part, const Vector3d& root, double from) {
    int tips = 0;
    for (int v = 0; v < Man().num_vertices(); ++v) {
      if (Man().topology.part[v] != part) continue;
      const double reach = (vertices[v] - root).norm();
      if (reach < from) continue;
      const bool is_tip =
          std::all_of(neighbors[v].begin(), neighbors[v].end(), [&](int n) {
            return (vertices[n] - root).norm() < reach;
          });
      if (is_tip) ++tips;
    }
    return tips;
  };
  const double hand = (joint[kLHandEnd] - joint[kLWrist]).norm();
  const double foot = (joint[kLFootEnd] - joint[kLAnkle]).norm();
  EXPECT_EQ(count_tips(BodyPart::kLHand, joint[kLWrist], 0.5 * hand), 5);
  EXPECT_EQ(count_tips(BodyPart::kRFoot, joint[kRAnkle], 0.6 * foot), 5);
}

TEST(TemplateTest, ChartsFillTheUnitSquareWithoutOverlap) {
  constexpr int kSize = 1024;
  std::vector<int> owner(kSize * kSize, -1);
  int covered = 0;
  int shared = 0;
  const auto& uv = Man().topology.uv;
  ASSERT_EQ(uv.size(), Man().topology.quads.size());
  for (size_t q = 0; q < uv.size(); ++q) {
    // Corners are axis-parallel rectangles: test pixel centres.
    Eigen::Vector2f low = uv[q][0], high = uv[q][0];
    double twice_area = 0;
    for (int i = 0; i < 4; ++i) {
      low = low.cwiseMin(uv[q][i]);
      high = high.cwiseMax(uv[q][i]);
      const Eigen::Vector2f& next = uv[q][(i + 1) % 4];
      twice_area += uv[q][i].x() * next.y() - uv[q][i].y() * next.x();
    }
    EXPECT_GT(twice_area, 0) << "mirrored texture in quad " << q;
    EXPECT_GE(low.minCoeff(), 0);
    EXPECT_LE(high.maxCoeff(), 1);
    EXPECT_NEAR(twice_area / 2, (high - low).prod(), 1e-6);
    for (int y = static_cast<int>(std::ceil(low.y() * kSize - 0.5));
         y + 0.5 < high.y() * kSize;
         ++y) {
      for (int x = static_cast<int>(std::ceil(low.x() * kSize - 0.5));
           x + 0.5 < high.x() * kSize;
           ++x) {
        int& pixel = owner[y * kSize + x];
        if (pixel >= 0) ++shared;
        pixel = static_cast<int>(q);
        ++covered;
      }
    }
  }
  EXPECT_EQ(shared, 0);
  EXPECT_GT(covered, 0.5 * kSize * kSize);
}

TEST(TemplateTest, BuildsForAllSexesAndStatures) {
  for (const TemplateOptions& options :
       {TemplateOptions{0.5, 1.1, 0}, TemplateOptions{0.5, 2.0, 0}}) {
    const Body body = BuildTemplate(options);
    const TriangleMesh mesh = MeshOf(body);
    EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
    EXPECT_NEAR(
        Top(body) - Floor(body), options.stature, 0.005 * options.stature);
    for (const Vector3d& vertex : mesh.vertices)
      EXPECT_TRUE(vertex.allFinite());
    EXPECT_NEAR(EnclosedVolume(mesh) * kWaterLike, body.mass, 0.12 * body.mass);
  }
}

TEST(TemplateTest, SectionsArePositiveAndReadyToFit) {
  for (const Sweep& sweep : Man().sweeps) {
    EXPECT_GT(sweep.radius.minCoeff(), 0.001) << sweep.name;
    EXPECT_EQ(sweep.feature_weight.size(), sweep.num_rows());
    EXPECT_TRUE(std::is_sorted(sweep.key_u.begin(), sweep.key_u.end()));
    for (int row = 0; row < sweep.num_rows(); ++row) {
      const Eigen::VectorXd radii = sweep.radius.row(row);
      const CrossSection section(
          std::vector<double>(radii.begin(), radii.end()));
      // The centre is near the centroid, well inside.
      EXPECT_LT(section.Centroid().norm(), 0.25 * radii.minCoeff())
          << sweep.name << " at u = " << sweep.key_u[row];
    }
  }
}

TEST(TemplateTest, BendingTurnsNoQuadInsideOutAwayFromTheFold) {
  Pose pose;
  const double right_angle = std::numbers::pi / 2;
  const Vector3d elbow_axis = Vector3d(-1, -1, 0).normalized();
  pose.rotation[kLElbow] = Eigen::AngleAxisd(right_angle, elbow_axis);
  pose.rotation[kLKnee] = Eigen::AngleAxisd(right_angle, Vector3d::UnitX());
  const Body& body = Man();
  const auto rest = RestVertices(body);
  const auto posed = PoseVertices(body, pose);
  const auto motion = BodyDeformer(body).Motions(pose);
  const auto joint = RestFrames(body.skeleton).joint_in_world;
  const double fold = 0.05 * body.stature;
  for (const Quad& quad : body.topology.quads) {
    const Vector3d at = rest[quad[0]];
    if ((at - joint[kLElbow]).norm() < fold ||
        (at - joint[kLKnee]).norm() < fold)
      continue;
    auto normal = [&](const std::vector<Vector3d>& v) -> Vector3d {
      return (v[quad[2]] - v[quad[0]]).cross(v[quad[3]] - v[quad[1]]);
    };
    EXPECT_GT(normal(posed).dot(motion[quad[0]].rotation * normal(rest)), 0)
        << "near " << at.transpose();
  }
}

TEST(TemplateTest, RejectsOptionsOutOfRange) {
  EXPECT_THROW(BuildTemplate({-0.1, 1.7, 0}), InputError);
  EXPECT_THROW(BuildTemplate({0.5, 0.5, 0}), InputError);
  EXPECT_THROW(BuildTemplate({0.5, std::nan(""), 0}), InputError);
  EXPECT_THROW(BuildTemplate({0.5, 1.7, -1}), InputError);
}

TEST(TemplateTablesTest, ErrorsNameTheSourceAndTheKey) {
  try {
    TemplateTables::Parse("rest_direction: {spine: [0, 1]}", "my.yaml", 0.5);
    FAIL() << "a direction of two numbers was accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("my.yaml"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("line 1"), std::string::npos);
  }
  EXPECT_THROW(TemplateTables::Parse("[", "my.yaml", 0.5), InputError);
  EXPECT_THROW(TemplateTables::Parse("", "my.yaml", 0.5), InputError);
}

}  // namespace
}  // namespace sweepfit
