// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "model/body.h"
#include "solver/joints.h"
#include "solver/pose_evidence.h"

namespace sweepfit {

struct GlobalOptions {
  // Rounds of finding the rim and solving; the basin is about 60 px wide in the
  // first and narrows to 20.
  int rounds = 4;
  // Standard deviation of a coarse body's outline, metres: first and last
  // round.
  double sigma_first = 0.012;
  double sigma_last = 0.005;
  bool retry_limbs = true;  // see RetryLimbs
  std::optional<std::string> Check() const;
};

struct LocalOptions {
  // rim: silhouettes and the one-sided hull decide the radii (least squares).
  // hull: radii sampled from the hull. paper: their difference ratio against
  // the template, times the feature weight.
  std::string mode = "rim";
  int rounds = 3;
  int rounds_two_outlines = 7;   // where views see fewer than three outlines
  double sigma_rim = 0.0015;     // metres
  double sigma_hull = 0.0015;    // metres beyond the hull
  double sigma_around = 0.1;     // second difference of q around a section
  double sigma_along = 0.2;      // and along the sweep
  double sigma_magnitude = 0.7;  // of q itself
  double sigma_symmetry = 0.01;  // of q between left and right
  std::optional<std::string> Check() const;
};

struct RefineOptions {
  bool enabled = true;
  int rounds = 3;
  double sigma_rim = 0.0015;      // metres
  double sigma_smooth = 0.001;    // metres, a vertex against its neighbours
  double sigma_magnitude = 0.03;  // metres
  double sigma_symmetry = 0.018;  // metres, left against right
  std::optional<std::string> Check() const;
};

// Global fit (paper IV.A and beyond): pose, bone lengths and a few coarse
// girths of the template's sweeps, all poses at once, from landmarks, tables
// and the silhouettes. The body comes with the lengths of joints->base and
// leaves with the fitted ones; joints is updated.
void FitGlobal(const std::vector<PoseEvidence>& evidence,
               const GlobalOptions& options,
               const JointOptions& joint_options,
               Body* body,
               JointResult* joints,
               StageSummary* summary);

// Local fit (paper IV.B): the radius functions of all sweeps, alternating with
// corrections of the poses. What the photographs match about the body counts
// for the pose first and then for the radii: with few cameras nothing else
// tells how far in front a limb or a shoulder is, and radii that made up for it
// would bulge.
void FitLocal(const std::vector<PoseEvidence>& evidence,
              const LocalOptions& options,
              const JointOptions& joint_options,
              Body* body,
              JointResult* joints,
              StageSummary* summary);

// Surface refinement (paper V): displacements of single vertices along their
// normals, by a sparse Cholesky factorisation, kept in section coordinates so
// that they move with the body. Each round matches the photographs anew, about
// the surface that the last one made. Left and right are tied loosely.
// `reference_rest`, the vertices at rest before the local fit: what sides they
// differ by stays, and what radii and displacements tore is last relaxed
// against them; see RelaxSurface.
void RefineSurface(const std::vector<PoseEvidence>& evidence,
                   const RefineOptions& options,
                   const std::vector<Eigen::Vector3d>& reference_rest,
                   const JointResult& joints,
                   Body* body,
                   StageSummary* summary);

}  // namespace sweepfit
