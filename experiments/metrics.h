// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "model/mesh.h"
#include "model/skeleton.h"

namespace sweepfit {

// Overlap and boundary distance of two soft masks (coverage 0..1).
struct SilhouetteError {
  double iou = 0;            // sum min / sum max; 1 when both are empty
  double boundary_mean = 0;  // px, symmetric, between the 0.5 levels
  double boundary_p95 = 0;
  double signed_mean = 0;  // px, positive: the first mask is larger
};
// Masks of equal size. Boundary points less than two pixels from the frame do
// not count: there the silhouette is cut, not bounded. The distances are
// infinite when only one of the masks has a boundary (signed_mean then says
// which: +inf, -inf) and 0 when none has.
SilhouetteError CompareMasks(const cv::Mat1f& mask, const cv::Mat1f& truth);
nlohmann::ordered_json ErrorToJson(const SilhouetteError& error);

// The joints of the limbs, where rigs agree best on what a joint is.
inline constexpr std::array kLimbJoints = {kLShoulder,
                                           kLElbow,
                                           kLWrist,
                                           kRShoulder,
                                           kRElbow,
                                           kRWrist,
                                           kLHip,
                                           kLKnee,
                                           kLAnkle,
                                           kRHip,
                                           kRKnee,
                                           kRAnkle};

struct JointError {
  double mpjpe = 0;            // metres, all joints
  double limb_mpjpe = 0;       // over kLimbJoints
  double pa_mpjpe = 0;         // after a similarity alignment
  double bone_length_mae = 0;  // metres; without neck-shoulder and root-hip
  std::array<double, kNumJoints> per_joint{};
  // Joint minus true joint along the person's left, up and front, as the true
  // hips say: rigs that place a joint elsewhere on purpose show here.
  std::array<Eigen::Vector3d, kNumJoints> offset_in_body;
};
using JointPositions = std::array<Eigen::Vector3d, kNumJoints>;
JointError CompareJoints(const JointPositions& joints,
                         const JointPositions& truth);

// Reads {"unit":"m","joints":{"root":[x,y,z],...}} (truth/<pose>/joints.json),
// world metres, joints by name. InputError naming the file and the joint when
// it cannot be read, a joint is missing or no triple of finite numbers.
JointPositions LoadTruthJoints(const std::filesystem::path& path);

struct SurfaceError {
  double mean = 0, median = 0, p95 = 0, max = 0;  // metres
  double signed_mean = 0;                         // positive: outside
};
// Exact point-to-triangle distances of `samples` area-weighted points (seeded)
// of `mesh` to `truth`. Outside is the side of the interpolated vertex normal
// of the nearest point. Both meshes need triangles of positive area.
SurfaceError CompareSurfaces(const TriangleMesh& mesh,
                             const TriangleMesh& truth,
                             int samples,
                             unsigned seed);

}  // namespace sweepfit
