// SPDX-License-Identifier: Apache-2.0
#include "experiments/evaluate.h"

#include <cstdio>
#include <memory>
#include <string>

#include "apps/runtime.h"
#include "apps/verbs.h"
#include "capture/capture.h"
#include "model/file_io.h"

namespace sweepfit {
namespace {

struct EvaluateArguments {
  CommonArguments common;
  std::string result;
  std::string capture;
  std::string json;
  EvaluateOptions options;
};

void RunEvaluate(const EvaluateArguments& arguments) {
  Runtime runtime(arguments.common);
  const Capture capture = LoadCapture(arguments.capture);
  const Evaluation evaluation = EvaluateResult(
      capture, arguments.result, arguments.options, runtime.progress());
  runtime.progress()->Clear();
  if (!arguments.json.empty()) {
    WriteWholeFile(EvaluationToJson(evaluation).dump(1) + "\n", arguments.json);
  }
  if (!runtime.quiet()) {
    std::fputs(EvaluationTable(evaluation).c_str(), stdout);
  }
}

}  // namespace

void AddEvaluateVerb(CLI::App* command, std::function<void()>* run) {
  CLI::App* verb = command->add_subcommand(
      "evaluate", "Score a result folder against its capture");
  auto arguments = std::make_shared<EvaluateArguments>();
  verb->add_option("RESULT", arguments->result, "Result folder of fit")
      ->required();
  verb->add_option("--capture", arguments->capture, "Capture folder")
      ->required();
  verb->add_flag("--truth",
                 arguments->options.truth,
                 "Compare joints and surface with the capture's ground truth");
  verb->add_option("--json", arguments->json, "Write the scores to this file");
  AddCommonArguments(verb, &arguments->common);
  verb->footer(
      "Example: sweepfit evaluate results/anna --capture captures/anna "
      "--truth");
  verb->callback(
      [arguments, run] { *run = [arguments] { RunEvaluate(*arguments); }; });
}

}  // namespace sweepfit
