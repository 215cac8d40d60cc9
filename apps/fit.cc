// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "apps/runtime.h"
#include "apps/summary.h"
#include "apps/verbs.h"
#include "capture/capture.h"
#include "experiments/fit_to_folder.h"
#include "solver/config.h"

namespace sweepfit {
namespace {

struct FitArguments {
  CommonArguments common;
  std::string capture;
  std::string out;
  ConfigArguments config;
  std::vector<std::string> poses;
  std::vector<std::string> cameras;
  std::string until;
  std::string template_file;
};

// What has an argument of its own comes last.
FitConfig ReadFitConfig(const FitArguments& arguments) {
  FitConfig config = ReadConfig(arguments.config);
  if (!arguments.poses.empty()) config.poses = arguments.poses;
  if (!arguments.cameras.empty()) config.cameras = arguments.cameras;
  if (!arguments.until.empty()) config.options.until = arguments.until;
  if (!arguments.template_file.empty()) {
    config.options.body_template.file = arguments.template_file;
  }
  return config;
}

void RunFit(const FitArguments& arguments) {
  Runtime runtime(arguments.common);
  const FitConfig config = ReadFitConfig(arguments);
  const Capture capture = LoadCapture(arguments.capture);
  const nlohmann::ordered_json report =
      FitToFolder(capture, config, arguments.out, runtime.progress());
  runtime.progress()->Clear();
  if (!runtime.quiet()) {
    std::fputs(FitSummary(report, arguments.out).c_str(), stdout);
  }
}

std::string Footer() {
  std::string text =
      "Example: sweepfit fit captures/anna --out results/anna --poses A,T\n\n"
      "Configuration keys for --config and --set, with their defaults:\n";
  for (const ConfigKey& key : ConfigKeys()) {
    std::string line = "  " + key.key + "=" + key.default_value;
    line.resize(std::max<size_t>(line.size() + 2, 42), ' ');
    text += line + key.meaning + "\n";
  }
  text += "Stages for --until:";
  for (const std::string_view stage : kFitStages) {
    text += " " + std::string(stage);
  }
  return text;
}

}  // namespace

void AddFitVerb(CLI::App* command, std::function<void()>* run) {
  CLI::App* verb = command->add_subcommand(
      "fit", "Fit a body to a capture folder and write a result folder");
  auto arguments = std::make_shared<FitArguments>();
  verb->add_option("CAPTURE", arguments->capture, "Folder with capture.yaml")
      ->required();
  verb->add_option("--out", arguments->out, "Result folder")->required();
  AddConfigArguments(verb, &arguments->config);
  verb->add_option("--poses", arguments->poses, "Poses to fit (default: all)")
      ->delimiter(',');
  verb->add_option("--cameras",
                   arguments->cameras,
                   "Cameras to use, or all (default: all but holdout)")
      ->delimiter(',');
  verb->add_option("--template",
                   arguments->template_file,
                   "Start from this rigged, skinned person (.glb) instead of "
                   "the generic one; look at it first with 'sweepfit template "
                   "--from'; joint names: template.names below");
  verb->add_option("--until", arguments->until, "Last stage to run");
  AddCommonArguments(verb, &arguments->common);
  verb->footer(Footer());
  verb->callback(
      [arguments, run] { *run = [arguments] { RunFit(*arguments); }; });
}

}  // namespace sweepfit
