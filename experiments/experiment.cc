// SPDX-License-Identifier: Apache-2.0
#include "experiments/experiment.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <initializer_list>
#include <set>
#include <string_view>

#include "model/input_error.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

std::optional<std::string> NamedTwice(
    const std::vector<ExperimentSubject>& subjects) {
  std::set<std::string> names;
  for (const ExperimentSubject& subject : subjects) {
    if (!names.insert(subject.name).second) return subject.name;
  }
  return std::nullopt;
}

// Reads one experiment file; errors name file and line.
class Reader {
 public:
  explicit Reader(fs::path file) : file_(std::move(file)) {}

  Experiment Read() const {
    YAML::Node root;
    try {
      root = YAML::LoadFile(file_.string());
    } catch (const YAML::BadFile&) {
      throw InputError(file_.string() + ": cannot read the experiment");
    } catch (const YAML::ParserException& error) {
      throw InputError(file_.string() + ":" +
                       std::to_string(error.mark.line + 1) +
                       ": malformed YAML: " + error.msg);
    }
    CheckKeys(root,
              {"name",
               "question",
               "poses",
               "subjects",
               "settings",
               "variants",
               "grid"});
    Experiment experiment;
    experiment.name = Name(Required(root, "name"), "name");
    if (root["question"])
      experiment.question = Text(root["question"], "question");
    if (root["poses"]) {
      const std::string poses = Text(root["poses"], "poses");
      if (poses != "each" && poses != "together") {
        Fail(root["poses"], "'poses' must be each or together");
      }
      experiment.poses_together = poses == "together";
    }
    ReadSubjects(Required(root, "subjects"), &experiment);
    ReadVariants(root, &experiment);
    return experiment;
  }

 private:
  [[noreturn]] void Fail(const YAML::Node& node,
                         const std::string& what) const {
    std::string text = file_.string();
    if (node.IsDefined() && node.Mark().line >= 0) {
      text += ":" + std::to_string(node.Mark().line + 1);
    }
    throw InputError(text + ": " + what);
  }

  void CheckKeys(const YAML::Node& map,
                 std::initializer_list<std::string_view> known) const {
    if (!map.IsMap()) Fail(map, "must be a map of keys to values");
    std::set<std::string> seen;
    for (const auto& entry : map) {
      if (!entry.first.IsScalar()) Fail(entry.first, "a key must be a word");
      const std::string& key = entry.first.Scalar();
      if (!seen.insert(key).second) {
        Fail(entry.first, "key '" + key + "' is given twice");
      }
      if (known.size() > 0 &&
          std::find(known.begin(), known.end(), key) == known.end()) {
        Fail(entry.first, "unknown key '" + key + "'");
      }
    }
  }

  YAML::Node Required(const YAML::Node& map, const char* key) const {
    if (!map[key]) Fail(map, std::string("'") + key + "' is missing");
    return map[key];
  }

  std::string Text(const YAML::Node& node, const std::string& key) const {
    if (!node.IsScalar() || node.Scalar().empty()) {
      Fail(node, "'" + key + "' must be a text");
    }
    return node.Scalar();
  }

  // A name becomes part of a file's name.
  std::string Name(const YAML::Node& node, const std::string& key) const {
    const std::string name = Text(node, key);
    const bool plain =
        std::all_of(name.begin(), name.end(), [](unsigned char c) {
          return std::isalnum(c) || c == '_' || c == '-';
        });
    if (!plain) {
      Fail(node,
           "'" + name + "': a name may hold letters, digits, '_' and '-' only");
    }
    return name;
  }

  template <typename T>
  T Number(const YAML::Node& node, const std::string& key) const {
    T value{};
    if (!node.IsScalar() || !YAML::convert<T>::decode(node, value)) {
      Fail(node, "'" + key + "' must be a number");
    }
    return value;
  }

  void ReadSubjects(const YAML::Node& list, Experiment* experiment) const {
    if (!list.IsSequence() || list.size() == 0) {
      Fail(list, "'subjects' must be a list");
    }
    for (const YAML::Node& item : list) {
      CheckKeys(item, {"capture", "synthetic"});
      if (item.size() != 1) Fail(item, "give either capture or synthetic");
      if (item["capture"]) {
        const fs::path capture =
            file_.parent_path() / Text(item["capture"], "capture");
        experiment->subjects.push_back(
            {fs::weakly_canonical(capture).filename().string(), capture, {}});
      } else {
        ReadSynthetic(item["synthetic"], experiment);
      }
    }
    if (const auto twice = NamedTwice(experiment->subjects)) {
      Fail(list, "subject '" + *twice + "' is named twice");
    }
  }

  void ReadSynthetic(const YAML::Node& map, Experiment* experiment) const {
    CheckKeys(map, {"seeds", "poses", "cameras", "size", "noise", "masks"});
    SyntheticOptions options;
    if (map["poses"]) {
      options.poses.clear();
      for (const YAML::Node& pose : map["poses"]) {
        options.poses.push_back(Text(pose, "poses"));
      }
    }
    if (map["cameras"]) {
      options.num_cameras = Number<int>(map["cameras"], "cameras");
    }
    if (map["size"]) {
      options.width = options.height = Number<int>(map["size"], "size");
    }
    if (map["noise"]) options.noise = Number<double>(map["noise"], "noise");
    if (map["masks"]) options.background = !Number<bool>(map["masks"], "masks");
    const YAML::Node seeds = Required(map, "seeds");
    if (!seeds.IsSequence() || seeds.size() != 2) {
      Fail(seeds, "'seeds' must be the first and the last: [1, 20]");
    }
    const auto first = Number<unsigned>(seeds[0], "seeds");
    const auto last = Number<unsigned>(seeds[1], "seeds");
    if (last < first || last - first >= 10000) {
      Fail(seeds, "'seeds' must be the first and the last: [1, 20]");
    }
    for (unsigned seed = first; seed <= last; ++seed) {
      options.seed = seed;
      if (const auto error = options.Check()) Fail(map, *error);
      char name[32];
      std::snprintf(name, sizeof(name), "synthetic%04u", seed);
      experiment->subjects.push_back({name, {}, options});
    }
  }

  void Apply(const YAML::Node& map, ExperimentVariant* variant) const {
    if (map.IsNull()) return;
    CheckKeys(map, {});
    for (const auto& entry : map) {
      ApplyOne(entry.first.Scalar(), entry.second, variant);
    }
  }

  void ApplyOne(const std::string& key,
                const YAML::Node& value,
                ExperimentVariant* variant) const {
    YAML::Emitter text;
    text << YAML::Flow << value;
    const std::string setting = key + "=" + text.c_str();
    try {
      ApplySetting(setting, &variant->config);
    } catch (const InputError& error) {
      Fail(value, error.what());
    }
    variant->settings.push_back(setting);
  }

  void ReadVariants(const YAML::Node& root, Experiment* experiment) const {
    ExperimentVariant base;
    // What costs time and has no accuracy is left out unless asked for.
    base.config.options.until = "refine";
    if (root["settings"]) Apply(root["settings"], &base);
    const YAML::Node variants = Required(root, "variants");
    CheckKeys(variants, {});
    for (const auto& entry : variants) {
      ExperimentVariant variant = base;
      variant.name = Name(entry.first, "variants");
      Apply(entry.second, &variant);
      if (const auto error = variant.config.options.Check()) {
        Fail(entry.second, "variant '" + variant.name + "': " + *error);
      }
      if (!RunsStage(variant.config.options, "volume")) {
        Fail(entry.second,
             "variant '" + variant.name + "': 'until' must be volume or later");
      }
      experiment->variants.push_back(variant);
    }
    if (experiment->variants.empty()) Fail(variants, "no variant is given");
    if (root["grid"]) ExpandGrid(root["grid"], experiment);
  }

  void ExpandGrid(const YAML::Node& grid, Experiment* experiment) const {
    CheckKeys(grid, {});
    for (const auto& entry : grid) {
      const std::string& key = entry.first.Scalar();
      if (!entry.second.IsSequence() || entry.second.size() == 0) {
        Fail(entry.second, "'" + key + "' must be a list of values");
      }
      std::vector<ExperimentVariant> expanded;
      for (const ExperimentVariant& variant : experiment->variants) {
        for (const YAML::Node& value : entry.second) {
          ExperimentVariant point = variant;
          ApplyOne(key, value, &point);
          point.name += "," + point.settings.back();
          if (const auto error = point.config.options.Check()) {
            Fail(entry.second, "variant '" + point.name + "': " + *error);
          }
          expanded.push_back(std::move(point));
        }
      }
      experiment->variants = std::move(expanded);
    }
  }

  fs::path file_;
};

}  // namespace

Experiment LoadExperiment(const fs::path& path) { return Reader(path).Read(); }

void UseCaptures(const std::vector<fs::path>& folders, Experiment* experiment) {
  experiment->subjects.clear();
  const auto add = [&](const fs::path& folder) {
    experiment->subjects.push_back(
        {fs::canonical(folder).filename().string(), folder, {}});
  };
  for (const fs::path& folder : folders) {
    if (!fs::is_directory(folder)) {
      throw InputError(folder.string() + ": no such folder");
    }
    if (fs::exists(folder / "capture.yaml")) {
      add(folder);
      continue;
    }
    std::vector<fs::path> found;
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (fs::exists(entry.path() / "capture.yaml")) {
        found.push_back(entry.path());
      }
    }
    if (found.empty()) {
      throw InputError(folder.string() + ": no capture in it");
    }
    std::sort(found.begin(), found.end());
    for (const fs::path& capture : found) add(capture);
  }
  if (const auto twice = NamedTwice(experiment->subjects)) {
    throw InputError("two captures are called '" + *twice + "'");
  }
}

}  // namespace sweepfit
