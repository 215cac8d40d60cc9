// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_keypoints.h"

#include <map>
#include <string>

#include "solver/landmark_triangulation.h"

namespace sweepfit {

std::vector<Landmark3> TriangulateKeypoints(
    const std::vector<View>& views,
    const std::vector<Keypoint2>& keypoints,
    std::vector<Landmark2>* points) {
  // What an annotator calls a joint lies about this far from ours, metres.
  constexpr double kAnatomySigma = 0.012;
  struct Seen {
    std::vector<PointObservation> observations;
    std::vector<const Keypoint2*> keypoints;
  };
  std::map<std::string, Seen> seen_by_name;
  for (const Keypoint2& keypoint : keypoints) {
    for (const View& view : views) {
      if (view.camera.id != keypoint.camera_id) continue;
      Seen& seen = seen_by_name[keypoint.name];
      seen.keypoints.push_back(&keypoint);
      seen.observations.push_back({&view.camera,
                                   view.camera.Undistort(keypoint.pixel),
                                   Eigen::Vector2d::UnitX(),
                                   keypoint.sigma,
                                   keypoint.sigma});
    }
  }
  std::vector<Landmark3> landmarks;
  for (const auto& [name, seen] : seen_by_name) {
    const auto found = TriangulatePoint(seen.observations, std::nullopt);
    if (!found) continue;
    Landmark3 landmark;
    landmark.name = name;
    landmark.joint = FindJoint(name);
    landmark.point_in_world = found->point_in_world;
    landmark.covariance = found->covariance + kAnatomySigma * kAnatomySigma *
                                                  Eigen::Matrix3d::Identity();
    landmark.num_views = found->num_views;
    landmark.source = "keypoint";
    landmarks.push_back(std::move(landmark));
    for (size_t i = 0; i < seen.keypoints.size(); ++i) {
      if (!found->agrees[i]) continue;
      const Keypoint2& keypoint = *seen.keypoints[i];
      points->push_back(
          {keypoint.camera_id,
           name,
           keypoint.pixel,
           keypoint.sigma * keypoint.sigma * Eigen::Matrix2d::Identity(),
           "keypoint"});
    }
  }
  return landmarks;
}

}  // namespace sweepfit
