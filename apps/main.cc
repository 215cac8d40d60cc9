// SPDX-License-Identifier: Apache-2.0
//
// The command `sweepfit`. Exit status: 0 done, 1 the fit failed, 2 bad usage or
// bad input.
#include <glog/logging.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <functional>
#include <opencv2/core/utils/logger.hpp>

#include "apps/runtime.h"
#include "apps/verbs.h"
#include "experiments/version.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

constexpr int kDone = 0;
constexpr int kFailed = 1;
constexpr int kBadInput = 2;

int Report(const std::string& text, int status) {
  std::fprintf(stderr, "sweepfit: error: %s\n", OneLine(text).c_str());
  return status;
}

void SilenceLibraries(const char* program) {
  google::InitGoogleLogging(program);
  FLAGS_logtostderr = true;
  FLAGS_minloglevel = google::GLOG_FATAL;
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
}

// What is wrong with the arguments, and where to read on.
std::string UsageError(const CLI::App& command,
                       const CLI::ParseError& error,
                       int argc,
                       char** argv) {
  const auto verbs = command.get_subcommands();
  if (!verbs.empty()) {
    return std::string(error.what()) + " (see sweepfit " +
           verbs.front()->get_name() + " --help)";
  }
  const bool unknown_verb = argc > 1 && argv[1][0] != '-';
  return (unknown_verb ? "unknown verb '" + std::string(argv[1]) + "'"
                       : std::string(error.what())) +
         " (see sweepfit --help)";
}

int Run(int argc, char** argv) {
  CLI::App command(
      "sweepfit turns calibrated photographs of one person into an animatable "
      "body.");
  command.name("sweepfit");
  command.set_version_flag("--version", kVersion);
  command.require_subcommand(1);
  command.footer("Example: sweepfit demo --out demo");
  std::function<void()> run;
  AddFitVerb(&command, &run);
  AddSynthVerb(&command, &run);
  AddDemoVerb(&command, &run);
  AddEvaluateVerb(&command, &run);
  AddImportVerb(&command, &run);
  AddCheckVerb(&command, &run);
  AddAnimateVerb(&command, &run);
  AddExperimentVerb(&command, &run);
  AddTemplateVerb(&command, &run);
  try {
    command.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return command.exit(error);  // --help
    return Report(UsageError(command, error, argc, argv), kBadInput);
  }
  try {
    run();
    return kDone;
  } catch (const InputError& error) {
    return Report(error.what(), kBadInput);
  } catch (const FitError& error) {
    return Report(error.what(), kFailed);
  } catch (const std::exception& error) {
    return Report(std::string("internal error: ") + error.what(), kFailed);
  }
}

}  // namespace
}  // namespace sweepfit

int main(int argc, char** argv) {
  sweepfit::SilenceLibraries(argv[0]);
  return sweepfit::Run(argc, argv);
}
