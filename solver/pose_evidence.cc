// SPDX-License-Identifier: Apache-2.0
#include "solver/pose_evidence.h"

namespace sweepfit {

std::vector<PictureMatches> MatchPictures(
    const std::vector<PoseEvidence>& evidence,
    const JointResult& joints,
    const Body& body,
    const MatchReach& reach) {
  std::vector<PictureMatches> matches(evidence.size());
  for (size_t p = 0; p < evidence.size(); ++p) {
    if (evidence[p].photo == nullptr && evidence[p].inner == nullptr) continue;
    const PosedBody posed = PoseForFit(body, joints.poses[p].pose);
    const RayScene scene(posed.mesh);
    if (evidence[p].photo != nullptr) {
      matches[p].photo = evidence[p].photo->Match(posed,
                                                  scene,
                                                  body.topology.quads,
                                                  reach.photo,
                                                  reach.photo_step_pixels);
    }
    if (evidence[p].inner != nullptr) {
      matches[p].inner = MatchInnerContours(
          *evidence[p].inner, posed, body.topology, scene, reach.inner);
    }
  }
  return matches;
}

RimEvidence GatherRims(const PoseEvidence& evidence,
                       const PosedBody& posed,
                       const Body& body,
                       double reach_pixels) {
  return GatherRimEvidence(posed,
                           body.topology.quads,
                           *evidence.views,
                           *evidence.contours,
                           reach_pixels,
                           evidence.outlines);
}

StandingBody Stand(const std::vector<PoseEvidence>& evidence,
                   const JointResult& joints,
                   const Body& body,
                   double reach_pixels) {
  StandingBody standing;
  for (size_t p = 0; p < evidence.size(); ++p) {
    standing.posed.push_back(PoseForFit(body, joints.poses[p].pose));
    standing.rims.push_back(
        GatherRims(evidence[p], standing.posed[p], body, reach_pixels));
    standing.rim_error += MeanRimError(standing.rims[p], *evidence[p].views) /
                          static_cast<double>(evidence.size());
  }
  return standing;
}

}  // namespace sweepfit
