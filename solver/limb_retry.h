// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "solver/fit_body.h"

namespace sweepfit {

// What a global fit starts from and what it leaves.
struct GlobalFit {
  Body body;
  JointResult joints;
  StageSummary summary;
};

// Few cameras leave false limbs in the hull, and limbs that hide each other. A
// landmark on one of those is sure of itself and wrong, and the outlines that
// the true limb would explain are left over. Where that is so in a pose, its
// limbs are tried one after the other, the worst first, with the other side's
// posture, mirrored, as a guess in place of their landmarks (compare the
// recovery of limbs by local optimisation in Gall et al. 2009); what explains
// the outlines clearly better is kept. `start` are the joints as estimated from
// the landmarks, from the lengths of `template_body` and `stature`: the fit's
// own may have followed another limb's outline. Changes the landmarks
// of the limbs that are kept, the fit, and its summary's warnings; landmarks
// are those that `evidence` points to, pose by pose.
void RetryLimbs(const std::vector<PoseEvidence>& evidence,
                const GlobalOptions& options,
                const JointOptions& joint_options,
                const Body& template_body,
                double stature,
                JointResult start,
                std::vector<LandmarkResult>* landmarks,
                GlobalFit* fit);

}  // namespace sweepfit
