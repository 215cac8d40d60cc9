// SPDX-License-Identifier: Apache-2.0
#include "model/template_tables.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
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

  // Two rows or more, in any order.
  std::vector<Numbers> Table(const YAML::Node& node, size_t size) const {
    if (!node.IsSequence() || node.size() < 2) {
      Fail(node, "two rows or more are needed");
    }
    std::vector<Numbers> rows;
    for (const YAML::Node& row : node) rows.push_back(List(row, size));
    return rows;
  }

  std::vector<Numbers> BlendedTable(const YAML::Node& map, size_t size) const {
    const auto male = Table(Key(map, "male"), size);
    const auto female = Table(Key(map, "female"), size);
    if (male.size() != female.size())
      Fail(map, "male and female need the same number of rows");
    std::vector<Numbers> rows;
    for (size_t i = 0; i < male.size(); ++i)
      rows.push_back(Blend(female[i], male[i]));
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
    table.smooth = Number(Key(map, "smooth"));
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

// Rows of x, y, z, radius.
DigitTable ReadDigit(const TableReader& reader,
                     const YAML::Node& node,
                     const std::vector<Numbers>& rows) {
  DigitTable digit;
  for (const Numbers& row : rows) {
    if (row[3] <= 0) reader.Fail(node, "radii must be positive");
    digit.point.push_back(Vector(row));
    digit.radius.push_back(row[3]);
  }
  return digit;
}

void ReadDigits(const TableReader& reader,
                const YAML::Node& root,
                TemplateTables* tables) {
  const YAML::Node fingers = reader.Key(root, "fingers");
  const YAML::Node toes = reader.Key(root, "toes");
  if (!fingers.IsSequence() || fingers.size() != tables->finger.size())
    reader.Fail(fingers, "five fingers are needed");
  if (!toes.IsSequence() || toes.size() != tables->toe.size())
    reader.Fail(toes, "five toes are needed");
  for (size_t i = 0; i < tables->finger.size(); ++i) {
    tables->finger[i] = ReadDigit(
        reader, fingers[i], reader.Table(reader.Key(fingers[i], "points"), 4));
    tables->toe[i] =
        ReadDigit(reader, toes[i], reader.BlendedTable(toes[i], 4));
  }
}

void ReadEar(const TableReader& reader,
             const YAML::Node& node,
             TemplateTables* tables) {
  const Numbers shape = reader.Blended(node, 5);
  EarTable& ear = tables->ear;
  ear.center = Vector(shape);
  ear.half_length = shape[3];
  ear.half_breadth = shape[4];
  ear.lean = Radians(reader.Number(reader.Key(node, "lean_degrees")));
  ear.flare = Radians(reader.Number(reader.Key(node, "flare_degrees")));
  ear.thick = reader.Number(reader.Key(node, "thick"));
}

std::string ReadPart(const TableReader& reader, const YAML::Node& entry) {
  const std::string part = reader.Text(reader.Key(entry, "part"));
  for (const char* known : {"trunk", "neck", "head", "arm", "leg", "foot"}) {
    if (part == known) return part;
  }
  reader.Fail(entry, "there is no part " + part);
}

bool ReadCarve(const YAML::Node& entry) {
  return entry["carve"] && entry["carve"].as<bool>();
}

void ReadBlobs(const TableReader& reader,
               const YAML::Node& node,
               TemplateTables* tables) {
  for (const YAML::Node& entry : node) {
    const Numbers shape = reader.Blended(entry, 6);
    BlobTable table;
    table.part = ReadPart(reader, entry);
    Blob& blob = table.blob;
    blob.center = {shape[0], shape[1], shape[2]};
    blob.radii = {shape[3], shape[4], shape[5]};
    if (blob.radii.minCoeff() <= 0)
      reader.Fail(entry, "radii must be positive");
    auto turn = [&](const char* key, const Eigen::Vector3d& axis) {
      const double degrees = entry[key] ? reader.Number(entry[key]) : 0;
      return Eigen::AngleAxisd(Radians(degrees), axis).toRotationMatrix();
    };
    blob.world_from_blob = turn("yaw", Eigen::Vector3d::UnitY()) *
                           turn("pitch", Eigen::Vector3d::UnitX()) *
                           turn("roll", Eigen::Vector3d::UnitZ());
    blob.blend_width = reader.Number(reader.Key(entry, "width"));
    blob.carve = ReadCarve(entry);
    tables->blobs.push_back(table);
  }
}

void ReadTubes(const TableReader& reader,
               const YAML::Node& node,
               TemplateTables* tables) {
  for (const YAML::Node& entry : node) {
    TubeTable table;
    table.part = ReadPart(reader, entry);
    const DigitTable points =
        ReadDigit(reader, entry, reader.BlendedTable(entry, 4));
    table.tube = {points.point, points.radius};
    table.blend_width = reader.Number(reader.Key(entry, "width"));
    table.carve = ReadCarve(entry);
    tables->tubes.push_back(table);
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
  ReadDigits(reader, root, &tables);
  ReadEar(reader, reader.Key(root, "ear"), &tables);
  ReadBlobs(reader, reader.Key(root, "blobs"), &tables);
  ReadTubes(reader, reader.Key(root, "tubes"), &tables);
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
                  width("toe"),
                  width("sole"),
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
