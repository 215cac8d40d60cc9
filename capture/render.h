// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "capture/camera.h"
#include "model/mesh.h"

namespace sweepfit {

// A triangle mesh that can be looked at by rays (Embree). Thread-safe.
class RayScene {
 public:
  explicit RayScene(const TriangleMesh& mesh);
  ~RayScene();
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;

  struct Hit {
    int triangle = -1;      // -1: nothing hit
    double distance = 0;    // along the (unit) direction, metres
    double b1 = 0, b2 = 0;  // barycentric weights of the 2nd and 3rd vertex
  };
  Hit Intersect(const Eigen::Vector3d& origin,
                const Eigen::Vector3d& unit_direction,
                double min_distance = 0) const;
  // True when nothing lies between the point and the camera, leaving out the
  // last `tolerance` metres before the point.
  bool IsVisible(const Eigen::Vector3d& point_in_world,
                 const Eigen::Vector3d& camera_in_world,
                 double tolerance) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The part of a picture without distortion that shows the mesh, with a margin
// in pixels; all of it where the mesh comes near the camera's plane, since what
// is beside or behind a camera may show anywhere, or is not in the picture.
cv::Rect BoxOfMesh(const Camera& pinhole,
                   const TriangleMesh& mesh,
                   double margin);

// Share (0..1) of supersample^2 samples of every pixel, in the picture as taken
// (distorted), that the mesh covers.
cv::Mat1f RenderCoverage(const Camera& camera,
                         const TriangleMesh& mesh,
                         int supersample = 4);

// A shaded picture of the mesh for people: soft light from the camera, white
// background; `vertex_color` (BGR, may be empty) tints it.
cv::Mat3b RenderShaded(const Camera& camera,
                       const TriangleMesh& mesh,
                       const std::vector<cv::Vec3b>& vertex_color);
// The same in several colourings for little more than the price of one: what
// the rays meet is looked up once.
std::vector<cv::Mat3b> RenderColorings(
    const Camera& camera,
    const TriangleMesh& mesh,
    const std::vector<std::vector<cv::Vec3b>>& vertex_colors);

// A camera that looks at the mesh's bounding box from the given azimuth (0 =
// front, +Z; 90 = the subject's left, +X) and elevation, degrees.
Camera LookAtMesh(const TriangleMesh& mesh,
                  double azimuth_degrees,
                  double elevation_degrees,
                  int width,
                  int height);

}  // namespace sweepfit
