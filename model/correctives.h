// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "model/body.h"
#include "model/lbs.h"

namespace sweepfit {

struct CorrectiveOptions {
  // Metres: as many targets are made as this error over all vertices and keys
  // needs, but not more than `max_targets` (one more holds the mean).
  double rms = 0.001;
  int max_targets = 8;
  // A clip that skinning alone follows this closely needs none, metres.
  double negligible_rms = 0.0003;
};

// What linear blend skinning lacks of the sweep deformation in one clip, as
// morph targets: offsets added to the rest vertices before skinning. Weights
// are within 0 and 1, as some programs clamp them.
struct Correctives {
  std::vector<std::vector<Eigen::Vector3d>> target;  // per target and vertex
  std::vector<std::vector<double>> weight;           // per key and target
  // Skinning against sweeps over all vertices and keys, metres, without and
  // with the targets.
  double rms_without = 0, max_without = 0;
  double rms_with = 0, max_with = 0;
};

// The offsets delta = (sum_b w_b R_b)^-1 (x_sweep - x_skinned) of all keys are
// projected on their principal components. `deformer` is that of the body.
Correctives BakeCorrectives(const Body& body,
                            const BodyDeformer& deformer,
                            const SkinWeights& weights,
                            const std::vector<Pose>& keys,
                            const CorrectiveOptions& options);

}  // namespace sweepfit
