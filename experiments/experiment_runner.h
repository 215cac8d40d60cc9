// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "experiments/experiment.h"
#include "model/progress.h"

namespace sweepfit {

// Which of the runs to do, for several machines: run k belongs to shard
// k % count.
struct ExperimentShard {
  int index = 0;
  int count = 1;
};

// Fits every subject with every variant and scores it against the ground
// truth. Each run leaves DIR/runs/<id>.json, written whole or not at all: the
// settings, the scores per pose, what every stage said, times, version. A run
// whose file is there already is not done again, so that a broken experiment
// goes on where it stopped; `id` is a hash of the version (with the commit that
// it was built from), the subject (its capture.yaml or synthetic options), the
// variant's name and configuration, and the poses. Runs with other ids stay in
// the folder and out of the report. A variant that stops before the joints is
// scored by the surface of its volume. A fit that fails is a run with its
// reason, not an error. Synthetic captures are made in DIR/captures, anew for
// other options and another build. What the pictures show is found once for all
// variants that ask the same of them.
void RunExperiment(const Experiment& experiment,
                   const std::filesystem::path& folder,
                   const ExperimentShard& shard,
                   Progress* progress);

// Gathers the runs of the experiment that was last run in the folder:
// results.jsonl (a line per run), results.csv (a line per run and pose), and
// the comparison of the variants with the first one as report.md and
// report.html: means over the subjects, differences with 95 % intervals from a
// paired, seeded bootstrap over the subjects, and how many subjects got better.
// InputError when there is nothing to report.
void ReportExperiment(const std::filesystem::path& folder);

}  // namespace sweepfit
