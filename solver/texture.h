// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "capture/silhouette.h"
#include "model/body.h"

namespace sweepfit {

struct TextureOptions {
  int size = 2048;  // texels along each side of the atlas
  // How far the light that a green or blue screen throws on the person is taken
  // off, 0 to 1.
  double despill = 1;
  std::optional<std::string> Check() const;
};

struct Texture {
  cv::Mat3b atlas;       // BGR, gutters filled
  cv::Mat1f confidence;  // 0: no camera saw this texel
};

// Back-projects the views of all poses onto the atlas. views[p] shows the body
// in vertices[p] (world).
Texture SolveTexture(
    const Body& body,
    const std::vector<std::vector<Eigen::Vector3d>>& vertices_in_world,
    const std::vector<std::vector<View>>& views,
    const TextureOptions& options,
    Progress* progress,
    StageSummary* summary);

}  // namespace sweepfit
