// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "experiments/synthetic.h"
#include "solver/config.h"

namespace sweepfit {

// One person of an experiment: a capture folder with ground truth, or options
// from which one is made.
struct ExperimentSubject {
  std::string name;
  std::filesystem::path capture;  // empty for synthetic people
  std::optional<SyntheticOptions> synthetic;
};

// One configuration to compare.
struct ExperimentVariant {
  std::string name;
  std::vector<std::string> settings;  // "key=value", in order
  FitConfig config;
};

// Every subject is fitted with every variant; the first variant is what the
// others are compared with.
struct Experiment {
  std::string name;
  std::string question;  // what it is to find out, for the report
  bool poses_together = false;
  std::vector<ExperimentSubject> subjects;
  std::vector<ExperimentVariant> variants;
};

// Reads an experiment:
//
//   name: weights
//   question: Does the table of bone lengths help?     # optional
//   poses: each                   # or together: all poses in one fit
//   subjects:
//     - capture: ../captures/anna       # relative to this file
//     - synthetic: {seeds: [1, 20], poses: [A], cameras: 16, size: 800,
//                   masks: true}        # seeds: first and last
//   settings: {until: refine}     # optional, for all variants
//   variants:                     # the first is the reference
//     default: {}
//     no_tables: {joints.weights.anthropometric: 0}
//   grid:                         # optional: every variant at every point
//     volume.voxel_size: [0.004, 0.008]
//
// InputError with "file:line:" on malformed YAML, unknown keys, and settings
// that a fit would refuse.
Experiment LoadExperiment(const std::filesystem::path& path);

// Replaces the subjects by captures with ground truth; a folder is one or holds
// some.
void UseCaptures(const std::vector<std::filesystem::path>& folders,
                 Experiment* experiment);

}  // namespace sweepfit
