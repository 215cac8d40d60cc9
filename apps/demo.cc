// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "apps/runtime.h"
#include "apps/summary.h"
#include "apps/synth.h"
#include "apps/verbs.h"
#include "experiments/evaluate.h"
#include "experiments/fit_to_folder.h"
#include "model/file_io.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

struct DemoArguments {
  CommonArguments common;
  std::string out = "sweepfit-demo";
  SyntheticOptions synthetic;
};

void CreateFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw InputError(folder.string() +
                     ": cannot write there: " + error.message());
  }
}

void RunDemo(const DemoArguments& arguments) {
  Runtime runtime(arguments.common);
  const fs::path out = arguments.out;
  CreateFolder(out);
  const Capture capture = MakeSyntheticCapture(
      out / "capture", arguments.synthetic, runtime.progress());
  const nlohmann::ordered_json report =
      FitToFolder(capture, FitConfig(), out / "result", runtime.progress());
  EvaluateOptions options;
  options.truth = true;
  const Evaluation evaluation =
      EvaluateResult(capture, out / "result", options, runtime.progress());
  WriteWholeFile(EvaluationTable(evaluation), (out / "accuracy.txt").string());
  WriteWholeFile(EvaluationToJson(evaluation).dump(1) + "\n",
                 (out / "accuracy.json").string());
  runtime.progress()->Clear();
  if (runtime.quiet()) return;
  std::fputs(EvaluationTable(evaluation).c_str(), stdout);
  std::printf("\n%saccuracy: %s\n",
              FitSummary(report, out / "result").c_str(),
              (out / "accuracy.txt").c_str());
}

}  // namespace

void AddDemoVerb(CLI::App* command, std::function<void()>* run) {
  CLI::App* verb = command->add_subcommand(
      "demo",
      "Make a synthetic person, fit it, and compare with the ground truth");
  auto arguments = std::make_shared<DemoArguments>();
  verb->add_option("--out", arguments->out, "Folder for capture and result")
      ->capture_default_str();
  verb->add_option(
          "--seed,--subject", arguments->synthetic.seed, "Number of the person")
      ->capture_default_str();
  AddCommonArguments(verb, &arguments->common);
  verb->footer("Example: sweepfit demo --out demo");
  verb->callback(
      [arguments, run] { *run = [arguments] { RunDemo(*arguments); }; });
}

}  // namespace sweepfit
