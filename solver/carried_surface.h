// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "model/body.h"
#include "residuals/pose_point_cost.h"
#include "solver/rim_evidence.h"

namespace sweepfit {

// The sweep of the mirrored joints: itself for the trunk.
int MirrorSweep(const Body& body, int sweep);

// A few coarse girth parameters per sweep for the global fit: log ratios of
// radii as hats along the sweep times a harmonic around the section (0: size,
// 2: breadth against depth, 1: to the front or back). Left and right share a
// parameter.
class GirthBasis {
 public:
  explicit GirthBasis(const Body& body);

  int num_parameters() const { return static_cast<int>(names_.size()); }
  const std::vector<std::string>& names() const { return names_; }
  // Prior standard deviation of each parameter.
  const std::vector<double>& sigma() const { return sigma_; }

  // (parameter, d q / d g) of one sample (row * K + column) of a sweep.
  const std::vector<std::pair<int, double>>& OfSample(int sweep,
                                                      int sample) const {
    return samples_[sweep][sample];
  }

  // log_ratio = sum over parameters, replacing what was there.
  void Apply(const std::vector<double>& girth, Body* body) const;

 private:
  std::vector<std::string> names_;
  std::vector<double> sigma_;
  std::vector<std::vector<std::vector<std::pair<int, double>>>> samples_;
};

// How the posed vertex moves with joints, bone lengths and girths; exact at the
// given posture, see ShapedPoint. `basis` may be null (no girths); otherwise
// `rest_derivative` is RestByLogRatio of the vertex.
std::shared_ptr<const ShapedPoint> CarryVertex(
    const Body& body,
    const JointFrames& frames,
    const PosedBody& posed,
    int vertex,
    const GirthBasis* basis,
    const RestDerivative* rest_derivative,
    const std::vector<double>& girth);

}  // namespace sweepfit
