// SPDX-License-Identifier: Apache-2.0
#include "experiments/synthetic_surface.h"

#include <glog/logging.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// The surface of a group of parts blends with the others over this width,
// fractions of stature.
constexpr double kGroupBlend = 0.016;
// Clothes, hair and bumps are looked up only this near the bare body, metres:
// beyond it they cannot reach the band around the surface.
constexpr double kThickestClothes = 0.07;
constexpr double kDeepestDent = 0.03;
// Within this distance bones share a point's rest position, metres.
constexpr double kBoneBlend = 0.004;

// Quadratic smooth minimum: equal to the minimum where the two differ by more
// than the width, at most width/4 below it.
double SmoothMin(double a, double b, double width) {
  const double low = std::min(a, b);
  const double overlap = width - std::abs(a - b);
  // With an infinite argument or no width the overlap is not positive.
  return overlap > 0 ? low - overlap * overlap / (4 * width) : low;
}

struct Block {
  openvdb::Coord origin;
  std::array<float, 512> values;
};

}  // namespace

DressedBody::DressedBody(const PersonShape& shape,
                         const PosedPerson& person,
                         const Outfit& outfit)
    : person_(person),
      outfit_(outfit),
      stature_(shape.stature),
      rest_joints_(shape.RestJoints()) {
  all_parts_ =
      NearParts(Vector3d::Zero(), std::numeric_limits<double>::infinity());
}

DressedBody::PartLists DressedBody::NearParts(const Vector3d& center,
                                              double radius) const {
  // First-order distances can be off by some tens of percent away from the
  // surface, and blends reach further than the nearest part.
  const double reach = 2.6 * radius + 0.08 * stature_;
  double nearest = std::numeric_limits<double>::infinity();
  std::array<std::vector<double>, kNumBodyGroups> distances;
  for (int group = 0; group < kNumBodyGroups; ++group) {
    for (const BodyPart& part : person_.parts[group]) {
      distances[group].push_back(part.Distance(center));
      nearest = std::min(nearest, distances[group].back());
    }
  }
  PartLists lists;
  for (int group = 0; group < kNumBodyGroups; ++group) {
    for (size_t i = 0; i < distances[group].size(); ++i) {
      if (distances[group][i] <= nearest + reach) {
        lists[group].push_back(static_cast<int>(i));
      }
    }
  }
  return lists;
}

DressedBody::Bare DressedBody::Undressed(const Vector3d& point,
                                         const PartLists& lists) const {
  constexpr double kNowhere = std::numeric_limits<double>::infinity();
  Bare bare{kNowhere, {}};
  bare.to_bone.fill(kNowhere);
  for (int group = 0; group < kNumBodyGroups; ++group) {
    double of_group = kNowhere;
    for (int i : lists[group]) {
      const BodyPart& part = person_.parts[group][i];
      const double d = part.Distance(point);
      of_group = SmoothMin(of_group, d, part.blend);
      bare.to_bone[part.bone] = std::min(bare.to_bone[part.bone], d);
    }
    bare.distance = SmoothMin(bare.distance, of_group, kGroupBlend * stature_);
  }
  return bare;
}

double DressedBody::Distance(const Vector3d& point,
                             const PartLists& lists) const {
  const Bare bare = Undressed(point, lists);
  double distance = bare.distance;
  if (distance > -kDeepestDent && distance < kThickestClothes) {
    distance -= outfit_.Thickness(RestPoint(point, bare));
  }
  // The floor presses the soles flat.
  return std::max(distance, -point.y());
}

Vector3d DressedBody::RestPoint(const Vector3d& point, const Bare& bare) const {
  const double lowest =
      *std::min_element(bare.to_bone.begin(), bare.to_bone.end());
  Vector3d sum = Vector3d::Zero();
  double total = 0;
  for (int bone = 0; bone < kNumJoints; ++bone) {
    const double behind = (bare.to_bone[bone] - lowest) / kBoneBlend;
    if (!(behind < 30)) continue;
    const double weight = std::exp(-behind);
    total += weight;
    sum += weight *
           (rest_joints_[bone] + person_.world_from_joint[bone].transpose() *
                                     (point - person_.joint_in_world[bone]));
  }
  return sum / total;
}

std::vector<DressedBody::VertexLooks> DressedBody::Looks(
    const TriangleMesh& mesh, const std::vector<Vector3d>& normals) const {
  constexpr std::array kSteps = {0.03, 0.09};  // metres along the normal
  // Neighbours in the list are mostly neighbours in space.
  constexpr size_t kChunk = 64;
  const size_t count = mesh.vertices.size();
  std::vector<VertexLooks> looks(count);
  tbb::parallel_for(size_t{0}, (count + kChunk - 1) / kChunk, [&](size_t c) {
    const size_t begin = c * kChunk, end = std::min(count, begin + kChunk);
    Eigen::AlignedBox3d box;
    for (size_t i = begin; i < end; ++i) box.extend(mesh.vertices[i]);
    const PartLists lists =
        NearParts(box.center(), 0.5 * box.diagonal().norm() + kSteps.back());
    for (size_t i = begin; i < end; ++i) {
      const Vector3d& v = mesh.vertices[i];
      looks[i].rest_point = RestPoint(v, Undressed(v, lists));
      for (double step : kSteps) {
        const double free = Distance(v + step * normals[i], lists);
        looks[i].openness += std::clamp(free / step, 0.0, 1.0) / kSteps.size();
      }
    }
  });
  return looks;
}

TriangleMesh DressedBody::Mesh(double voxel_size) const {
  openvdb::initialize();
  constexpr int kBlock = 8;
  const double block_size = kBlock * voxel_size;
  const double background = 3 * voxel_size;
  Eigen::AlignedBox3d box;
  for (const Vector3d& joint : person_.joint_in_world) box.extend(joint);
  box.min().array() -= 0.16 * stature_;
  box.max().array() += 0.16 * stature_;
  const Eigen::Array3i first =
      (box.min().array() / block_size).floor().cast<int>();
  const Eigen::Array3i count =
      (box.max().array() / block_size).ceil().cast<int>() - first;

  // Blocks that the surface may cross, by one look at their centre.
  std::vector<std::vector<openvdb::Coord>> per_slab(count.x());
  tbb::parallel_for(0, count.x(), [&](int i) {
    for (int j = 0; j < count.y(); ++j) {
      for (int k = 0; k < count.z(); ++k) {
        const Eigen::Array3i block = first + Eigen::Array3i(i, j, k);
        const Vector3d center = (block.cast<double>() + 0.5) * block_size;
        // First-order distances are off by some tens of percent away from
        // the surface.
        const double slack = 1.2 * block_size;
        const double distance = Undressed(center, all_parts_).distance;
        if (distance > -slack - kDeepestDent &&
            distance < slack + kThickestClothes) {
          per_slab[i].emplace_back(
              block.x() * kBlock, block.y() * kBlock, block.z() * kBlock);
        }
      }
    }
  });
  std::vector<Block> blocks;
  for (const auto& slab : per_slab) {
    for (const openvdb::Coord& origin : slab) blocks.push_back({origin, {}});
  }
  tbb::parallel_for(size_t{0}, blocks.size(), [&](size_t b) {
    Block& block = blocks[b];
    const Vector3d origin(block.origin.x(), block.origin.y(), block.origin.z());
    const PartLists lists = NearParts(
        (origin.array() + kBlock / 2.0) * voxel_size, 0.87 * block_size);
    for (int n = 0; n < 512; ++n) {
      // The order of an OpenVDB leaf: z runs fastest.
      const Vector3d index = origin + Vector3d(n >> 6, n >> 3 & 7, n & 7);
      block.values[n] = static_cast<float>(std::clamp(
          Distance(index * voxel_size, lists), -background, background));
    }
  });

  openvdb::FloatGrid::Ptr grid =
      openvdb::FloatGrid::create(static_cast<float>(background));
  grid->setTransform(
      openvdb::math::Transform::createLinearTransform(voxel_size));
  for (const Block& block : blocks) {
    bool near_surface = false;
    for (float v : block.values) {
      near_surface = near_surface || std::abs(v) < background;
    }
    if (!near_surface) continue;
    auto* leaf = grid->tree().touchLeaf(block.origin);
    for (int n = 0; n < 512; ++n) {
      const float v = block.values[n];
      leaf->setValueOnly(n, v);
      leaf->setActiveState(n, std::abs(v) < background);
    }
  }
  openvdb::tools::signedFloodFill(grid->tree());
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec4I> quads;
  openvdb::tools::volumeToMesh(*grid, points, quads, 0.0);

  TriangleMesh mesh;
  double lowest = std::numeric_limits<double>::infinity();
  for (const openvdb::Vec3s& p : points) {
    mesh.vertices.emplace_back(p.x(), p.y(), p.z());
    lowest = std::min<double>(lowest, p.y());
  }
  for (Vector3d& v : mesh.vertices) v.y() -= lowest;
  std::vector<Quad> faces;
  for (const openvdb::Vec4I& q : quads) {
    faces.push_back({static_cast<int>(q[0]),
                     static_cast<int>(q[1]),
                     static_cast<int>(q[2]),
                     static_cast<int>(q[3])});
  }
  mesh.triangles = TriangulateQuads(faces, mesh.vertices);
  return LargestComponent(mesh);
}

}  // namespace sweepfit
