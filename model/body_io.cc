// SPDX-License-Identifier: Apache-2.0
#include "model/body_io.h"

#include <glog/logging.h>

#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "model/file_io.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kFormat = "sweepfit-body";
constexpr int kVersion = 1;
constexpr int kMaxAttachments = 3;
// Attachments are rows of these figures.
constexpr int kFiguresPerAttachment = 6;

constexpr std::array<std::string_view, 10> kPartNames = {"trunk",
                                                         "head",
                                                         "l_arm",
                                                         "l_hand",
                                                         "r_arm",
                                                         "r_hand",
                                                         "l_leg",
                                                         "l_foot",
                                                         "r_leg",
                                                         "r_foot"};

// ----------------------------------------------------------------- saving

// The double with the fewest digits that is this float again.
double ShortDouble(float value) {
  std::array<char, 32> text;
  const char* const end =
      std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  double result = 0;
  std::from_chars(text.data(), end, result);
  return result;
}

template <typename Derived>
Json VectorToJson(const Eigen::MatrixBase<Derived>& vector) {
  Json json = Json::array();
  for (Eigen::Index i = 0; i < vector.size(); ++i) json.push_back(vector[i]);
  return json;
}

template <typename Derived>
Json RowsToJson(const Eigen::MatrixBase<Derived>& matrix) {
  Json json = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    json.push_back(VectorToJson(matrix.row(i)));
  }
  return json;
}

// Bones by the joint that ends them; none ends in the root.
Json SkeletonToJson(const Skeleton& skeleton) {
  Json json = Json::object();
  for (int joint = kRoot + 1; joint < kNumJoints; ++joint) {
    json[std::string(kJointNames[joint])] = {
        {"length", skeleton.length[joint]},
        {"rest_direction", VectorToJson(skeleton.rest_direction[joint])}};
  }
  return json;
}

Json SweepToJson(const Sweep& sweep) {
  Json chain = Json::array();
  for (const int joint : sweep.chain) chain.push_back(kJointNames[joint]);
  return {{"name", sweep.name},
          {"chain", chain},
          {"rest_reference", VectorToJson(sweep.rest_reference)},
          {"rigid_end", sweep.rigid_end},
          {"key_u", sweep.key_u},
          {"center_offset", RowsToJson(sweep.center_offset.transpose())},
          {"radius", RowsToJson(sweep.radius)},
          {"log_ratio", RowsToJson(sweep.log_ratio)},
          {"feature_weight", VectorToJson(sweep.feature_weight)}};
}

Json TopologyToJson(const BodyTopology& topology) {
  Json uv = Json::array();
  for (const std::array<Eigen::Vector2f, 4>& corners : topology.uv) {
    Json row = Json::array();
    for (const Eigen::Vector2f& corner : corners) {
      row.push_back(ShortDouble(corner.x()));
      row.push_back(ShortDouble(corner.y()));
    }
    uv.push_back(std::move(row));
  }
  Json part = Json::array();
  for (const BodyPart p : topology.part) {
    part.push_back(kPartNames[static_cast<int>(p)]);
  }
  return {{"quads", topology.quads},
          {"uv", std::move(uv)},
          {"mirror_vertex", topology.mirror_vertex},
          {"part", std::move(part)}};
}

Json BindingToJson(const std::vector<Binding>& bindings) {
  Json json = Json::array();
  for (const Binding& binding : bindings) {
    Json rows = Json::array();
    for (const SweepAttachment& a : binding.attachment) {
      if (a.sweep < 0) continue;
      rows.push_back({a.sweep, a.weight, a.u, a.theta, a.rho, a.tau});
    }
    json.push_back(std::move(rows));
  }
  return json;
}

// One line per member of the document and of its tables, so that a person
// can find their way.
std::string Lines(const Json& json, int depth) {
  if (depth == 0 || !json.is_structured() || json.empty()) return json.dump();
  const std::string indent(2 * (3 - depth), ' ');
  std::string text = json.is_object() ? "{\n" : "[\n";
  for (auto item = json.begin(); item != json.end(); ++item) {
    if (item != json.begin()) text += ",\n";
    text += indent + "  ";
    if (json.is_object()) text += Json(item.key()).dump() + ": ";
    text += Lines(*item, depth - 1);
  }
  return text + "\n" + indent + (json.is_object() ? "}" : "]");
}

// ---------------------------------------------------------------- loading

// A value of the document that knows its place: "sweeps[2].radius".
class Value {
 public:
  Value(const Json& json, std::string file, std::string place)
      : json_(json), file_(std::move(file)), place_(std::move(place)) {}

  [[noreturn]] void Fail(const std::string& what) const {
    throw InputError(file_ + ": " + (place_.empty() ? "" : place_ + " ") +
                     what);
  }

  // Throws unless this is an object with exactly these keys.
  void RequireKeys(const std::vector<std::string_view>& keys) const {
    if (!json_.is_object()) Fail("is not an object");
    for (const std::string_view key : keys) At(key);
    if (json_.size() == keys.size()) return;
    const std::set<std::string_view> known(keys.begin(), keys.end());
    for (auto item = json_.begin(); item != json_.end(); ++item) {
      if (known.count(item.key()) == 0) {
        Fail("has an unknown key '" + item.key() + "'");
      }
    }
  }

  Value At(std::string_view key) const {
    if (!json_.is_object()) Fail("is not an object");
    const auto item = json_.find(std::string(key));
    if (item == json_.end()) Fail("misses '" + std::string(key) + "'");
    return {
        *item,
        file_,
        place_.empty() ? std::string(key) : place_ + "." + std::string(key)};
  }

  std::size_t Size() const {
    if (!json_.is_array()) Fail("is not a list");
    return json_.size();
  }

  void RequireSize(std::size_t size) const {
    if (Size() != size) {
      Fail("has " + std::to_string(Size()) + " entries instead of " +
           std::to_string(size));
    }
  }

  Value operator[](std::size_t i) const {
    return {json_[i], file_, place_ + "[" + std::to_string(i) + "]"};
  }

  double Number() const {
    if (!json_.is_number()) Fail("is not a number");
    const double number = json_.get<double>();
    if (!std::isfinite(number)) Fail("is not a finite number");
    return number;
  }

  double PositiveNumber() const {
    const double number = Number();
    if (number <= 0) Fail("is not positive");
    return number;
  }

  // An integer in [0, count).
  int Index(std::size_t count) const {
    if (!json_.is_number_integer()) Fail("is not an integer");
    const auto index = json_.get<std::int64_t>();
    if (index < 0 || index >= static_cast<std::int64_t>(count)) {
      Fail("is " + std::to_string(index) + ", not within 0.." +
           std::to_string(static_cast<std::int64_t>(count) - 1));
    }
    return static_cast<int>(index);
  }

  bool Bool() const {
    if (!json_.is_boolean()) Fail("is neither true nor false");
    return json_.get<bool>();
  }

  std::string String() const {
    if (!json_.is_string()) Fail("is not a text");
    return json_.get<std::string>();
  }

  Eigen::VectorXd Vector(std::size_t size) const {
    RequireSize(size);
    Eigen::VectorXd vector(size);
    for (std::size_t i = 0; i < size; ++i) vector[i] = (*this)[i].Number();
    return vector;
  }

  Eigen::MatrixXd Rows(std::size_t rows, std::size_t columns) const {
    RequireSize(rows);
    Eigen::MatrixXd matrix(rows, columns);
    for (std::size_t i = 0; i < rows; ++i) {
      matrix.row(i) = (*this)[i].Vector(columns);
    }
    return matrix;
  }

 private:
  const Json& json_;
  std::string file_;
  std::string place_;
};

Eigen::Vector3d ParseUnitVector(const Value& value) {
  const Eigen::Vector3d vector = value.Vector(3);
  if (std::abs(vector.norm() - 1) > 1e-9) value.Fail("is not a unit vector");
  return vector;
}

Skeleton ParseSkeleton(const Value& value) {
  value.RequireKeys({kJointNames.begin() + kRoot + 1, kJointNames.end()});
  Skeleton skeleton;
  skeleton.length[kRoot] = 0;
  skeleton.rest_direction[kRoot] = Eigen::Vector3d::UnitY();
  for (int joint = kRoot + 1; joint < kNumJoints; ++joint) {
    const Value bone = value.At(kJointNames[joint]);
    bone.RequireKeys({"length", "rest_direction"});
    skeleton.length[joint] = bone.At("length").PositiveNumber();
    skeleton.rest_direction[joint] = ParseUnitVector(bone.At("rest_direction"));
  }
  return skeleton;
}

std::vector<int> ParseChain(const Value& value) {
  std::vector<int> chain;
  for (std::size_t i = 0; i < value.Size(); ++i) {
    const int joint = FindJoint(value[i].String());
    if (joint < 0) value[i].Fail("is no joint: '" + value[i].String() + "'");
    if (i > 0 && kJointParents[joint] != chain.back()) {
      value[i].Fail("does not follow the joint before it");
    }
    chain.push_back(joint);
  }
  if (chain.size() < 2) value.Fail("has fewer than 2 joints");
  return chain;
}

std::vector<double> ParseKeys(const Value& value) {
  std::vector<double> keys;
  for (std::size_t i = 0; i < value.Size(); ++i) {
    keys.push_back(value[i].Number());
    if (i > 0 && keys[i] <= keys[i - 1]) value[i].Fail("does not ascend");
  }
  if (keys.empty()) value.Fail("is empty");
  return keys;
}

Sweep ParseSweep(const Value& value, const Skeleton& skeleton) {
  value.RequireKeys({"name",
                     "chain",
                     "rest_reference",
                     "rigid_end",
                     "key_u",
                     "center_offset",
                     "radius",
                     "log_ratio",
                     "feature_weight"});
  Sweep sweep;
  sweep.name = value.At("name").String();
  sweep.chain = ParseChain(value.At("chain"));
  sweep.rest_reference = value.At("rest_reference").Vector(3);
  const Eigen::Vector3d& along = skeleton.rest_direction[sweep.chain[1]];
  if (!(sweep.rest_reference.cross(along).norm() >
        1e-3 * sweep.rest_reference.norm())) {
    value.At("rest_reference").Fail("lies along the first bone");
  }
  sweep.rigid_end = value.At("rigid_end").Bool();
  sweep.key_u = ParseKeys(value.At("key_u"));
  const std::size_t rows = sweep.key_u.size();
  sweep.center_offset = value.At("center_offset").Rows(rows, 2).transpose();
  const Value radius = value.At("radius");
  const std::size_t columns = radius.Size() > 0 ? radius[0].Size() : 0;
  if (columns == 0) radius.Fail("is empty");
  sweep.radius = radius.Rows(rows, columns);
  if (!(sweep.radius.array() > 0).all()) radius.Fail("is not positive");
  sweep.log_ratio = value.At("log_ratio").Rows(rows, columns);
  sweep.feature_weight = value.At("feature_weight").Vector(rows);
  return sweep;
}

BodyPart ParsePart(const Value& value) {
  const std::string name = value.String();
  for (std::size_t i = 0; i < kPartNames.size(); ++i) {
    if (name == kPartNames[i]) return static_cast<BodyPart>(i);
  }
  value.Fail("is no part of a body: '" + name + "'");
}

BodyTopology ParseTopology(const Value& value, std::size_t num_vertices) {
  value.RequireKeys({"quads", "uv", "mirror_vertex", "part"});
  BodyTopology topology;
  const Value quads = value.At("quads");
  for (std::size_t i = 0; i < quads.Size(); ++i) {
    quads[i].RequireSize(4);
    Quad quad;
    for (int k = 0; k < 4; ++k) quad[k] = quads[i][k].Index(num_vertices);
    topology.quads.push_back(quad);
  }
  const Value uv = value.At("uv");
  uv.RequireSize(quads.Size());
  for (std::size_t i = 0; i < uv.Size(); ++i) {
    const Eigen::VectorXd row = uv[i].Vector(8);
    std::array<Eigen::Vector2f, 4> corners;
    for (int k = 0; k < 4; ++k) {
      corners[k] = row.segment<2>(2 * k).cast<float>();
    }
    topology.uv.push_back(corners);
  }
  const Value mirror = value.At("mirror_vertex");
  mirror.RequireSize(num_vertices);
  const Value part = value.At("part");
  part.RequireSize(num_vertices);
  for (std::size_t v = 0; v < num_vertices; ++v) {
    topology.mirror_vertex.push_back(mirror[v].Index(num_vertices));
    topology.part.push_back(ParsePart(part[v]));
  }
  return topology;
}

Binding ParseBinding(const Value& value, std::size_t num_sweeps) {
  const std::size_t count = value.Size();
  if (count < 1 || count > kMaxAttachments) {
    value.Fail("has " + std::to_string(count) +
               " attachments instead of 1 to 3");
  }
  Binding binding;
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Value row = value[i];
    row.RequireSize(kFiguresPerAttachment);
    SweepAttachment& a = binding.attachment[i];
    a.sweep = row[0].Index(num_sweeps);
    a.weight = row[1].PositiveNumber();
    a.u = row[2].Number();
    a.theta = row[3].Number();
    a.rho = row[4].Number();
    a.tau = row[5].Number();
    if (i > 0 && a.weight > binding.attachment[i - 1].weight) {
      value.Fail("does not begin with the heaviest attachment");
    }
    sum += a.weight;
  }
  if (std::abs(sum - 1) > 1e-6) value.Fail("has weights that do not sum to 1");
  return binding;
}

Body ParseBody(const Value& value) {
  if (value.At("format").String() != kFormat) {
    value.At("format").Fail("is not '" + std::string(kFormat) + "'");
  }
  if (value.At("version").Number() != kVersion) {
    value.At("version").Fail("is not supported (this program reads " +
                             std::to_string(kVersion) + ")");
  }
  value.RequireKeys({"format",
                     "version",
                     "sex",
                     "stature",
                     "mass",
                     "skeleton",
                     "sweeps",
                     "topology",
                     "binding",
                     "displacement_in_section"});
  Body body;
  body.sex = value.At("sex").Number();
  body.stature = value.At("stature").PositiveNumber();
  body.mass = value.At("mass").PositiveNumber();
  body.skeleton = ParseSkeleton(value.At("skeleton"));
  const Value sweeps = value.At("sweeps");
  for (std::size_t i = 0; i < sweeps.Size(); ++i) {
    body.sweeps.push_back(ParseSweep(sweeps[i], body.skeleton));
  }
  const Value binding = value.At("binding");
  for (std::size_t v = 0; v < binding.Size(); ++v) {
    body.binding.push_back(ParseBinding(binding[v], body.sweeps.size()));
  }
  body.topology = ParseTopology(value.At("topology"), body.binding.size());
  const Value displacement = value.At("displacement_in_section");
  displacement.RequireSize(body.binding.size());
  for (std::size_t v = 0; v < displacement.Size(); ++v) {
    body.displacement_in_section.push_back(displacement[v].Vector(3));
  }
  return body;
}

}  // namespace

void SaveBody(const Body& body, const std::string& path) {
  CHECK_EQ(body.displacement_in_section.size(), body.binding.size());
  Json displacement = Json::array();
  for (const Eigen::Vector3d& d : body.displacement_in_section) {
    displacement.push_back(VectorToJson(d));
  }
  Json sweeps = Json::array();
  for (const Sweep& sweep : body.sweeps) sweeps.push_back(SweepToJson(sweep));
  const Json json = {{"format", kFormat},
                     {"version", kVersion},
                     {"sex", body.sex},
                     {"stature", body.stature},
                     {"mass", body.mass},
                     {"skeleton", SkeletonToJson(body.skeleton)},
                     {"sweeps", std::move(sweeps)},
                     {"topology", TopologyToJson(body.topology)},
                     {"binding", BindingToJson(body.binding)},
                     {"displacement_in_section", std::move(displacement)}};
  WriteWholeFile(Lines(json, 3) + "\n", path);
}

Body LoadBody(const std::string& path) {
  const std::string text = ReadWholeFile(path);
  Json json;
  try {
    json = Json::parse(text);
  } catch (const Json::parse_error& error) {
    throw InputError(path + ": is not sound JSON near byte " +
                     std::to_string(error.byte) + " of " +
                     std::to_string(text.size()));
  } catch (const Json::out_of_range&) {
    throw InputError(path + ": holds a number beyond the range of a double");
  }
  return ParseBody(Value(json, path, ""));
}

}  // namespace sweepfit
