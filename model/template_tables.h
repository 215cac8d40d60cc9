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
  double smooth = 0;  // standard deviation of the smoothing along the part
  std::vector<StackSection> sections;
};

// A finger or toe: points from root to tip, and the radii there.
struct DigitTable {
  std::vector<Eigen::Vector3d> point;
  std::vector<double> radius;
};

// Shapes added to a part or carved from it, in the coordinates of the part.
struct BlobTable {
  std::string part;
  Blob blob;
};
struct TubeTable {
  std::string part;
  Tube tube;
  double blend_width = 0;
  bool carve = false;
};

// The auricle, on the left; statures.
struct EarTable {
  Eigen::Vector3d center;  // of its outline
  double half_length = 0;
  double half_breadth = 0;
  double lean = 0;   // of its length, backwards at the top; radians
  double flare = 0;  // between the auricle and the head, radians
  double thick = 0;  // of the rim
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
  double neck, head, arm, leg, foot, finger, toe, sole, legs;
};

// The file model/data/template.yaml, blended for one sex. Lengths are
// fractions of stature.
struct TemplateTables {
  std::array<Eigen::Vector3d, kNumJoints> rest_direction;  // unit vectors
  double ponderal_index = 0;                               // kg / m^3
  double ankle_height = 0;  // of the joint above the soles
  SectionTable trunk, neck, head, arm, leg, foot;
  double foot_toe_out = 0;  // radians
  // In hand lengths: along the hand, towards the thumb, towards the palm.
  std::array<DigitTable, 5> finger;
  // Forward, lateral, up, from the sole below the ankle.
  std::array<DigitTable, 5> toe;
  EarTable ear;
  std::vector<BlobTable> blobs;
  std::vector<TubeTable> tubes;
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
