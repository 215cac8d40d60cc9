// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace sweepfit {

// What the command did.
struct CommandOutcome {
  int status = -1;
  std::string out;
  std::string err;

  // Lines of stderr that report an error.
  std::vector<std::string> ErrorLines() const {
    std::vector<std::string> lines;
    std::istringstream stream(err);
    for (std::string line; std::getline(stream, line);) {
      if (line.starts_with("sweepfit: error: ")) lines.push_back(line);
    }
    return lines;
  }
};

inline std::string ShellQuoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

// Runs the command as a user does; its output goes through `scratch`.
inline CommandOutcome RunCommand(const std::vector<std::string>& arguments,
                                 const std::filesystem::path& scratch) {
  const std::filesystem::path out = scratch / "stdout",
                              err = scratch / "stderr";
  std::string line = ShellQuoted(SWEEPFIT_COMMAND);
  for (const std::string& argument : arguments) {
    line += " " + ShellQuoted(argument);
  }
  line += " >" + ShellQuoted(out) + " 2>" + ShellQuoted(err);
  const int status = std::system(line.c_str());
  CommandOutcome outcome;
  outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  outcome.out = ReadBytes(out);
  outcome.err = ReadBytes(err);
  return outcome;
}

}  // namespace sweepfit
