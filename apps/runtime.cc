// SPDX-License-Identifier: Apache-2.0
#include "apps/runtime.h"

#include <tbb/info.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <opencv2/core/utility.hpp>

#include "model/joint_names.h"

namespace sweepfit {
namespace {

int NumThreads(int wanted) {
  return wanted > 0 ? wanted : std::max(1, tbb::info::default_concurrency());
}

}  // namespace

ConsoleProgress::ConsoleProgress(bool quiet)
    : quiet_(quiet),
      terminal_(isatty(STDERR_FILENO) != 0),
      start_(std::chrono::steady_clock::now()) {}

ConsoleProgress::~ConsoleProgress() { Clear(); }

void ConsoleProgress::Stage(const std::string& stage,
                            const std::string& detail) {
  if (quiet_) return;
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start_)
          .count();
  char time[32];
  std::snprintf(time, sizeof(time), "%7.1f s  ", seconds);
  line_ = time + stage + (detail.empty() ? "" : " " + detail);
  if (terminal_) {
    std::fprintf(stderr, "\r\033[K%s", line_.c_str());
  } else {
    std::fprintf(stderr, "%s\n", line_.c_str());
  }
  std::fflush(stderr);
}

void ConsoleProgress::Warning(const std::string& text) {
  if (quiet_ || !warned_.insert(text).second) return;
  const std::string line = line_;
  Clear();
  std::fprintf(stderr, "  warning: %s\n", OneLine(text).c_str());
  if (terminal_) std::fprintf(stderr, "%s", line.c_str());
  line_ = line;
  std::fflush(stderr);
}

void ConsoleProgress::Clear() {
  if (terminal_ && !line_.empty()) std::fprintf(stderr, "\r\033[K");
  std::fflush(stderr);
  line_.clear();
}

Runtime::Runtime(const CommonArguments& arguments)
    : threads_(tbb::global_control::max_allowed_parallelism,
               NumThreads(arguments.threads)),
      progress_(arguments.quiet),
      quiet_(arguments.quiet) {
  cv::setNumThreads(NumThreads(arguments.threads));
}

void AddCommonArguments(CLI::App* verb, CommonArguments* arguments) {
  verb->add_option("--threads",
                   arguments->threads,
                   "Threads to use (default: one per processor); results do "
                   "not depend on it")
      ->check(CLI::Range(1, 1024));
  verb->add_flag("--quiet", arguments->quiet, "Print errors only");
}

void AddConfigArguments(CLI::App* verb, ConfigArguments* arguments) {
  verb->add_option("--config", arguments->file, "Configuration file (YAML)");
  verb->add_option("--set", arguments->settings, "Override: key=value ...")
      ->expected(1, -1);
}

FitConfig ReadConfig(const ConfigArguments& arguments) {
  FitConfig config;
  if (!arguments.file.empty()) LoadFitConfig(arguments.file, &config);
  for (const std::string& setting : arguments.settings) {
    ApplySetting(setting, &config);
  }
  return config;
}

std::string JointNamePresetList() {
  std::string list;
  for (const JointNameMap& preset : JointNamePresets()) {
    list += (list.empty() ? "" : ", ") + preset.name;
  }
  return list;
}

std::string OneLine(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

}  // namespace sweepfit
