// SPDX-License-Identifier: Apache-2.0
#include "model/joint_names.h"

#include <glog/logging.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <map>

#include "model/embedded_data.h"
#include "model/file_io.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

[[noreturn]] void Fail(const std::string& source,
                       const YAML::Node& node,
                       const std::string& what) {
  throw InputError(source + ":" + std::to_string(node.Mark().line + 1) + ": " +
                   what);
}

YAML::Node ParseYaml(const std::string& text, const std::string& source) {
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw InputError(source + ":" + std::to_string(error.mark.line + 1) +
                     ": not YAML: " + error.msg);
  }
}

JointNameMap ParseMap(const YAML::Node& node,
                      const std::string& name,
                      const std::string& source) {
  if (!node.IsMap()) {
    Fail(source, node, "a map of joint names must have a line per joint");
  }
  JointNameMap map;
  map.name = name;
  for (const auto& entry : node) {
    const std::string key =
        entry.first.IsScalar() ? entry.first.Scalar() : std::string();
    const int joint = FindJoint(key);
    if (joint < 0)
      Fail(source, entry.first, "no joint is called '" + key + "'");
    std::vector<std::string>& names = map.names[joint];
    if (!names.empty()) {
      Fail(source, entry.first, "joint '" + key + "' twice");
    }
    const auto add = [&](const YAML::Node& value) {
      if (!value.IsScalar() || value.Scalar().empty()) {
        Fail(source, value, "'" + key + "' needs a name or a list of names");
      }
      names.push_back(value.Scalar());
    };
    if (entry.second.IsSequence()) {
      for (const YAML::Node& value : entry.second) add(value);
      if (names.empty())
        Fail(source, entry.second, "'" + key + "' has no name");
    } else {
      add(entry.second);
    }
  }
  return map;
}

// What is compared of a name.
std::string Essence(std::string_view name) {
  const std::size_t prefix = name.find_last_of(":|");
  if (prefix != std::string_view::npos) name.remove_prefix(prefix + 1);
  std::string essence;
  for (const char c : name) {
    if (c == ' ' || c == '_' || c == '.' || c == '-') continue;
    essence += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  // Some programs drop the colon of the prefix.
  constexpr std::string_view kMixamo = "mixamorig";
  if (essence.starts_with(kMixamo) && essence.size() > kMixamo.size()) {
    essence.erase(0, kMixamo.size());
    while (essence.size() > 1 &&
           std::isdigit(static_cast<unsigned char>(essence[0]))) {
      essence.erase(0, 1);
    }
  }
  return essence;
}

// Without the number that some exporters append: "Hips_02" of Sketchfab.
std::string_view WithoutNumber(std::string_view name) {
  std::size_t end = name.size();
  while (end > 0 && std::isdigit(static_cast<unsigned char>(name[end - 1]))) {
    --end;
  }
  return end > 1 && end < name.size() && name[end - 1] == '_'
             ? name.substr(0, end - 1)
             : name;
}

int Find(const std::vector<std::string>& names, const std::string& wanted) {
  const auto exact = std::find(names.begin(), names.end(), wanted);
  if (exact != names.end()) return static_cast<int>(exact - names.begin());
  const std::string essence = Essence(wanted);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!names[i].empty() && Essence(names[i]) == essence) {
      return static_cast<int>(i);
    }
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!names[i].empty() && Essence(WithoutNumber(names[i])) == essence) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

JointMatch Match(const std::vector<std::string>& names,
                 const JointNameMap& map) {
  JointMatch match;
  match.map = map.name;
  match.index.fill(-1);
  for (int joint = 0; joint < kNumJoints; ++joint) {
    for (const std::string& wanted : map.names[joint]) {
      match.index[joint] = Find(names, wanted);
      if (match.index[joint] >= 0) break;
    }
  }
  return match;
}

std::vector<int> Missing(const JointMatch& match) {
  std::vector<int> missing;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    if (IsNeededJoint(joint) && match.index[joint] < 0)
      missing.push_back(joint);
  }
  return missing;
}

int NumFound(const JointMatch& match) {
  return static_cast<int>(std::count_if(match.index.begin(),
                                        match.index.end(),
                                        [](int index) { return index >= 0; }));
}

// Names without a prefix such as "Character1_" that most of them have; as they
// are when there is none.
std::vector<std::string> WithoutCommonPrefix(
    const std::vector<std::string>& names) {
  std::map<std::string, int> count;
  int num = 0;
  for (const std::string& name : names) {
    if (name.empty()) continue;
    ++num;
    const std::size_t end = name.find_first_of("_- ");
    if (end != std::string::npos) ++count[name.substr(0, end + 1)];
  }
  std::vector<std::string> stripped = names;
  for (const auto& [prefix, times] : count) {
    if (10 * times < 7 * num) continue;
    for (std::string& name : stripped) {
      if (name.starts_with(prefix)) name.erase(0, prefix.size());
    }
  }
  return stripped;
}

std::string Join(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "" : ", ") + word;
  }
  return text;
}

[[noreturn]] void FailIncomplete(const std::string& source,
                                 const std::vector<std::string>& names,
                                 const JointMatch& match,
                                 const JointNameMap& map) {
  std::vector<std::string> unmapped;
  for (const int joint : Missing(match)) {
    std::string line(kJointNames[joint]);
    if (!map.names[joint].empty()) {
      line += " (sought as " + Join(map.names[joint]) + ")";
    }
    unmapped.push_back(line);
  }
  std::vector<std::string> there;
  constexpr std::size_t kMostNames = 60;
  for (const std::string& name : names) {
    if (name.empty()) continue;
    there.push_back(there.size() < kMostNames ? name : "...");
    if (there.size() > kMostNames) break;
  }
  throw InputError(
      source + ": the joint names of '" + match.map +
      "' leave these joints unmapped: " + Join(unmapped) +
      "; name them in a map file, a line such as '" +
      std::string(kJointNames[Missing(match).front()]) +
      ": NAME' for each joint. The names there are: " + Join(there));
}

void CheckDistinct(const std::string& source,
                   const std::vector<std::string>& names,
                   const JointMatch& match) {
  for (int a = 0; a < kNumJoints; ++a) {
    for (int b = 0; b < a; ++b) {
      if (match.index[a] < 0 || match.index[a] != match.index[b]) continue;
      throw InputError(source + ": '" + names[match.index[a]] +
                       "' is mapped to both " + std::string(kJointNames[b]) +
                       " and " + std::string(kJointNames[a]));
    }
  }
}

}  // namespace

bool IsNeededJoint(int joint) {
  switch (joint) {
    case kSpine:
    case kHeadEnd:
    case kLHandEnd:
    case kRHandEnd:
    case kLFootEnd:
    case kRFootEnd:
      return false;
    default:
      return true;
  }
}

const std::vector<JointNameMap>& JointNamePresets() {
  static const std::vector<JointNameMap> kPresets = [] {
    constexpr const char* kFile = "joint_names.yaml";
    const YAML::Node root = ParseYaml(std::string(EmbeddedData(kFile)), kFile);
    std::vector<JointNameMap> presets;
    for (const auto& entry : root["presets"]) {
      presets.push_back(ParseMap(entry.second, entry.first.Scalar(), kFile));
    }
    CHECK(!presets.empty());
    return presets;
  }();
  return kPresets;
}

JointNameMap LoadJointNameMap(const std::string& path) {
  return ParseMap(ParseYaml(ReadWholeFile(path), path), path, path);
}

JointMatch MatchJointNames(const std::vector<std::string>& names,
                           const std::string& choice,
                           const std::string& source) {
  const std::vector<JointNameMap>& presets = JointNamePresets();
  const std::vector<std::string> stripped = WithoutCommonPrefix(names);
  const auto best_match = [&](const JointNameMap& candidate) {
    const JointMatch whole = Match(names, candidate);
    const JointMatch less = Match(stripped, candidate);
    return Missing(less).size() < Missing(whole).size() ? less : whole;
  };
  JointNameMap map;
  if (choice == "auto") {
    // Fewest needed joints missing, then most found; the first of equals.
    std::pair<int, int> best = {kNumJoints + 1, 0};
    for (const JointNameMap& preset : presets) {
      const JointMatch match = best_match(preset);
      const std::pair<int, int> rank = {static_cast<int>(Missing(match).size()),
                                        -NumFound(match)};
      if (rank < best) {
        best = rank;
        map = preset;
      }
    }
  } else {
    const auto preset =
        std::find_if(presets.begin(), presets.end(), [&](const auto& p) {
          return p.name == choice;
        });
    if (preset != presets.end()) {
      map = *preset;
    } else if (choice.find_first_of("./") != std::string::npos) {
      map = LoadJointNameMap(choice);
    } else {
      std::vector<std::string> known = {"auto"};
      for (const JointNameMap& p : presets) known.push_back(p.name);
      throw InputError("no joint names are called '" + choice +
                       "'; there are " + Join(known) +
                       ", or give a file (a path with . or /)");
    }
  }
  const JointMatch match = best_match(map);
  if (!Missing(match).empty()) FailIncomplete(source, names, match, map);
  CheckDistinct(source, names, match);
  return match;
}

}  // namespace sweepfit
