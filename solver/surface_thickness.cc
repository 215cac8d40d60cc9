// SPDX-License-Identifier: Apache-2.0
#include "solver/surface_thickness.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace sweepfit {

std::vector<double> SurfaceThickness(
    const RayScene& scene,
    const std::vector<Eigen::Vector3d>& vertices,
    const std::vector<Eigen::Vector3d>& unit_normals) {
  constexpr double kSkip = 1e-4;  // metres, past the vertex's own faces
  std::vector<double> thickness(vertices.size(), kMostThickness);
  tbb::parallel_for(size_t{0}, vertices.size(), [&](size_t v) {
    const RayScene::Hit hit = scene.Intersect(
        vertices[v] - kSkip * unit_normals[v], -unit_normals[v]);
    if (hit.triangle >= 0) {
      thickness[v] = std::min(kSkip + hit.distance, kMostThickness);
    }
  });
  return thickness;
}

}  // namespace sweepfit
