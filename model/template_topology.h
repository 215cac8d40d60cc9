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
  static constexpr int kTrunkRows = 90;
  static constexpr int kNeckRow = 44;  // the head's chart begins here
  static constexpr int kCapSide = 12;  // quads along a side of the crown cap
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
  static constexpr int kToeRow = 78;
  static constexpr int kToeCapSide = kLegColumns / 4;
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
  std::array<VertexGrid, 5> finger;  // index, middle, ring, little, thumb
  std::array<int, 5> finger_tip;
  // Columns run front-medial, lateral, back-medial, then along the strip.
  VertexGrid leg;
  VertexGrid toe_cap;
};

HalfComplex BuildHalfComplex();

// The whole mesh: the left half's vertices keep their numbers, those off the
// mid plane are repeated in the same order for the right half. Its uv stays
// empty.
BodyTopology MirrorComplex(const HalfComplex& half);

}  // namespace sweepfit
