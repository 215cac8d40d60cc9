// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "experiments/synthetic_clothes.h"
#include "experiments/synthetic_person.h"
#include "model/mesh.h"

namespace sweepfit {

// The dressed person as an implicit surface, metres, negative inside: the
// smooth union of the body parts, moved outwards by what covers them.
class DressedBody {
 public:
  DressedBody(const PersonShape& shape,
              const PosedPerson& person,
              const Outfit& outfit);

  // What drawing needs to know of a vertex.
  struct VertexLooks {
    // Where it would be in the rest pose: a smooth mixture over the bones near
    // it.
    Eigen::Vector3d rest_point;
    // Free space along the normal: 0 in a crease .. 1.
    double openness = 0;
  };
  std::vector<VertexLooks> Looks(
      const TriangleMesh& mesh,
      const std::vector<Eigen::Vector3d>& normals) const;

  // The zero surface: closed, the soles on y = 0.
  TriangleMesh Mesh(double voxel_size) const;

 private:
  using PartLists = std::array<std::vector<int>, kNumBodyGroups>;
  // The smooth union without clothes, and how far the nearest part of every
  // bone is.
  struct Bare {
    double distance;
    std::array<double, kNumJoints> to_bone;
  };
  Bare Undressed(const Eigen::Vector3d& point, const PartLists& lists) const;
  double Distance(const Eigen::Vector3d& point, const PartLists& lists) const;
  Eigen::Vector3d RestPoint(const Eigen::Vector3d& point,
                            const Bare& bare) const;
  // The parts that can matter within `radius` of the point.
  PartLists NearParts(const Eigen::Vector3d& center, double radius) const;

  const PosedPerson& person_;
  const Outfit& outfit_;
  double stature_;
  std::array<Eigen::Vector3d, kNumJoints> rest_joints_;
  PartLists all_parts_;
};

}  // namespace sweepfit
