// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "capture/silhouette.h"
#include "model/body.h"
#include "solver/inner_contour.h"
#include "solver/joints.h"
#include "solver/photo_evidence.h"
#include "solver/rim_evidence.h"
#include "volume/volume.h"

namespace sweepfit {

// What is known of one pose when the body is fitted to it.
struct PoseEvidence {
  const std::vector<View>* views;
  const std::vector<ObservedContour>* contours;  // one per view
  const Volume* volume;
  const LandmarkResult* landmarks;
  const PhotoEvidence* photo = nullptr;  // none: outlines and hull only
  // One per view; null: what is inside the outlines does not count.
  const std::vector<InnerContour>* inner = nullptr;
  OutlineOptions outlines = {};
};

// The rims of the body in one pose and their partners on the outlines, which
// are looked for within `reach_pixels`.
RimEvidence GatherRims(const PoseEvidence& evidence,
                       const PosedBody& posed,
                       const Body& body,
                       double reach_pixels);

// What the pictures of one pose show inside the outlines.
struct PictureMatches {
  PhotoMatches photo;
  std::vector<ContourPair> inner;
};
// How far about the body that is looked for.
struct MatchReach {
  double photo;              // metres
  double photo_step_pixels;  // in such steps
  double inner;              // metres
};
// About the body as it stands in every pose. Per pose; empty where there is
// nothing to match.
std::vector<PictureMatches> MatchPictures(
    const std::vector<PoseEvidence>& evidence,
    const std::vector<PosedBody>& posed,
    const Body& body,
    const MatchReach& reach);

// The body in every pose.
std::vector<PosedBody> PoseAll(const JointResult& joints, const Body& body);

// The body as it stands in every pose, its rims, and the mean distance of its
// outline from the silhouettes over all poses, metres.
struct StandingBody {
  std::vector<PosedBody> posed;
  std::vector<RimEvidence> rims;
  double rim_error = 0;
};
// Outlines are matched within `reach_pixels`.
StandingBody Stand(const std::vector<PoseEvidence>& evidence,
                   const JointResult& joints,
                   const Body& body,
                   double reach_pixels);

}  // namespace sweepfit
