// SPDX-License-Identifier: Apache-2.0
#include "model/template_topology.h"

#include <glog/logging.h>

namespace sweepfit {
namespace {

using R = TemplateRings;

// Adds vertices and quads to a HalfComplex.
class ComplexBuilder {
 public:
  explicit ComplexBuilder(HalfComplex* complex) : complex_(*complex) {}

  int Vertex(BodyPart part, bool on_mid_plane = false) {
    complex_.part.push_back(part);
    complex_.on_mid_plane.push_back(on_mid_plane);
    return complex_.num_vertices++;
  }

  std::vector<int> Ring(int count, BodyPart part) {
    std::vector<int> ring(count);
    for (int& id : ring) id = Vertex(part);
    return ring;
  }

  int Chart(const std::string& name, bool symmetric) {
    complex_.charts.push_back({name, symmetric});
    return static_cast<int>(complex_.charts.size()) - 1;
  }

  void AddQuad(const Quad& quad,
               int chart,
               const std::array<ChartCorner, 4>& corner) {
    complex_.quads.push_back(quad);
    complex_.quad_chart.push_back(chart);
    complex_.quad_corner.push_back(corner);
  }

  // The quad of the cell (column, row) of a grid whose columns run
  // counter-clockwise around the direction of its rows, or clockwise.
  void AddCell(const VertexGrid& grid,
               int row,
               int column,
               bool clockwise,
               int chart,
               ChartCorner at) {
    const auto& low = grid[row];
    const auto& high = grid[row + 1];
    const int next = (column + 1) % static_cast<int>(low.size());
    const ChartCorner a = at;
    const ChartCorner b = {at.column + 1, at.row};
    const ChartCorner c = {at.column + 1, at.row + 1};
    const ChartCorner d = {at.column, at.row + 1};
    if (clockwise) {
      AddQuad({low[column], high[column], high[next], low[next]},
              chart,
              {a, d, c, b});
    } else {
      AddQuad({low[column], low[next], high[next], high[column]},
              chart,
              {a, b, c, d});
    }
  }

 private:
  HalfComplex& complex_;
};

bool InArmPatch(int row, int column) {
  const int first = R::kHalfTrunk / 2 - R::kArmPatchColumns / 2;
  return row >= R::kArmPatchRow && row < R::kArmPatchRow + R::kArmPatchRows &&
         column >= first && column < first + R::kArmPatchColumns;
}

bool InEarPatch(int row, int column) {
  return row >= R::kEarRow && row < R::kEarRow + R::kEarRows &&
         column >= R::kEarColumn && column < R::kEarColumn + R::kEarColumns;
}

bool InOpening(int row, int column) {
  return InArmPatch(row, column) || InEarPatch(row, column);
}

void AddTrunk(ComplexBuilder& builder, HalfComplex& half) {
  const int torso = builder.Chart("torso", true);
  const int head = builder.Chart("head", true);
  for (int row = 0; row < R::kTrunkRows; ++row) {
    const BodyPart part =
        row > R::kNeckRow ? BodyPart::kHead : BodyPart::kTrunk;
    std::vector<int> ring;
    for (int k = 0; k <= R::kHalfTrunk; ++k) {
      // Inside the arm's or the ear's opening: all four cells around are open.
      const bool open = InOpening(row, k) && InOpening(row - 1, k) &&
                        InOpening(row, k - 1) && InOpening(row - 1, k - 1);
      ring.push_back(open ? -1
                          : builder.Vertex(part, k == 0 || k == R::kHalfTrunk));
    }
    half.trunk.push_back(ring);
  }
  for (int row = 0; row + 1 < R::kTrunkRows; ++row) {
    for (int k = 0; k < R::kHalfTrunk; ++k) {
      if (InOpening(row, k)) continue;
      builder.AddCell(half.trunk,
                      row,
                      k,
                      false,
                      row < R::kNeckRow ? torso : head,
                      {k, row});
    }
  }
}

void AddCrown(ComplexBuilder& builder, HalfComplex& half) {
  const int chart = builder.Chart("crown", true);
  const std::vector<int>& ring = half.trunk.back();
  const int mid = R::kCapSide / 2;
  for (int j = 0; j <= R::kCapSide; ++j) {
    std::vector<int> line;
    for (int i = 0; i <= mid; ++i) {
      int id;
      if (j == 0) {
        id = ring[i];
      } else if (j == R::kCapSide) {
        id = ring[R::kHalfTrunk - i];
      } else if (i == mid) {
        id = ring[mid + j];
      } else {
        id = builder.Vertex(BodyPart::kHead, i == 0);
      }
      line.push_back(id);
    }
    half.crown.push_back(line);
  }
  for (int j = 0; j < R::kCapSide; ++j) {
    for (int i = 0; i < mid; ++i) {
      builder.AddCell(half.crown, j, i, false, chart, {i, j});
    }
  }
}

// The edge loop of the arm's opening in the order of the arm's columns.
std::vector<int> ArmHole(const HalfComplex& half) {
  const int bottom = R::kArmPatchRow;
  const int top = bottom + R::kArmPatchRows;
  const int front = R::kHalfTrunk / 2 - R::kArmPatchColumns / 2;
  const int back = front + R::kArmPatchColumns;
  std::vector<int> loop;
  for (int row = bottom + R::kArmPatchRows / 2; row > bottom; --row)
    loop.push_back(half.trunk[row][front]);
  for (int k = front; k < back; ++k) loop.push_back(half.trunk[bottom][k]);
  for (int row = bottom; row < top; ++row)
    loop.push_back(half.trunk[row][back]);
  for (int k = back; k > front; --k) loop.push_back(half.trunk[top][k]);
  for (int row = top; row > bottom + R::kArmPatchRows / 2; --row)
    loop.push_back(half.trunk[row][front]);
  CHECK_EQ(static_cast<int>(loop.size()), R::kArmColumns);
  return loop;
}

void AddEar(ComplexBuilder& builder, HalfComplex& half) {
  const int back = builder.Chart("ear", false);
  const int floor = builder.Chart("ear_floor", false);
  const int low = R::kEarRow;
  const int high = low + R::kEarRows;
  const int front = R::kEarColumn;
  const int rear = front + R::kEarColumns;
  std::vector<int> loop;
  for (int row = low + R::kEarRows / 2; row > low; --row)
    loop.push_back(half.trunk[row][front]);
  for (int k = front; k < rear; ++k) loop.push_back(half.trunk[low][k]);
  for (int row = low; row < high; ++row) loop.push_back(half.trunk[row][rear]);
  for (int k = rear; k > front; --k) loop.push_back(half.trunk[high][k]);
  for (int row = high; row > low + R::kEarRows / 2; --row)
    loop.push_back(half.trunk[row][front]);
  CHECK_EQ(static_cast<int>(loop.size()), R::kEarLoop);
  half.ear.push_back(loop);
  for (int i = 1; i <= R::kEarRings; ++i)
    half.ear.push_back(builder.Ring(R::kEarLoop, BodyPart::kHead));
  for (int row = 0; row < R::kEarRings; ++row) {
    for (int j = 0; j < R::kEarLoop; ++j)
      builder.AddCell(half.ear, row, j, false, back, {j, row});
  }
  // A grid of the shape of the opening closes the last loop.
  const std::vector<int>& last = half.ear.back();
  for (int b = 0; b <= R::kEarRows; ++b) {
    std::vector<int> line;
    for (int a = 0; a <= R::kEarColumns; ++a) {
      const int start = R::kEarRows / 2;  // of the lower edge in the loop
      int id;
      if (b == 0) {
        id = last[start + a];
      } else if (a == R::kEarColumns) {
        id = last[start + R::kEarColumns + b];
      } else if (b == R::kEarRows) {
        id = last[start + 2 * R::kEarColumns + R::kEarRows - a];
      } else if (a == 0) {
        id = last[(start - b + R::kEarLoop) % R::kEarLoop];
      } else {
        id = builder.Vertex(BodyPart::kHead);
      }
      line.push_back(id);
    }
    half.ear_floor.push_back(line);
  }
  for (int b = 0; b < R::kEarRows; ++b) {
    for (int a = 0; a < R::kEarColumns; ++a)
      builder.AddCell(half.ear_floor, b, a, false, floor, {a, b});
  }
}

// The thumb grows out of the cells on the palm's side of the radial edge.
bool InThumbPatch(int row, int column) {
  return row >= R::kThumbRow && row < R::kThumbRow + 2 &&
         (column == 0 || column == 1);
}

void AddArm(ComplexBuilder& builder, HalfComplex& half) {
  const int arm = builder.Chart("arm", false);
  const int palm = builder.Chart("palm", false);
  // Seam along the underside.
  const int seam = R::kArmColumns / 4;
  half.arm.push_back(ArmHole(half));
  for (int row = 1; row <= R::kPalmRow; ++row) {
    const BodyPart part =
        row > R::kWristRow ? BodyPart::kLHand : BodyPart::kLArm;
    std::vector<int> ring;
    for (int j = 0; j < R::kArmColumns; ++j) {
      const bool thumb_center = row == R::kThumbRow + 1 && j == 1;
      ring.push_back(thumb_center ? -1 : builder.Vertex(part));
    }
    half.arm.push_back(ring);
  }
  for (int row = 0; row < R::kPalmRow; ++row) {
    for (int j = 0; j < R::kArmColumns; ++j) {
      if (InThumbPatch(row, j)) continue;
      const int column = (j - seam + R::kArmColumns) % R::kArmColumns;
      builder.AddCell(half.arm,
                      row,
                      j,
                      false,
                      row < R::kWristRow ? arm : palm,
                      {column, row});
    }
  }
}

// A finger or toe of rings of eight around a given first ring, closed by
// 2 x 2 quads.
HalfComplex::Digit AddDigit(const std::string& name,
                            const std::vector<int>& base,
                            int rows,
                            BodyPart part,
                            ComplexBuilder& builder) {
  HalfComplex::Digit digit;
  const int count = static_cast<int>(base.size());
  const int tube = builder.Chart(name, false);
  const int cap = builder.Chart(name + "_tip", false);
  VertexGrid& grid = digit.ring;
  grid.push_back(base);
  for (int row = 1; row <= rows; ++row)
    grid.push_back(builder.Ring(count, part));
  for (int row = 0; row < rows; ++row) {
    for (int j = 0; j < count; ++j)
      builder.AddCell(grid, row, j, false, tube, {j, row});
  }
  digit.tip = builder.Vertex(part);
  const std::vector<int>& ring = grid.back();
  static constexpr ChartCorner kAround[8] = {
      {0, 0}, {1, 0}, {2, 0}, {2, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}};
  for (int j = 0; j < count; j += 2) {
    const int before = (j + count - 1) % count;
    const int after = (j + 1) % count;
    builder.AddQuad({ring[before], ring[j], ring[after], digit.tip},
                    cap,
                    {kAround[before], kAround[j], kAround[after], {1, 1}});
  }
  return digit;
}

void AddFingers(ComplexBuilder& builder, HalfComplex& half) {
  // Palmar columns 0..12 from the thumb's side, dorsal 25..13.
  const std::vector<int>& knuckles = half.arm.back();
  for (int finger = 0; finger < 4; ++finger) {
    std::vector<int> base;
    for (int i = 0; i <= 3; ++i) base.push_back(knuckles[3 * finger + i]);
    for (int i = 3; i >= 0; --i)
      base.push_back(knuckles[R::kArmColumns - 1 - 3 * finger - i]);
    half.finger[finger] = AddDigit("finger" + std::to_string(finger),
                                   base,
                                   R::kFingerRows,
                                   BodyPart::kLHand,
                                   builder);
  }
  // Around the thumb's opening, counter-clockwise seen from outside.
  const int row = R::kThumbRow;
  const VertexGrid& arm = half.arm;
  half.finger[4] = AddDigit("finger4",
                            {arm[row][0],
                             arm[row][1],
                             arm[row][2],
                             arm[row + 1][2],
                             arm[row + 2][2],
                             arm[row + 2][1],
                             arm[row + 2][0],
                             arm[row + 1][0]},
                            R::kFingerRows,
                            BodyPart::kLHand,
                            builder);
}

void AddLeg(ComplexBuilder& builder, HalfComplex& half) {
  const int leg = builder.Chart("leg", false);
  const int foot = builder.Chart("foot", false);
  half.strip.push_back(half.trunk[0][0]);
  for (int i = 1; i < R::kStripEdges; ++i)
    half.strip.push_back(builder.Vertex(BodyPart::kTrunk, true));
  half.strip.push_back(half.trunk[0][R::kHalfTrunk]);

  std::vector<int> first = half.trunk[0];
  for (int i = R::kStripEdges - 1; i > 0; --i) first.push_back(half.strip[i]);
  half.leg.push_back(first);
  for (int row = 1; row <= R::kToeRow; ++row) {
    half.leg.push_back(
        builder.Ring(R::kLegColumns,
                     row > R::kAnkleRow ? BodyPart::kLFoot : BodyPart::kLLeg));
  }
  // Seam along the inside of the leg.
  const int seam = R::kHalfTrunk + R::kStripEdges / 2;
  for (int row = 0; row < R::kToeRow; ++row) {
    for (int j = 0; j < R::kLegColumns; ++j) {
      const int column = (j - seam + R::kLegColumns) % R::kLegColumns;
      builder.AddCell(half.leg,
                      row,
                      j,
                      true,
                      row < R::kAnkleRow ? leg : foot,
                      {column, row});
    }
  }
}

void AddToes(ComplexBuilder& builder, HalfComplex& half) {
  const std::vector<int>& ring = half.leg.back();
  auto at = [&](int column) {
    return ring[(column + R::kLegColumns) % R::kLegColumns];
  };
  for (int toe = 0; toe < 5; ++toe) {
    // Rings run over the top from the inside to the outside and back below,
    // which is clockwise seen from the toe's tip: given backwards.
    const int top = R::kFirstToeColumn + 3 * toe;
    const int below = R::kFirstToeColumn + 2 * R::kToeColumns + 1 - 3 * toe;
    std::vector<int> base;
    for (int i = 3; i >= 0; --i) base.push_back(at(top + i));
    for (int i = 0; i <= 3; ++i) base.push_back(at(below - i));
    half.toe[toe] = AddDigit("toe" + std::to_string(toe),
                             base,
                             R::kToeRows,
                             BodyPart::kLFoot,
                             builder);
  }
}

BodyPart MirrorPart(BodyPart part) {
  switch (part) {
    case BodyPart::kLArm:
      return BodyPart::kRArm;
    case BodyPart::kLHand:
      return BodyPart::kRHand;
    case BodyPart::kLLeg:
      return BodyPart::kRLeg;
    case BodyPart::kLFoot:
      return BodyPart::kRFoot;
    default:
      return part;
  }
}

}  // namespace

HalfComplex BuildHalfComplex() {
  HalfComplex half;
  ComplexBuilder builder(&half);
  AddTrunk(builder, half);
  AddCrown(builder, half);
  AddEar(builder, half);
  AddArm(builder, half);
  AddFingers(builder, half);
  AddLeg(builder, half);
  AddToes(builder, half);
  return half;
}

BodyTopology MirrorComplex(const HalfComplex& half) {
  BodyTopology topology;
  topology.quads = half.quads;
  topology.part = half.part;
  topology.mirror_vertex.resize(half.num_vertices);
  for (int v = 0; v < half.num_vertices; ++v) {
    if (half.on_mid_plane[v]) {
      topology.mirror_vertex[v] = v;
      continue;
    }
    topology.mirror_vertex[v] = static_cast<int>(topology.part.size());
    topology.part.push_back(MirrorPart(half.part[v]));
    topology.mirror_vertex.push_back(v);
  }
  for (const Quad& quad : half.quads) {
    // Reversed, so that the mirror image is outward again.
    topology.quads.push_back({topology.mirror_vertex[quad[0]],
                              topology.mirror_vertex[quad[3]],
                              topology.mirror_vertex[quad[2]],
                              topology.mirror_vertex[quad[1]]});
  }
  return topology;
}

}  // namespace sweepfit
