// SPDX-License-Identifier: Apache-2.0
#include "solver/pose_evidence.h"

namespace sweepfit {

std::vector<std::vector<PhotoPoint>> MatchPhotographs(
    const std::vector<PoseEvidence>& evidence,
    const JointResult& joints,
    const Body& body,
    double reach,
    double step_pixels) {
  std::vector<std::vector<PhotoPoint>> points(evidence.size());
  for (size_t p = 0; p < evidence.size(); ++p) {
    if (evidence[p].photo == nullptr) continue;
    points[p] = evidence[p].photo->Match(PoseForFit(body, joints.poses[p].pose),
                                         body.topology.quads,
                                         reach,
                                         step_pixels);
  }
  return points;
}

StandingBody Stand(const std::vector<PoseEvidence>& evidence,
                   const JointResult& joints,
                   const Body& body,
                   double reach_pixels) {
  StandingBody standing;
  for (size_t p = 0; p < evidence.size(); ++p) {
    standing.posed.push_back(PoseForFit(body, joints.poses[p].pose));
    standing.rims.push_back(GatherRimEvidence(standing.posed[p],
                                              body.topology.quads,
                                              *evidence[p].views,
                                              *evidence[p].contours,
                                              reach_pixels));
    standing.rim_error += MeanRimError(standing.rims[p], *evidence[p].views) /
                          static_cast<double>(evidence.size());
  }
  return standing;
}

}  // namespace sweepfit
