// SPDX-License-Identifier: Apache-2.0
#include "experiments/experiment.h"

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "apps/runtime.h"
#include "apps/verbs.h"
#include "experiments/experiment_runner.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

struct ExperimentArguments {
  CommonArguments common;
  std::string config;
  std::string folder;
  std::vector<std::string> captures;
  std::string shard = "0/1";
};

ExperimentShard ParseShard(const std::string& text) {
  ExperimentShard shard;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%d/%d%c", &shard.index, &shard.count, &rest) !=
          2 ||
      shard.count < 1 || shard.index < 0 || shard.index >= shard.count) {
    throw InputError("--shard " + text + ": must be i/n with 0 <= i < n");
  }
  return shard;
}

void Report(const std::string& folder, const Runtime& runtime) {
  ReportExperiment(folder);
  if (!runtime.quiet()) {
    std::printf("report: %s/report.html\ntable:  %s/report.md\n",
                folder.c_str(),
                folder.c_str());
  }
}

void RunRun(const ExperimentArguments& arguments) {
  Runtime runtime(arguments.common);
  const ExperimentShard shard = ParseShard(arguments.shard);
  Experiment experiment = LoadExperiment(arguments.config);
  if (!arguments.captures.empty()) {
    UseCaptures({arguments.captures.begin(), arguments.captures.end()},
                &experiment);
  }
  RunExperiment(experiment, arguments.folder, shard, runtime.progress());
  runtime.progress()->Clear();
  if (shard.count == 1) Report(arguments.folder, runtime);
}

void RunReport(const ExperimentArguments& arguments) {
  Runtime runtime(arguments.common);
  Report(arguments.folder, runtime);
}

}  // namespace

void AddExperimentVerb(CLI::App* command, std::function<void()>* run) {
  CLI::App* verb = command->add_subcommand(
      "experiment", "Compare configurations on people with ground truth");
  verb->require_subcommand(1);
  verb->footer(
      "Example: sweepfit experiment run experiments/configs/ablation.yaml "
      "--out ablation");
  auto arguments = std::make_shared<ExperimentArguments>();

  CLI::App* go = verb->add_subcommand(
      "run", "Fit every subject with every variant; goes on where it stopped");
  go->add_option("CONFIG", arguments->config, "The experiment (YAML)")
      ->required();
  go->add_option("--out", arguments->folder, "Folder of its runs")->required();
  go->add_option("--captures",
                 arguments->captures,
                 "Captures with ground truth, or folders of such, instead of "
                 "the experiment's own subjects")
      ->expected(1, -1);
  go->add_option("--shard",
                 arguments->shard,
                 "i/n: only every n-th run, beginning with the i-th; report "
                 "when all shards are done")
      ->capture_default_str();
  AddCommonArguments(go, &arguments->common);
  go->footer(
      "Example: sweepfit experiment run experiments/configs/baselines.yaml "
      "--out baselines --captures captures");
  go->callback(
      [arguments, run] { *run = [arguments] { RunRun(*arguments); }; });

  CLI::App* report = verb->add_subcommand(
      "report", "Tables and pages from the runs there are");
  report->add_option("DIR", arguments->folder, "Folder of the runs")
      ->required();
  AddCommonArguments(report, &arguments->common);
  report->footer("Example: sweepfit experiment report ablation");
  report->callback(
      [arguments, run] { *run = [arguments] { RunReport(*arguments); }; });
}

}  // namespace sweepfit
