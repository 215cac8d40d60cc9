// SPDX-License-Identifier: Apache-2.0
#include "model/template_tables.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <numbers>

#include "model/embedded_data.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

using Numbers = std::vector<double>;

double Radians(double degrees) { return degrees * std::numbers::pi / 180; }

// Reads nodes of one file and says where an error is.
class TableReader {
 public:
  TableReader(std::string source, double sex)
      : source_(std::move(source)), sex_(sex) {}

  [[noreturn]] void Fail(const YAML::Node& node,
                         const std::string& what) const {
    throw InputError(source_ + ": line " +
                     std::to_string(node.Mark().line + 1) + ": " + what);
  }

  YAML::Node Key(const YAML::Node& map, const std::string& key) const {
    if (!map.IsMap()) Fail(map, "a map with the key " + key + " is needed");
    const YAML::Node node = map[key];
    if (!node) Fail(map, "the key " + key + " is missing");
    return node;
  }

  double Number(const YAML::Node& node) const {
    try {
      return node.as<double>();
    } catch (const YAML::Exception&) {
      Fail(node, "a number is needed");
    }
  }

  std::string Text(const YAML::Node& node) const {
    try {
      return node.as<std::string>();
    } catch (const YAML::Exception&) {
      Fail(node, "a text is needed");
    }
  }

  Numbers List(const YAML::Node& node, size_t size) const {
    if (!node.IsSequence() || node.size() != size) {
      Fail(node, std::to_string(size) + " numbers are needed");
    }
    Numbers numbers;
    for (const YAML::Node& entry : node) numbers.push_back(Number(entry));
    return numbers;
  }

  std::vector<Numbers> Rows(const YAML::Node& node, size_t size) const {
    if (!node.IsSequence() || node.size() < 2) {
      Fail(node, "two rows or more are needed");
    }
    std::vector<Numbers> rows;
    for (const YAML::Node& row : node) {
      rows.push_back(List(row, size));
      if (rows.size() > 1 && rows.back()[0] <= rows[rows.size() - 2][0]) {
        Fail(row, "the first numbers of the rows must ascend");
      }
    }
    return rows;
  }

  Numbers Blended(const YAML::Node& map, size_t size) const {
    return Blend(List(Key(map, "female"), size), List(Key(map, "male"), size));
  }

  double BlendedNumber(const YAML::Node& map) const {
    const double female = Number(Key(map, "female"));
    return female + sex_ * (Number(Key(map, "male")) - female);
  }

  SectionTable Sections(const YAML::Node& map) const {
    SectionTable table;
    const Numbers round = List(Key(map, "round"), 2);
    table.round_start = round[0];
    table.round_end = round[1];
    const size_t size = Key(map, "male")[0].size();
    if (size != 5 && size != 6) Fail(map, "rows of 5 or 6 numbers are needed");
    const auto male = Rows(Key(map, "male"), size);
    const auto female = Rows(Key(map, "female"), size);
    if (male.size() != female.size()) {
      Fail(map, "male and female need the same number of rows");
    }
    for (size_t i = 0; i < male.size(); ++i) {
      const Numbers row = Blend(female[i], male[i]);
      // With five numbers the section is centred across.
      table.sections.push_back({row[0],
                                row[1],
                                row[2],
                                row[3],
                                size == 6 ? row[4] : 0,
                                row[size - 1]});
    }
    return table;
  }

 private:
  Numbers Blend(const Numbers& female, const Numbers& male) const {
    Numbers blended(female.size());
    for (size_t i = 0; i < female.size(); ++i)
      blended[i] = female[i] + sex_ * (male[i] - female[i]);
    return blended;
  }

  std::string source_;
  double sex_;
};

Eigen::Vector3d Vector(const Numbers& numbers) {
  return {numbers[0], numbers[1], numbers[2]};
}

void ReadDirections(const TableReader& reader,
                    const YAML::Node& map,
                    TemplateTables* tables) {
  tables->rest_direction[kRoot].setZero();
  for (int joint = 1; joint < kNumJoints; ++joint) {
    const int mirror = MirrorJoint(joint);
    if (mirror < joint) {  // the right side
      tables->rest_direction[joint] =
          tables->rest_direction[mirror].cwiseProduct(
              Eigen::Vector3d(-1, 1, 1));
      continue;
    }
    const YAML::Node node = reader.Key(map, std::string(kJointNames[joint]));
    const Eigen::Vector3d direction = Vector(reader.List(node, 3));
    if (direction.norm() < 1e-6) reader.Fail(node, "a direction is needed");
    tables->rest_direction[joint] = direction.normalized();
  }
}

void ReadFingers(const TableReader& reader,
                 const YAML::Node& node,
                 TemplateTables* tables) {
  if (!node.IsSequence() || node.size() != tables->finger.size()) {
    reader.Fail(node, "five fingers are needed");
  }
  for (size_t i = 0; i < tables->finger.size(); ++i) {
    FingerTable& finger = tables->finger[i];
    finger.root = Vector(reader.List(reader.Key(node[i], "root"), 3));
    finger.tip = Vector(reader.List(reader.Key(node[i], "tip"), 3));
    const Numbers radius = reader.List(reader.Key(node[i], "radius"), 2);
    finger.radius = {radius[0], radius[1]};
  }
}

void ReadBlobs(const TableReader& reader,
               const YAML::Node& node,
               TemplateTables* tables) {
  for (const YAML::Node& entry : node) {
    const Numbers shape = reader.Blended(entry, 6);
    BlobTable table;
    table.part = reader.Text(reader.Key(entry, "part"));
    Blob& blob = table.blob;
    blob.center = {shape[0], shape[1], shape[2]};
    blob.radii = {shape[3], shape[4], shape[5]};
    if (blob.radii.minCoeff() <= 0)
      reader.Fail(entry, "radii must be positive");
    const double pitch = Radians(reader.Number(reader.Key(entry, "pitch")));
    blob.world_from_blob << 1, 0, 0,           //
        0, std::cos(pitch), -std::sin(pitch),  //
        0, std::sin(pitch), std::cos(pitch);
    blob.blend_width = reader.Number(reader.Key(entry, "width"));
    blob.carve = entry["carve"] && entry["carve"].as<bool>();
    tables->blobs.push_back(table);
  }
}

void ReadGirths(const TableReader& reader,
                const YAML::Node& node,
                TemplateTables* tables) {
  for (const YAML::Node& entry : node) {
    GirthTarget target;
    target.name = reader.Text(reader.Key(entry, "name"));
    target.part = reader.Text(reader.Key(entry, "part"));
    const Numbers numbers = reader.Blended(entry, 2);
    target.level = numbers[0];
    target.girth = numbers[1];
    if (entry["mass_exponent"])
      target.mass_exponent = reader.Number(entry["mass_exponent"]);
    tables->girths.push_back(target);
  }
}

void ReadRings(const TableReader& reader,
               const YAML::Node& root,
               TemplateTables* tables) {
  for (const Numbers& row : reader.Rows(reader.Key(root, "trunk_rings"), 4))
    tables->trunk_rings.push_back({row[0], row[1], row[2], row[3]});
  tables->groin_drop = reader.Number(reader.Key(root, "groin_drop"));
  tables->groin_rows = reader.Number(reader.Key(root, "groin_rows"));
  const YAML::Node hole = reader.Key(root, "arm_hole");
  tables->arm_hole = Vector(reader.Blended(hole, 3));
  tables->arm_pit = reader.BlendedNumber(reader.Key(hole, "arm_pit"));
  tables->arm_hole_lean =
      Radians(reader.Number(reader.Key(hole, "lean_degrees")));
  for (const Numbers& row : reader.Rows(reader.Key(root, "arm_rings"), 2))
    tables->arm_rings.push_back({row[0], row[1]});
  for (const Numbers& row : reader.Rows(reader.Key(root, "leg_rings"), 2))
    tables->leg_rings.push_back({row[0], row[1]});
}

}  // namespace

TemplateTables TemplateTables::Parse(const std::string& text,
                                     const std::string& source,
                                     double sex) {
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw InputError(source + ": " + error.what());
  }
  const TableReader reader(source, sex);
  TemplateTables tables;
  ReadDirections(reader, reader.Key(root, "rest_direction"), &tables);
  tables.ponderal_index =
      reader.BlendedNumber(reader.Key(root, "ponderal_index"));
  tables.ankle_height = reader.BlendedNumber(reader.Key(root, "ankle_height"));
  tables.trunk = reader.Sections(reader.Key(root, "trunk"));
  tables.neck = reader.Sections(reader.Key(root, "neck"));
  tables.head = reader.Sections(reader.Key(root, "head"));
  tables.arm = reader.Sections(reader.Key(root, "arm"));
  tables.leg = reader.Sections(reader.Key(root, "leg"));
  tables.foot = reader.Sections(reader.Key(root, "foot"));
  tables.foot_toe_out =
      Radians(reader.Number(reader.Key(root, "foot_toe_out_degrees")));
  ReadFingers(reader, reader.Key(root, "fingers"), &tables);
  ReadBlobs(reader, reader.Key(root, "blobs"), &tables);
  const YAML::Node blend = reader.Key(root, "blend");
  auto width = [&](const char* key) {
    return reader.Number(reader.Key(blend, key));
  };
  tables.blend = {width("neck"),
                  width("head"),
                  width("arm"),
                  width("leg"),
                  width("foot"),
                  width("finger"),
                  width("legs")};
  ReadGirths(reader, reader.Key(root, "girths"), &tables);
  ReadRings(reader, root, &tables);
  return tables;
}

TemplateTables TemplateTables::Default(double sex) {
  return Parse(
      std::string(EmbeddedData("template.yaml")), "template.yaml", sex);
}

}  // namespace sweepfit
