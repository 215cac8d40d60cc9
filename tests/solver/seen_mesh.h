// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "capture/render.h"
#include "capture/silhouette.h"
#include "solver/rim_evidence.h"
#include "tests/volume/capsule_person.h"

namespace sweepfit::testing {

// A mesh before grey, as square views show it from places around it, with its
// exact silhouettes.
struct SeenMesh {
  std::vector<View> views;
  std::vector<ObservedContour> contours;
};

inline SeenMesh SeeMesh(const TriangleMesh& mesh,
                        const std::vector<Eigen::Vector3d>& places,
                        double focal_length,
                        int size) {
  constexpr double kSpacing = 6;  // pixels
  SeenMesh seen;
  for (const Eigen::Vector3d& place : places) {
    View view;
    view.camera = LookAt("camera" + std::to_string(seen.views.size()),
                         place,
                         {0, 0.9, 0},
                         focal_length,
                         size);
    view.coverage = RenderCoverage(view.camera, mesh);
    view.image = cv::Mat3b(size, size, cv::Vec3b(128, 128, 128));
    view.signed_distance = SignedDistance(view.camera, view.coverage);
    seen.contours.push_back(ObserveContour(view, kSpacing));
    seen.views.push_back(std::move(view));
  }
  return seen;
}

}  // namespace sweepfit::testing
