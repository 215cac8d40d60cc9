// SPDX-License-Identifier: Apache-2.0
#include "solver/config.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <type_traits>
#include <utility>
#include <variant>

#include "model/input_error.h"

namespace sweepfit {
namespace {

// Where a key is stored.
using Target = std::variant<bool*, int*, double*, std::string*>;

struct Entry {
  std::string key;
  Target target;
  std::string meaning;
};

// The one list of everything that can be configured, grouped by stage.
std::vector<Entry> Entries(FitOptions* o) {
  JointOptions::Weights& w = o->joints.weights;
  return {
      {"until", &o->until, "last stage to run"},
      {"template.file",
       &o->body_template.file,
       "generic, or a rigged person as .glb"},
      {"template.names",
       &o->body_template.names,
       "joint names of that file: auto, a preset or a map"},
      {"segment.mode",
       &o->segment.mode,
       "auto | plate | chroma | both | masks"},
      {"segment.sigma_l", &o->segment.sigma_l, "noise of a plate, CIELAB L"},
      {"segment.sigma_ab", &o->segment.sigma_ab, "noise of a plate, a and b"},
      {"segment.lightness_weight",
       &o->segment.lightness_weight,
       "share of the squared lightness difference that counts"},
      {"segment.shadow_depth",
       &o->segment.shadow_depth,
       "how dark shadows are, scale of -ln(light)"},
      {"segment.seed_ratio",
       &o->segment.seed_ratio,
       "ln likelihood ratio that seeds the silhouette"},
      {"segment.grow_ratio",
       &o->segment.grow_ratio,
       "ln likelihood ratio to which seeds grow"},
      {"segment.smoothness",
       &o->segment.smoothness,
       "cost of an outline without an edge, per pixel"},
      {"coherence.mode",
       &o->coherence.mode,
       "repair | warn | off: cameras that disagree with the others"},
      {"volume.mode", &o->volume.mode, "hull | photo | greedy"},
      {"volume.voxel_size", &o->volume.voxel_size, "metres"},
      {"volume.photo.max_depth",
       &o->volume.photo.max_depth,
       "below the hull, metres"},
      {"volume.photo.sample_spacing",
       &o->volume.photo.sample_spacing,
       "along the surface, metres"},
      {"volume.photo.rounds",
       &o->volume.photo.rounds,
       "rounds of matching and moving"},
      {"volume.photo.patch_side",
       &o->volume.photo.patch_side,
       "taps along a patch, a pixel apart"},
      {"volume.photo.smoothness",
       &o->volume.photo.smoothness,
       "cost of a pixel of difference between neighbouring depths"},
      {"volume.photo.sigma_match",
       &o->volume.photo.sigma_match,
       "matched depth, pixels at the person"},
      {"volume.photo.sigma_rim",
       &o->volume.photo.sigma_rim,
       "outline, pixels at the person"},
      {"volume.photo.sigma_curvature",
       &o->volume.photo.sigma_curvature,
       "mean curvature, 1 / metres"},
      {"volume.photo.min_support",
       &o->volume.photo.min_support,
       "share of the surface with texture below which photo is off"},
      {"volume.greedy.max_depth",
       &o->volume.greedy.max_depth,
       "below the hull, metres"},
      {"volume.greedy.sigma_color",
       &o->volume.greedy.sigma_color,
       "colour of a point between views, 8 bit"},
      {"volume.greedy.threshold",
       &o->volume.greedy.threshold,
       "log likelihood ratio below which a voxel may go"},
      {"landmarks.mode", &o->landmarks.mode, "multiview | paper"},
      {"landmarks.keypoints",
       &o->landmarks.keypoints,
       "none, or file or folder of 2-D keypoints made elsewhere"},
      {"joints.mode", &o->joints.mode, "sigma | simplex | paper"},
      {"joints.weights.landmark", &w.landmark, "what the pictures say"},
      {"joints.weights.template_ratio",
       &w.template_ratio,
       "bone ratios of the template"},
      {"joints.weights.anthropometric",
       &w.anthropometric,
       "bone lengths of the population"},
      {"joints.weights.pose", &w.pose, "likely postures"},
      {"joints.weights.stature", &w.stature, "measured height"},
      {"joints.weights.silhouette", &w.silhouette, "limbs inside the pictures"},
      {"joints.weights.photo", &w.photo, "limbs where the pictures match"},
      {"joints.template_sigma",
       &o->joints.template_sigma,
       "spread of ln(bone length / stature) around the template"},
      {"outlines.inner_rival_weight",
       &o->outlines.inner_rival_weight,
       "of the inner of two rims side by side"},
      {"outlines.opposite_rival_weight",
       &o->outlines.opposite_rival_weight,
       "of both, for cameras opposite each other"},
      {"global.rounds", &o->global.rounds, "rounds of matching and solving"},
      {"global.sigma_first",
       &o->global.sigma_first,
       "outline of the coarse body in the first round, metres"},
      {"global.sigma_last", &o->global.sigma_last, "and in the last, metres"},
      {"global.retry_limbs",
       &o->global.retry_limbs,
       "try limbs again that leave outlines unexplained"},
      {"local.mode", &o->local.mode, "rim | hull | paper"},
      {"local.rounds", &o->local.rounds, "rounds of matching and solving"},
      {"local.rounds_two_outlines",
       &o->local.rounds_two_outlines,
       "the same where cameras in opposite pairs see two outlines only"},
      {"local.sigma_rim", &o->local.sigma_rim, "outline, metres"},
      {"local.sigma_hull", &o->local.sigma_hull, "beyond the hull, metres"},
      {"local.sigma_around",
       &o->local.sigma_around,
       "second difference of the log ratio around a section"},
      {"local.sigma_along", &o->local.sigma_along, "and along the sweep"},
      {"local.sigma_magnitude", &o->local.sigma_magnitude, "log ratio itself"},
      {"local.sigma_symmetry", &o->local.sigma_symmetry, "left against right"},
      {"photo.enabled",
       &o->photo.enabled,
       "match the photographs about the body, for local and refine"},
      {"photo.sigma", &o->photo.sigma, "of a matched point, metres"},
      {"photo.weight", &o->photo.weight, "of a point: patches overlap"},
      {"photo.lightness",
       &o->photo.lightness,
       "how much equal lightness counts beside equal patterns"},
      {"photo.lightness_two_views",
       &o->photo.lightness_two_views,
       "the same of what only two cameras see"},
      {"inner_contours.enabled",
       &o->inner_contours.enabled,
       "match edges of limbs in front of the body"},
      {"inner_contours.weight",
       &o->inner_contours.weight,
       "of such an edge against an outline"},
      {"refine.enabled", &o->refine.enabled, "move vertices beyond the sweeps"},
      {"refine.rounds", &o->refine.rounds, "rounds of matching and solving"},
      {"refine.sigma_rim", &o->refine.sigma_rim, "outline, metres"},
      {"refine.sigma_smooth",
       &o->refine.sigma_smooth,
       "a vertex against its neighbours, metres"},
      {"refine.sigma_magnitude",
       &o->refine.sigma_magnitude,
       "displacement itself, metres"},
      {"refine.sigma_symmetry",
       &o->refine.sigma_symmetry,
       "left against right, metres"},
      {"texture.size", &o->texture.size, "texels along each side"},
      {"texture.despill",
       &o->texture.despill,
       "how far a key screen's light is taken off, 0 to 1"},
      {"export.names",
       &o->exported.names,
       "joint names: sweepfit | mixamo | unity | unreal | vrm"},
      {"export.correctives",
       &o->exported.correctives,
       "morph targets that take clips to the sweeps"},
      {"export.helpers",
       &o->exported.helpers,
       "helper joints besides the 21 in model.glb; clips made elsewhere do not "
       "move them"},
      {"export.obj", &o->exported.obj, "mesh_<pose>.obj with texture"},
  };
}

std::string ToText(double value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof(text), value).ptr;
  return {text, end};
}

std::string ToText(const Target& target) {
  return std::visit(
      [](const auto* value) -> std::string {
        using T = std::remove_cvref_t<decltype(*value)>;
        if constexpr (std::is_same_v<T, bool>) {
          return *value ? "true" : "false";
        } else if constexpr (std::is_same_v<T, std::string>) {
          return *value;
        } else if constexpr (std::is_same_v<T, double>) {
          return ToText(*value);
        } else {
          return std::to_string(*value);
        }
      },
      target);
}

// The whole text must be a number: "1 mm" is none.
template <typename T>
bool ParseNumber(const std::string& text, T* value) {
  const char* first = text.data();
  const char* last = first + text.size();
  const auto [end, error] = std::from_chars(first, last, *value);
  return error == std::errc() && end == last;
}

const char* Assign(const std::string& text, bool* value) {
  if (text != "true" && text != "false") return "true or false";
  *value = text == "true";
  return nullptr;
}

const char* Assign(const std::string& text, int* value) {
  int parsed = 0;
  if (!ParseNumber(text, &parsed)) return "a whole number";
  *value = parsed;
  return nullptr;
}

const char* Assign(const std::string& text, double* value) {
  double parsed = 0;
  if (!ParseNumber(text, &parsed) || !std::isfinite(parsed)) return "a number";
  *value = parsed;
  return nullptr;
}

const char* Assign(const std::string& text, std::string* value) {
  if (text.empty()) return "a word";
  *value = text;
  return nullptr;
}

std::string At(const std::string& source, const YAML::Mark& mark) {
  if (mark.is_null()) return source + ": ";
  return source + ":" + std::to_string(mark.line + 1) + ": ";
}

std::vector<std::string> ReadList(const YAML::Node& node,
                                  const std::string& where,
                                  const std::string& key) {
  std::vector<std::string> list;
  if (node.IsSequence()) {
    for (const YAML::Node& item : node) {
      if (!item.IsScalar()) {
        throw InputError(where + "'" + key + "' must be a list of names");
      }
      list.push_back(item.Scalar());
    }
  } else if (node.IsScalar()) {
    std::istringstream text(node.Scalar());
    for (std::string item; std::getline(text, item, ',');) list.push_back(item);
  }
  if (list.empty()) {
    throw InputError(where + "'" + key + "' must be a list of names");
  }
  return list;
}

// Walks a YAML tree and stores its leaves.
class Reader {
 public:
  Reader(std::string source, FitConfig* config)
      : source_(std::move(source)),
        config_(config),
        entries_(Entries(&config->options)) {}

  void ReadMap(const YAML::Node& map, const std::string& prefix) {
    std::set<std::string> seen;
    for (const auto& item : map) {
      const std::string where = At(source_, item.first.Mark());
      if (!item.first.IsScalar())
        throw InputError(where + "a key must be a word");
      const std::string key = prefix + item.first.Scalar();
      if (!seen.insert(key).second) {
        throw InputError(where + "key '" + key + "' is given twice");
      }
      Read(key, item.second, where);
    }
  }

  void Read(const std::string& key,
            const YAML::Node& value,
            const std::string& where) {
    if (key == "poses") {
      config_->poses = ReadList(value, where, key);
    } else if (key == "cameras") {
      config_->cameras = ReadList(value, where, key);
    } else if (const Entry* entry = Find(key)) {
      Store(*entry, value, where);
    } else if (IsGroup(key)) {
      ReadGroup(key, value, where);
    } else {
      throw InputError(where + "unknown key '" + key + "'");
    }
  }

 private:
  void ReadGroup(const std::string& key,
                 const YAML::Node& value,
                 const std::string& where) {
    if (value.IsNull()) return;  // an empty group changes nothing
    if (!value.IsMap()) {
      throw InputError(where + "'" + key + "' must be a group of keys");
    }
    ReadMap(value, key + ".");
  }

  void Store(const Entry& entry,
             const YAML::Node& value,
             const std::string& where) {
    if (!value.IsScalar()) {
      throw InputError(where + "'" + entry.key + "' must be a single value");
    }
    const char* wanted =
        std::visit([&](auto* target) { return Assign(value.Scalar(), target); },
                   entry.target);
    if (wanted != nullptr) {
      throw InputError(where + "'" + entry.key + "' must be " + wanted +
                       ", not '" + value.Scalar() + "'");
    }
  }

  const Entry* Find(const std::string& key) const {
    for (const Entry& entry : entries_) {
      if (entry.key == key) return &entry;
    }
    return nullptr;
  }

  bool IsGroup(const std::string& key) const {
    for (const Entry& entry : entries_) {
      if (entry.key.starts_with(key + ".")) return true;
    }
    return false;
  }

  std::string source_;
  FitConfig* config_;
  std::vector<Entry> entries_;
};

YAML::Node LoadYaml(const std::string& text, const std::string& source) {
  try {
    return YAML::Load(text);
  } catch (const YAML::ParserException& error) {
    throw InputError(At(source, error.mark) + "malformed YAML: " + error.msg);
  }
}

std::string FlowList(const std::vector<std::string>& items) {
  YAML::Emitter out;
  out << YAML::Flow << items;
  return out.c_str();
}

// Writes "key: value  # meaning" lines, opening groups as they come.
class Writer {
 public:
  void Write(const std::string& key,
             const std::string& value,
             const std::string& meaning) {
    std::vector<std::string> parts = Split(key);
    size_t depth = 0;
    while (depth + 1 < parts.size() && depth < open_.size() &&
           open_[depth] == parts[depth]) {
      ++depth;
    }
    open_.resize(depth);
    for (; depth + 1 < parts.size(); ++depth) {
      Indent(depth) << parts[depth] << ":\n";
      open_.push_back(parts[depth]);
    }
    Indent(depth) << parts.back() << ": " << value << "  # " << meaning << "\n";
  }
  std::string Text() const { return text_.str(); }

 private:
  static std::vector<std::string> Split(const std::string& key) {
    std::vector<std::string> parts;
    std::istringstream stream(key);
    for (std::string part; std::getline(stream, part, '.');) {
      parts.push_back(part);
    }
    return parts;
  }
  std::ostream& Indent(size_t depth) {
    return text_ << std::string(2 * depth, ' ');
  }

  std::vector<std::string> open_;
  std::ostringstream text_;
};

std::string YamlScalar(const Target& target) {
  if (!std::holds_alternative<std::string*>(target)) return ToText(target);
  YAML::Emitter out;
  out << *std::get<std::string*>(target);
  return out.c_str();
}

}  // namespace

bool RunsStage(const FitOptions& options, std::string_view stage) {
  return FindFitStage(stage) <= FindFitStage(options.until);
}

std::vector<ConfigKey> ConfigKeys() {
  FitOptions defaults;
  std::vector<ConfigKey> keys;
  for (const Entry& entry : Entries(&defaults)) {
    keys.push_back({entry.key, ToText(entry.target), entry.meaning});
  }
  return keys;
}

void ParseFitConfig(const std::string& yaml_text,
                    const std::string& source,
                    FitConfig* config) {
  const YAML::Node root = LoadYaml(yaml_text, source);
  if (root.IsNull()) return;
  if (!root.IsMap()) throw InputError(source + ": must be a map of keys");
  Reader(source, config).ReadMap(root, "");
}

void LoadFitConfig(const std::string& path, FitConfig* config) {
  std::ostringstream text;
  std::ifstream file(path, std::ios::binary);
  // A folder opens but does not read.
  if (!std::filesystem::is_regular_file(path) || !file) {
    throw InputError(path + ": cannot read the configuration");
  }
  text << file.rdbuf();
  ParseFitConfig(text.str(), path, config);
}

void ApplySetting(const std::string& setting, FitConfig* config) {
  const std::string where = "--set " + setting + ": ";
  const size_t equals = setting.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw InputError(where + "must be key=value");
  }
  const YAML::Node value =
      LoadYaml(setting.substr(equals + 1), "--set " + setting);
  if (!value.IsScalar() && !value.IsSequence()) {
    throw InputError(where + "must be key=value");
  }
  Reader("--set " + setting, config)
      .Read(setting.substr(0, equals), value, where);
}

std::string FitConfigToYaml(const FitConfig& config) {
  FitConfig copy = config;
  Writer writer;
  if (config.poses) {
    writer.Write("poses", FlowList(*config.poses), "poses of one person");
  }
  if (config.cameras) {
    writer.Write("cameras", FlowList(*config.cameras), "cameras to fit");
  }
  for (const Entry& entry : Entries(&copy.options)) {
    writer.Write(entry.key, YamlScalar(entry.target), entry.meaning);
  }
  return writer.Text();
}

nlohmann::ordered_json FitOptionsToJson(const FitOptions& options) {
  FitOptions copy = options;
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const Entry& entry : Entries(&copy)) {
    std::string pointer = "/" + entry.key;
    std::replace(pointer.begin(), pointer.end(), '.', '/');
    nlohmann::ordered_json& leaf =
        json[nlohmann::ordered_json::json_pointer(pointer)];
    std::visit([&leaf](const auto* value) { leaf = *value; }, entry.target);
  }
  return json;
}

}  // namespace sweepfit
