// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "model/body.h"

namespace sweepfit {

// Gives the two tubes of ToyBody(rings_per_tube) one chart each, cut open along
// a seam: the trunk on the left half of the atlas, the arm on the right. The
// end caps lie in strips below and above.
inline void AssignToyUv(int rings_per_tube, Body* body) {
  constexpr int kRing = 16;
  const int side_quads = (rings_per_tube - 1) * kRing;
  const int tube_quads = side_quads + kRing;
  for (int q = 0; q < static_cast<int>(body->topology.quads.size()); ++q) {
    const float left = q < tube_quads ? 0.02f : 0.52f;
    const int index = q % tube_quads;
    const auto uv = [&](int ring, int column) {
      return Eigen::Vector2f(left + 0.46f * column / kRing,
                             0.12f + 0.76f * ring / (rings_per_tube - 1));
    };
    auto& corners = body->topology.uv[q];
    if (index < side_quads) {
      const int ring = index / kRing;
      const int column = index % kRing;
      corners = {uv(ring, column),
                 uv(ring, column + 1),
                 uv(ring + 1, column + 1),
                 uv(ring + 1, column)};
      continue;
    }
    const int cap = index - side_quads;  // alternately below and above
    const float x = left + 0.46f * (cap / 2) / (kRing / 2);
    const float y = cap % 2 == 0 ? 0.03f : 0.91f;
    const float width = 0.8f * 0.46f / (kRing / 2);
    corners = {Eigen::Vector2f(x, y),
               Eigen::Vector2f(x + width, y),
               Eigen::Vector2f(x + width, y + 0.06f),
               Eigen::Vector2f(x, y + 0.06f)};
  }
}

}  // namespace sweepfit
