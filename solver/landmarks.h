// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "capture/keypoints.h"
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
  std::string source;          // "contour" or "keypoint"
};

// A point of the person in the world.
struct Landmark3 {
  std::string name;  // "head_end", "l_wrist", "l_armpit", "crotch", ...
  // The joint this landmark speaks of; the offsets from the body's outside to
  // the joint centre are already applied. -1: a point of the outside that is
  // no joint (armpits, crotch, middle of the neck).
  int joint = -1;
  Eigen::Vector3d point_in_world;
  Eigen::Matrix3d covariance;  // square metres
  int num_views = 0;           // pictures that agree
  // What decided: "contour" (pictures), "volume", "both", "keypoint", or
  // "mirror" (the other side, see RetryLimbs).
  std::string source;
};

struct LandmarkOptions {
  // multiview: landmarks of the volume, refined and triangulated in all views.
  // paper: contour features of the most frontal and the most lateral view and
  // the linear map from picture to volume.
  std::string mode = "multiview";
  // File or folder of 2-D keypoints made elsewhere (LoadKeypoints), or none.
  std::string keypoints = "none";
  std::optional<std::string> Check() const;
};

struct LandmarkResult {
  std::vector<Landmark2> points;  // per view
  // Joints: found in the outline, at most one per joint, in the order of the
  // joints; keypoints made elsewhere follow and may speak of the same joints.
  std::vector<Landmark3> landmarks;
  // Points that are no joints: l_armpit, r_armpit, crotch, neck_middle.
  std::vector<Landmark3> features;
  // Horizontal unit vector the subject faces, and how sure that is (0..1).
  Eigen::Vector3d facing_in_world;
  double facing_confidence = 0;
  double floor_height = 0;  // y of the lowest point
  double stature = 0;       // upright height estimate, metres
  double stature_sigma = 0;
  // Limbs that are not safe, by name ("l_arm"), with the reason in the summary.
  std::vector<std::string> unsafe_limbs;

  // The first landmark or feature of this name.
  const Landmark3* Find(std::string_view name) const;
};

// Mode multiview: finds head, hands and feet as geodesic extrema of the volume,
// decides front and back and so left and right, measures the contour landmarks
// (tips, armpits, crotch, neck, wrists, ankles, knees, elbows) in every view
// that shows them, and triangulates. Mode paper: see landmark_paper.h.
// `keypoints`: those of this pose; they become further landmarks.
LandmarkResult FindLandmarks(const std::vector<View>& views,
                             const Volume& volume,
                             const std::vector<Keypoint2>& keypoints,
                             const LandmarkOptions& options,
                             Progress* progress,
                             StageSummary* summary);

}  // namespace sweepfit
