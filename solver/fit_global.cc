// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "solver/carried_surface.h"
#include "solver/fit_body.h"
#include "solver/solve_person.h"

namespace sweepfit {

std::optional<std::string> GlobalOptions::Check() const {
  if (rounds < 1 || rounds > 50) return "global.rounds must be 1 to 50";
  if (!(sigma_first > 0) || !(sigma_last > 0)) {
    return "global.sigma_first and sigma_last must be positive";
  }
  return std::nullopt;
}

void FitGlobal(const std::vector<PoseEvidence>& evidence,
               const GlobalOptions& options,
               const JointOptions& joint_options,
               Body* body,
               JointResult* joints,
               StageSummary* summary) {
  const GirthBasis basis(*body);
  std::vector<double> girth(basis.num_parameters(), 0.0);
  SetBoneLengths(joints->skeleton.length, body);
  nlohmann::ordered_json report;
  bool usable = false;
  for (int round = 0; round < options.rounds; ++round) {
    const double t = options.rounds > 1 ? round / (options.rounds - 1.0) : 1.0;
    OutlineFit outline;
    outline.sigma = options.sigma_first *
                    std::pow(options.sigma_last / options.sigma_first, t);
    outline.max_distance = 60 - 40 * t;
    outline.max_iterations = 4;
    outline.stride = 3;
    const bool last = round + 1 == options.rounds;
    usable = SolvePerson(evidence,
                         outline,
                         {},
                         joint_options,
                         &basis,
                         &girth,
                         body,
                         joints,
                         last ? &report : nullptr);
  }
  summary->figures = report;
  summary->figures["rounds"] = options.rounds;
  nlohmann::ordered_json girths;
  for (int k = 0; k < basis.num_parameters(); ++k) {
    girths[basis.names()[k]] = std::exp(girth[k]);
  }
  summary->figures["girth_ratio"] = girths;
  summary->status = usable ? "ok" : "failed";
}

}  // namespace sweepfit
