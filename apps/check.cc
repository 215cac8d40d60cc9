// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <string>

#include "apps/runtime.h"
#include "apps/verbs.h"
#include "capture/capture.h"
#include "experiments/check_capture.h"
#include "model/file_io.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

struct CheckArguments {
  CommonArguments common;
  std::string capture;
  std::string json;
  ConfigArguments config;
};

void RunCheck(const CheckArguments& arguments) {
  Runtime runtime(arguments.common);
  const FitConfig config = ReadConfig(arguments.config);
  if (const auto error = config.options.Check()) {
    throw InputError("configuration: " + *error);
  }
  const CaptureCheck check = CheckCapture(LoadCapture(arguments.capture),
                                          config.options.segment,
                                          runtime.progress());
  runtime.progress()->Clear();
  if (!arguments.json.empty()) {
    WriteWholeFile(CheckToJson(check).dump(1) + "\n", arguments.json);
  }
  if (!runtime.quiet()) std::fputs(CheckTable(check).c_str(), stdout);
  std::fflush(stdout);
  if (!check.CanWork()) {
    throw FitError(arguments.capture +
                   ": this capture cannot work: " + check.failures.front());
  }
}

}  // namespace

void AddCheckVerb(CLI::App* command, std::function<void()>* run) {
  CLI::App* verb = command->add_subcommand(
      "check", "Say whether a capture can work, before any fit");
  auto arguments = std::make_shared<CheckArguments>();
  verb->add_option("CAPTURE", arguments->capture, "Folder with capture.yaml")
      ->required();
  verb->add_option(
      "--json", arguments->json, "Write the findings to this file");
  AddConfigArguments(verb, &arguments->config);
  AddCommonArguments(verb, &arguments->common);
  verb->footer(
      "Example: sweepfit check captures/anna\n\n"
      "Of the configuration counts how a fit finds the silhouettes: segment.* "
      "(see sweepfit fit --help).");
  verb->callback(
      [arguments, run] { *run = [arguments] { RunCheck(*arguments); }; });
}

}  // namespace sweepfit
