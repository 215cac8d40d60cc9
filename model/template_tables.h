// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "model/skeleton.h"
#include "model/template_field.h"

namespace sweepfit {

// One part of the body as sections, in the units of the file's table.
struct SectionTable {
  double round_start = 0;
  double round_end = 0;
  std::vector<StackSection> sections;
};

struct FingerTable {
  Eigen::Vector3d root, tip;  // along the hand, towards thumb, towards palm
  Eigen::Vector2d radius;     // there; all in hand lengths
};

struct BlobTable {
  std::string part;
  Blob blob;
};

// A tape girth that the template is fitted to.
struct GirthTarget {
  std::string name;
  std::string part;
  double level = 0;  // height, or bones of the limb
  double girth = 0;  // fraction of stature
  double mass_exponent = 0;
};

// A ring of the trunk's mesh; `row` may be skipped between keys.
struct TrunkRingKey {
  double row, height, anterior, lean_degrees;
};
struct LimbRingKey {
  double row, bones;
};

struct TemplateBlend {
  double neck, head, arm, leg, foot, finger, legs;
};

// The file model/data/template.yaml, blended for one sex. Lengths are
// fractions of stature.
struct TemplateTables {
  std::array<Eigen::Vector3d, kNumJoints> rest_direction;  // unit vectors
  double ponderal_index = 0;                               // kg / m^3
  double ankle_height = 0;  // of the joint above the soles
  SectionTable trunk, neck, head, arm, leg, foot;
  double foot_toe_out = 0;  // radians
  std::array<FingerTable, 5> finger;
  std::vector<BlobTable> blobs;
  TemplateBlend blend;
  std::vector<GirthTarget> girths;
  std::vector<TrunkRingKey> trunk_rings;
  double groin_drop = 0;
  double groin_rows = 0;
  // Of the arm's opening: inset of the centre from the flank, height, z.
  Eigen::Vector3d arm_hole;
  double arm_pit = 0;        // height where the flank is measured
  double arm_hole_lean = 0;  // radians
  std::vector<LimbRingKey> arm_rings, leg_rings;

  // sex: 0 female .. 1 male. Errors name `source` and the key or line.
  static TemplateTables Parse(const std::string& text,
                              const std::string& source,
                              double sex);
  // The tables that come with the program.
  static TemplateTables Default(double sex);
};

}  // namespace sweepfit
