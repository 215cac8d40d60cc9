// SPDX-License-Identifier: Apache-2.0
#include "model/skin_candidates.h"

#include <algorithm>
#include <cmath>

namespace sweepfit {
namespace {

bool HasChildren(int joint) {
  for (int child = joint + 1; child < kNumJoints; ++child) {
    if (kJointParents[child] == joint) return true;
  }
  return false;
}

}  // namespace

SkinCandidates FindSkinCandidates(const Body& body,
                                  const std::vector<HelperJoint>& helpers,
                                  int vertex) {
  // Parameters of distance that halve the score.
  constexpr double kNear = 0.1;
  // Beyond so many parameters a joint does not matter.
  constexpr double kReach = 1.2;
  // A helper that rides on skin matters only near it.
  constexpr double kSkinReach = 0.6;
  std::array<double, kMaxSkinJoints> score{};
  const auto& attachments = body.binding[vertex].attachment;
  for (const SweepAttachment& attachment : attachments) {
    if (attachment.sweep < 0 || attachment.weight <= 0) continue;
    const Sweep& sweep = body.sweeps[attachment.sweep];
    const int num_bones = sweep.num_bones();
    for (int bone = -1; bone <= num_bones; ++bone) {
      const int joint =
          bone < 0 ? kJointParents[sweep.chain[0]] : sweep.chain[bone];
      if (joint < 0 || !HasChildren(joint)) continue;
      // Distance from u to the bone's range [bone, bone + 1].
      const double distance =
          std::max({0.0, bone - attachment.u, attachment.u - (bone + 1)});
      if (distance > kReach) continue;
      score[joint] += attachment.weight / (kNear + distance);
    }
  }
  for (std::size_t h = 0; h < helpers.size(); ++h) {
    const double reach = helpers[h].skin.empty() ? kReach : kSkinReach;
    double lowest = 1e9;
    for (const HelperJoint::Source& source : helpers[h].sources) {
      double here = 0;
      for (const SweepAttachment& attachment : attachments) {
        if (attachment.sweep != source.sweep || attachment.weight <= 0) {
          continue;
        }
        const double distance = helpers[h].sources.size() > 1
                                    ? 0
                                    : std::abs(attachment.u - source.u);
        if (distance <= reach) here += attachment.weight / (kNear + distance);
      }
      lowest = std::min(lowest, here);
    }
    score[kNumJoints + h] = lowest;
  }
  std::vector<int> order;
  for (int j = 0; j < kMaxSkinJoints; ++j) {
    if (score[j] > 0) order.push_back(j);
  }
  std::stable_sort(order.begin(), order.end(), [&score](int a, int b) {
    return score[a] > score[b];
  });
  if (order.empty()) order.push_back(kRoot);  // loose ends
  SkinCandidates candidates;
  candidates.count =
      static_cast<int>(std::min<std::size_t>(kMaxSimplexSize, order.size()));
  std::copy_n(order.begin(), candidates.count, candidates.joint.begin());
  return candidates;
}

}  // namespace sweepfit
