// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "solver/config.h"

namespace sweepfit {

// What every verb can be told.
struct CommonArguments {
  int threads = 0;  // 0: one per processor
  bool quiet = false;
};
void AddCommonArguments(CLI::App* verb, CommonArguments* arguments);

// --config and --set.
struct ConfigArguments {
  std::string file;
  std::vector<std::string> settings;
};
void AddConfigArguments(CLI::App* verb, ConfigArguments* arguments);
// The file first, then single settings.
FitConfig ReadConfig(const ConfigArguments& arguments);

// The presets of joint names as a list, for --help.
std::string JointNamePresetList();

// Each adds one verb to the command; when the verb is chosen, `*run` becomes
// its work.
void AddFitVerb(CLI::App* command, std::function<void()>* run);
void AddSynthVerb(CLI::App* command, std::function<void()>* run);
void AddDemoVerb(CLI::App* command, std::function<void()>* run);
void AddEvaluateVerb(CLI::App* command, std::function<void()>* run);
void AddImportVerb(CLI::App* command, std::function<void()>* run);
void AddCheckVerb(CLI::App* command, std::function<void()>* run);
void AddAnimateVerb(CLI::App* command, std::function<void()>* run);
void AddExperimentVerb(CLI::App* command, std::function<void()>* run);
void AddTemplateVerb(CLI::App* command, std::function<void()>* run);

}  // namespace sweepfit
