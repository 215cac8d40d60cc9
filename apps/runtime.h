// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/global_control.h>

#include <chrono>
#include <memory>
#include <set>
#include <string>

#include "apps/verbs.h"
#include "model/progress.h"

namespace sweepfit {

// Shows stages with the time since the start: one line that changes on a
// terminal, plain lines elsewhere. Writes to stderr; quiet: nothing.
class ConsoleProgress : public Progress {
 public:
  explicit ConsoleProgress(bool quiet);
  ~ConsoleProgress() override;
  void Stage(const std::string& stage, const std::string& detail) override;
  void Warning(const std::string& text) override;
  // Removes the changing line, so that other output starts on a clean one.
  void Clear();

 private:
  bool quiet_;
  bool terminal_;
  std::string line_;              // what the changing line says now
  std::set<std::string> warned_;  // no warning is shown twice
  std::chrono::steady_clock::time_point start_;
};

// Threads and progress of one run of a verb.
class Runtime {
 public:
  explicit Runtime(const CommonArguments& arguments);
  ConsoleProgress* progress() { return &progress_; }
  bool quiet() const { return quiet_; }

 private:
  tbb::global_control threads_;
  ConsoleProgress progress_;
  bool quiet_;
};

// Text without line breaks, for messages that must be one line.
std::string OneLine(std::string text);

}  // namespace sweepfit
