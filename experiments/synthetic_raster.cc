// SPDX-License-Identifier: Apache-2.0
#include "experiments/synthetic_raster.h"

#include <glog/logging.h>

#include <algorithm>
#include <cmath>

#include "experiments/synthetic_cameras.h"

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kSamples = 3;  // per pixel and axis

struct ProjectedVertex {
  Vector2d sample;  // coordinates on the grid of samples
  double depth;
};

double Cross(const Vector2d& a, const Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Weights of the corners at a point of the picture, affine in the picture; the
// sum is 1. False outside the triangle.
bool ScreenWeights(const ProjectedVertex& a,
                   const ProjectedVertex& b,
                   const ProjectedVertex& c,
                   const Vector2d& p,
                   Vector3d* weights) {
  const double area = Cross(b.sample - a.sample, c.sample - a.sample);
  if (area == 0) return false;
  const double wb = Cross(p - a.sample, c.sample - a.sample) / area;
  const double wc = Cross(b.sample - a.sample, p - a.sample) / area;
  *weights = {1 - wb - wc, wb, wc};
  return (weights->array() >= 0).all();
}

}  // namespace

Drawing DrawMesh(const Camera& camera,
                 const TriangleMesh& mesh,
                 const std::function<Vector3d(const SurfaceSample&)>& shade) {
  // Sample s lies at pixel (s + 0.5) / kSamples - 0.5.
  std::vector<ProjectedVertex> vertices;
  vertices.reserve(mesh.vertices.size());
  cv::Rect frame(0, 0, camera.width * kSamples, camera.height * kSamples);
  Vector2d low(frame.width, frame.height), high(0, 0);
  for (const Vector3d& v : mesh.vertices) {
    const Projection p = ProjectForDrawing(camera, v);
    CHECK_GT(p.depth, 0.05) << "the person stands in camera " << camera.id;
    vertices.push_back({(p.pixel.array() + 0.5) * kSamples - 0.5, p.depth});
    low = low.cwiseMin(vertices.back().sample);
    high = high.cwiseMax(vertices.back().sample);
  }
  const int left = std::max(0, static_cast<int>(std::floor(low.x())));
  const int top = std::max(0, static_cast<int>(std::floor(low.y())));
  const int right =
      std::min(frame.width - 1, static_cast<int>(std::ceil(high.x())));
  const int bottom =
      std::min(frame.height - 1, static_cast<int>(std::ceil(high.y())));
  Drawing drawing{cv::Mat1f(camera.height, camera.width, 0.0f),
                  cv::Mat3f(camera.height, camera.width, cv::Vec3f())};
  if (right < left || bottom < top) return drawing;

  cv::Mat1f inverse_depth(bottom - top + 1, right - left + 1, 0.0f);
  cv::Mat1i triangle(inverse_depth.size(), -1);
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    const ProjectedVertex &a = vertices[t[0]], &b = vertices[t[1]],
                          &c = vertices[t[2]];
    const Vector2d min = a.sample.cwiseMin(b.sample).cwiseMin(c.sample);
    const Vector2d max = a.sample.cwiseMax(b.sample).cwiseMax(c.sample);
    const int x1 = std::min(right, static_cast<int>(std::floor(max.x())));
    const int y1 = std::min(bottom, static_cast<int>(std::floor(max.y())));
    for (int y = std::max(top, static_cast<int>(std::ceil(min.y()))); y <= y1;
         ++y) {
      for (int x = std::max(left, static_cast<int>(std::ceil(min.x())));
           x <= x1;
           ++x) {
        Vector3d w;
        if (!ScreenWeights(a, b, c, Vector2d(x, y), &w)) continue;
        const float inverse = static_cast<float>(
            w[0] / a.depth + w[1] / b.depth + w[2] / c.depth);
        if (inverse > inverse_depth(y - top, x - left)) {
          inverse_depth(y - top, x - left) = inverse;
          triangle(y - top, x - left) = static_cast<int>(i);
        }
      }
    }
  }

  constexpr float kShare = 1.0f / (kSamples * kSamples);
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      const int index = triangle(y - top, x - left);
      if (index < 0) continue;
      const Triangle& t = mesh.triangles[index];
      const ProjectedVertex &a = vertices[t[0]], &b = vertices[t[1]],
                            &c = vertices[t[2]];
      Vector3d w;
      ScreenWeights(a, b, c, Vector2d(x, y), &w);
      w = w.cwiseQuotient(Vector3d(a.depth, b.depth, c.depth));
      const Vector3d color = shade({index, w / w.sum()});
      drawing.coverage(y / kSamples, x / kSamples) += kShare;
      drawing.color(y / kSamples, x / kSamples) +=
          kShare * cv::Vec3f(color.x(), color.y(), color.z());
    }
  }
  return drawing;
}

}  // namespace sweepfit
