// SPDX-License-Identifier: Apache-2.0
#include "solver/pose_evidence.h"

namespace sweepfit {

std::vector<PictureMatches> MatchPictures(
    const std::vector<PoseEvidence>& evidence,
    const std::vector<PosedBody>& posed,
    const Body& body,
    const MatchReach& reach) {
  std::vector<PictureMatches> matches(evidence.size());
  for (size_t p = 0; p < evidence.size(); ++p) {
    if (evidence[p].photo == nullptr && evidence[p].inner == nullptr) continue;
    const RayScene scene(posed[p].mesh);
    if (evidence[p].photo != nullptr) {
      matches[p].photo = evidence[p].photo->Match(posed[p],
                                                  scene,
                                                  body.topology.quads,
                                                  reach.photo,
                                                  reach.photo_step_pixels);
    }
    if (evidence[p].inner != nullptr) {
      matches[p].inner = MatchInnerContours(
          *evidence[p].inner, posed[p], body.topology, scene, reach.inner);
    }
  }
  return matches;
}

std::vector<PosedBody> PoseAll(const JointResult& joints, const Body& body) {
  std::vector<PosedBody> posed;
  for (const JointEstimate& pose : joints.poses) {
    posed.push_back(PoseForFit(body, pose.pose));
  }
  return posed;
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
  standing.posed = PoseAll(joints, body);
  for (size_t p = 0; p < evidence.size(); ++p) {
    standing.rims.push_back(
        GatherRims(evidence[p], standing.posed[p], body, reach_pixels));
    standing.rim_error += MeanRimError(standing.rims[p], *evidence[p].views) /
                          static_cast<double>(evidence.size());
  }
  return standing;
}

}  // namespace sweepfit
