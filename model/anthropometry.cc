// SPDX-License-Identifier: Apache-2.0
#include "model/anthropometry.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "model/embedded_data.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

// A YAML map that knows where it came from and lets no key go unread.
class Table {
 public:
  // `name` is the path of keys that leads here.
  Table(const YAML::Node& node, std::string source, std::string name)
      : node_(node), source_(std::move(source)), name_(std::move(name)) {
    if (!node_.IsMap()) Fail(node_, "is not a table");
    std::set<std::string> seen;
    for (const auto& entry : node_) {
      if (!entry.first.IsScalar())
        Fail(entry.first, "has a key that is no name");
      if (!seen.insert(entry.first.Scalar()).second) {
        Fail(entry.first, "has '" + entry.first.Scalar() + "' twice");
      }
    }
  }

  // Throws for the first key that is not among these.
  void AllowOnly(const std::vector<std::string_view>& keys) const {
    for (const auto& entry : node_) {
      if (std::find(keys.begin(), keys.end(), entry.first.Scalar()) ==
          keys.end()) {
        Fail(entry.first, "unknown key '" + entry.first.Scalar() + "'");
      }
    }
  }

  Table Sub(const std::string& key) const {
    return Table(Get(key), source_, name_.empty() ? key : name_ + "." + key);
  }

  double Number(const std::string& key) const {
    const YAML::Node value = Get(key);
    double number = 0;
    if (!value.IsScalar() || !YAML::convert<double>::decode(value, number) ||
        !std::isfinite(number)) {
      Fail(value, "'" + key + "' is not a number");
    }
    return number;
  }

  double PositiveNumber(const std::string& key) const {
    const double number = Number(key);
    if (number <= 0) Fail(Get(key), "'" + key + "' is not positive");
    return number;
  }

 private:
  YAML::Node Get(const std::string& key) const {
    const YAML::Node value = node_[key];
    if (!value) Fail(node_, "misses '" + key + "'");
    return value;
  }

  [[noreturn]] void Fail(const YAML::Node& at, const std::string& what) const {
    throw InputError(source_ + ":" + std::to_string(at.Mark().line + 1) + ": " +
                     (name_.empty() ? "" : name_ + ": ") + what);
  }

  YAML::Node node_;
  std::string source_;
  std::string name_;
};

BoneStatistics ParseBone(const Table& table) {
  table.AllowOnly(
      {"male", "female", "sigma_population", "sigma_systematic", "basis"});
  BoneStatistics bone;
  bone.mean_male = table.PositiveNumber("male");
  bone.mean_female = table.PositiveNumber("female");
  bone.sigma_population = table.PositiveNumber("sigma_population");
  bone.sigma_systematic = table.PositiveNumber("sigma_systematic");
  return bone;
}

GirthRegression ParseGirth(const Table& table) {
  table.AllowOnly({"male", "female"});
  GirthRegression girth;
  const Table male = table.Sub("male");
  const Table female = table.Sub("female");
  for (const Table* sex : {&male, &female}) {
    sex->AllowOnly({"a", "b", "c", "sigma"});
  }
  girth.a_male = male.Number("a");
  girth.b_male = male.Number("b");
  girth.c_male = male.Number("c");
  girth.sigma_male = male.PositiveNumber("sigma");
  girth.a_female = female.Number("a");
  girth.b_female = female.Number("b");
  girth.c_female = female.Number("c");
  girth.sigma_female = female.PositiveNumber("sigma");
  return girth;
}

// "elbow" for both l_elbow and r_elbow; "neck" for neck.
std::string_view NameWithoutSide(int joint) {
  std::string_view name = kJointNames[joint];
  if (MirrorJoint(joint) != joint) name.remove_prefix(2);
  return name;
}

Anthropometry ParseTables(const Table& root) {
  root.AllowOnly({"sources", "bones", "girths"});
  Anthropometry tables;
  const Table bones = root.Sub("bones");
  std::vector<std::string_view> bone_names;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    if (kJointParents[joint] < 0) continue;
    bone_names.push_back(NameWithoutSide(joint));
  }
  bones.AllowOnly(bone_names);
  for (int joint = 0; joint < kNumJoints; ++joint) {
    if (kJointParents[joint] < 0) continue;
    tables.bone[joint] =
        ParseBone(bones.Sub(std::string(NameWithoutSide(joint))));
  }
  const Table girths = root.Sub("girths");
  girths.AllowOnly(
      {"chest", "waist", "buttock", "thigh", "calf", "neck", "ankle"});
  tables.chest = ParseGirth(girths.Sub("chest"));
  tables.waist = ParseGirth(girths.Sub("waist"));
  tables.buttock = ParseGirth(girths.Sub("buttock"));
  tables.thigh = ParseGirth(girths.Sub("thigh"));
  tables.calf = ParseGirth(girths.Sub("calf"));
  tables.neck = ParseGirth(girths.Sub("neck"));
  tables.ankle = ParseGirth(girths.Sub("ankle"));
  return tables;
}

}  // namespace

double BoneStatistics::Sigma() const {
  return std::hypot(sigma_population, sigma_systematic);
}

// Sexes blend in the logarithm.
double GirthRegression::Girth(double sex, double mass, double stature) const {
  const double ln_mass = std::log(mass);
  const double ln_stature = std::log(stature);
  const double male = a_male + b_male * ln_mass + c_male * ln_stature;
  const double female = a_female + b_female * ln_mass + c_female * ln_stature;
  return std::exp(female + sex * (male - female)) * 1e-3;
}

Anthropometry Anthropometry::Parse(const std::string& text,
                                   const std::string& source) {
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw InputError(source + ":" + std::to_string(error.mark.line + 1) + ": " +
                     error.msg);
  }
  return ParseTables(Table(root, source, ""));
}

const Anthropometry& Anthropometry::Default() {
  static const Anthropometry& tables = *new Anthropometry(Parse(
      std::string(EmbeddedData("anthropometry.yaml")), "anthropometry.yaml"));
  return tables;
}

}  // namespace sweepfit
