// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include "model/body.h"

namespace sweepfit {

using VertexGrid = std::vector<std::vector<int>>;  // [row][column], -1: none

// Numbers of rows and columns of the rings that make up the template.
struct TemplateRings {
  static constexpr int kTrunkColumns = 48;  // ring around the trunk
  static constexpr int kHalfTrunk = kTrunkColumns / 2;
  static constexpr int kTrunkRows = 102;
  static constexpr int kNeckRow = 44;  // the head's chart begins here
  static constexpr int kCapSide = 12;  // quads along a side of the crown cap
  // The ear's opening on the side of the head and its rings, rim included.
  static constexpr int kEarRow = 59;
  static constexpr int kEarRows = 20;
  static constexpr int kEarColumn = 16;
  static constexpr int kEarColumns = 3;
  static constexpr int kEarLoop = 2 * (kEarRows + kEarColumns);
  static constexpr int kEarRings = 4;
  static constexpr int kArmPatchColumns = 6;
  static constexpr int kArmPatchRows = 7;
  static constexpr int kArmPatchRow = 32;  // lowest row of the arm's opening
  static constexpr int kArmColumns = 2 * (kArmPatchColumns + kArmPatchRows);
  static constexpr int kWristRow = 44;
  static constexpr int kPalmRow = 54;   // the knuckles, where fingers begin
  static constexpr int kThumbRow = 48;  // first row of the thumb's opening
  static constexpr int kFingerRows = 10;
  static constexpr int kStripEdges = 8;  // across the crotch
  static constexpr int kLegColumns = kHalfTrunk + kStripEdges;
  static constexpr int kAnkleRow = 48;
  static constexpr int kToeRow = 78;  // where toes begin
  static constexpr int kToeRows = 6;
  // Three columns to a toe above and below, one between at either side.
  static constexpr int kToeColumns = 15;
  static constexpr int kFirstToeColumn = -3;  // above, at the inside
};

// A corner of a quad in the grid of a UV chart.
struct ChartCorner {
  int column = 0;
  int row = 0;
};

// A chart of the left half. A symmetric chart straddles the plane x = 0 and
// holds the mirror image too, at negated columns; the others are copied for
// the right half.
struct TemplateChart {
  std::string name;
  bool symmetric = false;
};

// The left half (x >= 0) of the template as an all-quad complex; mirrored at
// x = 0 it closes to a sphere.
struct HalfComplex {
  int num_vertices = 0;
  std::vector<Quad> quads;
  std::vector<int> quad_chart;
  std::vector<std::array<ChartCorner, 4>> quad_corner;
  std::vector<TemplateChart> charts;
  std::vector<BodyPart> part;      // per vertex
  std::vector<bool> on_mid_plane;  // per vertex

  // Trunk rings from the groin to the top of the head; columns 0 (front) over
  // the left side to 24 (back).
  VertexGrid trunk;
  VertexGrid crown;        // [j front to back][i mid plane to left]
  std::vector<int> strip;  // front to back across the crotch, with both ends
  // Columns run front, underside, back, top; row 0 is the arm hole.
  VertexGrid arm;
  // Rings of eight from the base to the tip, closed by one vertex.
  struct Digit {
    VertexGrid ring;
    int tip = -1;
  };
  std::array<Digit, 5> finger;  // index, middle, ring, little, thumb
  std::array<Digit, 5> toe;     // great to little
  // Loops around the ear, outwards: on the head, the back of the auricle, its
  // rim, the inside of the rim. Columns run from the middle of the front edge
  // over the lobe, the back and the top.
  VertexGrid ear;
  VertexGrid ear_floor;  // [row up][column backwards], border: the last loop
  // Columns run front-medial, lateral, back-medial, then along the strip.
  VertexGrid leg;
};

HalfComplex BuildHalfComplex();

// The whole mesh: the left half's vertices keep their numbers, those off the
// mid plane are repeated in the same order for the right half. Its uv stays
// empty.
BodyTopology MirrorComplex(const HalfComplex& half);

}  // namespace sweepfit
