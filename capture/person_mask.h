// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "capture/background.h"
#include "capture/silhouette.h"

namespace sweepfit {

// Roughly where the person is, in a small version of the picture: hysteresis on
// the likelihood ratio of an even colour to the background, the largest
// component and what lies near it. Shadows in doubt are part of it. Non-zero:
// person.
cv::Mat1b RoughPerson(const BackgroundEvidence& evidence,
                      const SegmentOptions& options);

// The person as a yes-or-no mask (255: person): the minimum cut of
//   sum_p ln(p_background / p_person) [p is person] + sum_pq w_pq [p is, q not]
// where the colours of the person near p are learnt from what is certain to be
// person, and w_pq = smoothness exp(-c^2 / 2 s^2) falls with the contrast c of
// the neighbours p and q. A contrast counts when both the picture and its
// change against the background have it: edges of the plate are no outline.
// Gaps that show the background stay open. Components far from the person are
// dropped; `stray` (may be null) tells their area as a share of the person's.
cv::Mat1b PersonMask(const BackgroundEvidence& evidence,
                     const SegmentOptions& options,
                     double* stray);

}  // namespace sweepfit
