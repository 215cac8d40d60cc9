// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "model/template_topology.h"

namespace sweepfit {

// Texture coordinates of every quad corner of the whole mesh (left half first,
// as in MirrorComplex), [0,1]^2, v up. Every chart is unrolled onto a
// rectangle by the mean lengths of its rows and columns of edges; rectangles
// are packed on shelves with a gutter of 16/2048 between them.
std::vector<std::array<Eigen::Vector2f, 4>> UnrollCharts(
    const HalfComplex& half, const std::vector<Eigen::Vector3d>& half_vertices);

}  // namespace sweepfit
