// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "capture/silhouette.h"
#include "experiments/metrics.h"
#include "model/skeleton.h"
#include "solver/landmarks.h"

namespace sweepfit {

// What is drawn over one picture.
struct OverlayContent {
  std::string pose;
  cv::Mat1f mesh_coverage;  // of the fitted mesh, as taken; may be empty
  SilhouetteError error;    // of the mesh against the silhouette
  const JointFrames* frames = nullptr;  // joints in the world; may be null
  // Landmarks of all views of the pose; those of this view are drawn. May be
  // null.
  const std::vector<Landmark2>* landmarks = nullptr;
};

// The picture, cut around the person and dimmed, with the boundary of the
// silhouette, the boundary of the fitted mesh, the bones (left and right in
// different colours), the landmarks found in it (crosses) and a legend with
// camera and scores.
cv::Mat3b DrawOverlay(const View& view, const OverlayContent& content);

// All pictures with their silhouettes bright on a dimmed surrounding: one row
// of small pictures per pose.
struct SheetRow {
  std::string pose;
  const std::vector<View>* views;
};
cv::Mat3b DrawSilhouetteSheet(const std::vector<SheetRow>& rows);

}  // namespace sweepfit
