// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "capture/silhouette.h"
#include "model/skeleton.h"
#include "volume/volume.h"

namespace sweepfit {

// A point of the person found in one picture, in pixels as taken.
struct Landmark2 {
  std::string camera_id;
  std::string name;
  Eigen::Vector2d pixel;
  Eigen::Matrix2d covariance;  // square pixels
};

// A point of the person in the world.
struct Landmark3 {
  std::string name;  // "head_end", "l_wrist", "l_armpit", "crotch", ...
  // The joint this landmark speaks of; the offsets from the body's outside to
  // the joint centre are already applied.
  int joint = -1;
  Eigen::Vector3d point_in_world;
  Eigen::Matrix3d covariance;  // square metres
  int num_views = 0;           // pictures that agree
  std::string source;          // "contour", "volume", "keypoint"
};

struct LandmarkOptions {
  std::string mode = "multiview";
  std::optional<std::string> Check() const;
};

struct LandmarkResult {
  std::vector<Landmark2> points;     // per view
  std::vector<Landmark3> landmarks;  // one per joint at most
  // Horizontal unit vector the subject faces, and how sure that is (0..1).
  Eigen::Vector3d facing_in_world;
  double facing_confidence = 0;
  double floor_height = 0;  // y of the lowest point
  double stature = 0;       // upright height estimate, metres
  double stature_sigma = 0;
  // Limbs that are not safe, by name ("l_arm"), with the reason in the summary.
  std::vector<std::string> unsafe_limbs;

  const Landmark3* Find(std::string_view name) const;
};

// Finds head, hands and feet as geodesic extrema of the volume, decides front
// and back and so left and right, measures the contour landmarks (armpits,
// crotch, neck, wrists, ankles, knees, elbows) in every view that shows them,
// and triangulates.
LandmarkResult FindLandmarks(const std::vector<View>& views,
                             const Volume& volume,
                             const LandmarkOptions& options,
                             Progress* progress,
                             StageSummary* summary);

}  // namespace sweepfit
