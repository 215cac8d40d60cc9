// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "solver/pipeline.h"

namespace sweepfit {

// True when a fit with these options runs the stage.
bool RunsStage(const FitOptions& options, std::string_view stage);

// What a configuration file (fit.yaml) may say: the options of every stage and,
// optionally, what to fit.
struct FitConfig {
  FitOptions options;
  std::optional<std::vector<std::string>> poses;    // absent: all
  std::optional<std::vector<std::string>> cameras;  // absent: all but holdout
};

// One configurable value: its key ("joints.weights.landmark"), its default as
// text, and what it means. For the tables in --help and README.
struct ConfigKey {
  std::string key;
  std::string default_value;
  std::string meaning;
};
std::vector<ConfigKey> ConfigKeys();

// Reads a configuration over `config`; keys that are not given keep their
// values. InputError with "source:line:" on malformed YAML, an unknown or
// repeated key, and a value of the wrong type.
void ParseFitConfig(const std::string& yaml_text,
                    const std::string& source,
                    FitConfig* config);
void LoadFitConfig(const std::string& path, FitConfig* config);

// Applies one override "key=value", the value as it would stand in YAML.
// InputError names the setting.
void ApplySetting(const std::string& setting, FitConfig* config);

// The whole configuration as YAML, every key with its meaning as a comment.
// ParseFitConfig of the result gives the same configuration back exactly.
std::string FitConfigToYaml(const FitConfig& config);

// The options as a JSON object, nested like the keys.
nlohmann::ordered_json FitOptionsToJson(const FitOptions& options);

}  // namespace sweepfit
