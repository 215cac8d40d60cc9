// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "capture/camera.h"
#include "model/mesh.h"

namespace sweepfit {

// A point of the mesh seen by a sample of a pixel.
struct SurfaceSample {
  int triangle = -1;
  Eigen::Vector3d weights;  // barycentric, perspective-correct
};

struct Drawing {
  cv::Mat1f coverage;  // share of the samples of each pixel, 0..1
  cv::Mat3f color;     // linear RGB times coverage
};

// Draws a mesh into the picture as taken (distorted) by a z-buffer with 3 x 3
// samples per pixel. Lens distortion is that of the projected vertices, so the
// triangles must be small. All of the mesh must lie in front of the camera.
Drawing DrawMesh(
    const Camera& camera,
    const TriangleMesh& mesh,
    const std::function<Eigen::Vector3d(const SurfaceSample&)>& shade);

}  // namespace sweepfit
