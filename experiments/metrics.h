// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "model/mesh.h"
#include "model/skeleton.h"

namespace sweepfit {

// Overlap and boundary distance of two soft masks (coverage 0..1).
struct SilhouetteError {
  double iou = 0;              // sum min / sum max
  double boundary_mean = 0;    // px, symmetric, between the 0.5 levels
  double boundary_p95 = 0;
  double signed_mean = 0;      // px, positive: the first mask is larger
};
SilhouetteError CompareMasks(const cv::Mat1f& mask, const cv::Mat1f& truth);

struct JointError {
  double mpjpe = 0;            // metres, all joints
  double limb_mpjpe = 0;       // shoulders, elbows, wrists, hips, knees, ankles
  double pa_mpjpe = 0;         // after a similarity alignment
  double bone_length_mae = 0;  // metres
  std::array<double, kNumJoints> per_joint{};
};
using JointPositions = std::array<Eigen::Vector3d, kNumJoints>;
JointError CompareJoints(const JointPositions& joints,
                         const JointPositions& truth);

struct SurfaceError {
  double mean = 0, median = 0, p95 = 0, max = 0;  // metres
  double signed_mean = 0;                         // positive: outside
};
// Exact point-to-triangle distances of `samples` area-weighted points (seeded)
// of `mesh` to `truth`.
SurfaceError CompareSurfaces(const TriangleMesh& mesh,
                             const TriangleMesh& truth,
                             int samples,
                             unsigned seed);

}  // namespace sweepfit
