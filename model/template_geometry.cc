// SPDX-License-Identifier: Apache-2.0
#include "model/template_geometry.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <set>
#include <utility>

#include "model/smooth_step.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;
using R = TemplateRings;
using DistanceFunction = std::function<double(const Vector3d&)>;

constexpr double kPi = std::numbers::pi;
constexpr double kLeanBehind = 0.4;

// Cubic through keys (Catmull-Rom with the keys' own spacing).
double Interpolate(const std::vector<double>& x,
                   const std::vector<double>& y,
                   double at) {
  const int n = static_cast<int>(x.size());
  const int i = std::clamp(
      static_cast<int>(std::upper_bound(x.begin(), x.end(), at) - x.begin()) -
          1,
      0,
      n - 2);
  auto slope = [&](int k) {
    const int a = std::max(k - 1, 0);
    const int b = std::min(k + 1, n - 1);
    return (y[b] - y[a]) / (x[b] - x[a]);
  };
  const double h = x[i + 1] - x[i];
  const double t = (at - x[i]) / h;
  const double t2 = t * t;
  const double t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * y[i] + (t3 - 2 * t2 + t) * h * slope(i) +
         (3 * t2 - 2 * t3) * y[i + 1] + (t3 - t2) * h * slope(i + 1);
}

double Bones(const std::vector<LimbRingKey>& keys, double row) {
  std::vector<double> x, y;
  for (const LimbRingKey& key : keys) {
    x.push_back(key.row);
    y.push_back(key.bones);
  }
  return Interpolate(x, y, row);
}

// Places vertices of one half step by step.
class HalfPlacer {
 public:
  HalfPlacer(const HalfComplex& half, const TemplateSolid& solid)
      : half_(half),
        solid_(solid),
        stature_(solid.stature()),
        position_(half.num_vertices, Vector3d::Zero()),
        foot_origin_(
            solid.joints()[kLAnkle].x(), 0, solid.joints()[kLAnkle].z()),
        passes_(half.num_vertices, 0) {
    FindNeighbors();
  }

  std::vector<Vector3d> Run() {
    PlaceTrunk();
    PlaceCrown();
    PlaceEar();
    PlaceArm();
    PlaceFingers();
    PlaceLeg();
    PlaceFoot();
    MarkJunctions();
    Relax();
    return position_;
  }

 private:
  void FindNeighbors() {
    std::vector<std::set<int>> neighbors(half_.num_vertices);
    for (const Quad& quad : half_.quads) {
      for (int i = 0; i < 4; ++i) {
        neighbors[quad[i]].insert(quad[(i + 1) % 4]);
        neighbors[quad[(i + 1) % 4]].insert(quad[i]);
      }
    }
    for (const std::set<int>& near : neighbors)
      neighbors_.emplace_back(near.begin(), near.end());
  }

  Vector3d Exit(const DistanceFunction& distance,
                const Vector3d& center,
                const Vector3d& direction) const {
    const Vector3d unit = direction.normalized();
    return center +
           ExitDistance(distance, center, unit, 5e-4 * stature_) * unit;
  }

  void PlaceTrunk() {
    const TemplateTables& tables = solid_.tables();
    std::vector<double> row_key, height, anterior, lean;
    for (const TrunkRingKey& key : tables.trunk_rings) {
      row_key.push_back(key.row);
      height.push_back(key.height);
      anterior.push_back(key.anterior);
      lean.push_back(key.lean_degrees * kPi / 180);
    }
    const DistanceFunction distance = [&](const Vector3d& p) {
      return SmoothMin(
          solid_.Trunk(p), solid_.LegAndFoot(p), tables.blend.leg * stature_);
    };
    for (int row = 0; row < R::kTrunkRows; ++row) {
      const double y = Interpolate(row_key, height, row);
      const double z = Interpolate(row_key, anterior, row);
      const double tilt = std::tan(Interpolate(row_key, lean, row));
      const double dip =
          tables.groin_drop * (1 - SmoothStep(row / tables.groin_rows));
      // Columns crowd towards the face.
      const double crowd = 0.6 * SmoothStep((row - R::kNeckRow) / 14.0);
      for (int k = 0; k <= R::kHalfTrunk; ++k) {
        const int id = half_.trunk[row][k];
        if (id < 0) continue;
        const double even = 2 * kPi * k / R::kTrunkColumns;
        const double theta = even - crowd * std::sin(even);
        const double c = std::cos(theta);
        const double s = k == R::kHalfTrunk ? 0 : std::sin(theta);
        const Vector3d center = stature_ * Vector3d(0, y - dip * c * c, z);
        // Rings lean in front, under the chin, more than behind.
        const double lean_here = c > 0 ? tilt : kLeanBehind * tilt;
        position_[id] = Exit(distance, center, {s, -lean_here * c, c});
      }
    }
  }

  // Rays from the middle of the head through a disc mapped from the square.
  void PlaceCrown() {
    const std::vector<int>& ring = half_.trunk.back();
    const Vector3d front = position_[ring.front()];
    const Vector3d back = position_[ring.back()];
    const Vector3d top = (front + back) / 2;
    const Vector3d center = top - Vector3d(0, 0.05 * stature_, 0);
    const DistanceFunction distance = [&](const Vector3d& p) {
      return solid_.Trunk(p);
    };
    const int mid = R::kCapSide / 2;
    for (int j = 1; j < R::kCapSide; ++j) {
      for (int i = 0; i < mid; ++i) {
        // Blend of the boundary points of the cell's row and column.
        const double a = static_cast<double>(i) / mid;
        const double b = 2.0 * j / R::kCapSide - 1;
        const Vector3d x_side = position_[half_.crown[j][mid]];
        const Vector3d z_front = position_[half_.crown[0][i]];
        const Vector3d z_back = position_[half_.crown[R::kCapSide][i]];
        const double t = (b + 1) / 2;
        const Vector3d from_rows = (1 - t) * z_front + t * z_back;
        const double weight_x = std::abs(a);
        const double weight_z = std::abs(b);
        Vector3d on_disc;
        on_disc.x() = a * ((1 - weight_z) * x_side.x() +
                           weight_z * from_rows.x() / std::max(a, 1e-9));
        on_disc.z() = (1 - weight_x) * from_rows.z() + weight_x * x_side.z();
        on_disc.y() = top.y();
        if (i == 0) on_disc.x() = 0;
        // Rays rise towards the middle.
        const double inside = 1 - std::max(std::abs(a), std::abs(b));
        on_disc.y() += inside * 0.05 * stature_;
        position_[half_.crown[j][i]] = Exit(distance, center, on_disc - center);
      }
    }
  }

  // The opening lies a little inside the flank, however wide that is.
  Vector3d ArmHoleCenter() const {
    const TemplateTables& tables = solid_.tables();
    const DistanceFunction trunk = [&](const Vector3d& p) {
      return solid_.Trunk(p);
    };
    const Vector3d arm_pit = solid_.TrunkCenter(tables.arm_pit * stature_);
    const double flank = Exit(trunk, arm_pit, Vector3d::UnitX()).x();
    Vector3d hole = stature_ * tables.arm_hole;
    hole.x() = std::min(flank - hole.x(), solid_.joints()[kLShoulder].x());
    return hole;
  }

  // Angle around the ear, front (pi), lobe, back, top. The few columns of the
  // opening's lower and upper edge take a good part of the turn, as they do of
  // the opening.
  static double EarAngle(int j) {
    constexpr double kHalfEdge = 36 * kPi / 180;
    constexpr double kSide = kPi - 2 * kHalfEdge;
    const int half = R::kEarLoop / 2;
    const double turn = kPi * (1 + j / half);
    const int i = j % half;  // from the middle of a side to that of the other
    const int to_corner = R::kEarRows / 2;
    double angle = kSide * i / R::kEarRows;
    if (i > to_corner) {
      const int edge = std::min(i - to_corner, R::kEarColumns);
      angle = kSide / 2 + 2 * kHalfEdge * edge / R::kEarColumns +
              kSide * (i - to_corner - edge) / R::kEarRows;
    }
    return turn + angle;
  }

  // The auricle is a bowl that stands on the side of the head; it is not part
  // of the solid. Its plane leans back at the top and stands off at the back.
  void PlaceEar() {
    const EarTable& table = solid_.tables().ear;
    const DistanceFunction distance = [&](const Vector3d& p) {
      return solid_.Trunk(p);
    };
    const Vector3d center = stature_ * table.center;
    const double length = stature_ * table.half_length;
    const double breadth = stature_ * table.half_breadth;
    const double thick = stature_ * table.thick;
    const double c = std::cos(table.lean);
    const double s = std::sin(table.lean);
    const Vector3d up(0, c, -s);
    const Vector3d back(0, -s, -c);
    const Vector3d out = Vector3d::UnitX();
    const Vector3d off =
        std::cos(table.flare) * back + std::sin(table.flare) * out;
    const Vector3d outward = off.cross(up).normalized();
    auto on_head = [&](const Vector3d& p) {
      return Exit(distance, {0, p.y(), p.z()}, out);
    };
    // The front edge is where the plane leaves the head.
    const Vector3d edge = on_head(center - breadth * back) + 0.3 * thick * out;
    for (int j = 0; j < R::kEarLoop; ++j) {
      const double phi = EarAngle(j);
      const double y = std::sin(phi);
      // Broader above than at the lobe.
      const double x = (1 + std::cos(phi)) * (1 + 0.22 * y);
      auto on_plane = [&](double shrink, double raise) -> Vector3d {
        const double along = 0.9 + shrink * (x - 0.9);
        return edge + along * breadth * off + shrink * y * length * up +
               raise * thick * outward;
      };
      const Vector3d base = on_head(center + (0.68 * x - 1.2) * breadth * back +
                                    (0.74 * y + 0.04) * length * up);
      const Vector3d rim = on_plane(1, 0);
      position_[half_.ear[0][j]] = base;
      position_[half_.ear[1][j]] = 0.45 * base + 0.55 * rim;
      position_[half_.ear[2][j]] = rim;
      position_[half_.ear[3][j]] = on_plane(0.93, 1);
      position_[half_.ear[4][j]] = on_plane(0.74, 0.35);
    }
    // The floor sinks towards the ear's canal.
    const VertexGrid& floor = half_.ear_floor;
    for (int b = 1; b < R::kEarRows; ++b) {
      for (int a = 1; a < R::kEarColumns; ++a) {
        const double t = static_cast<double>(a) / R::kEarColumns;
        const double v = static_cast<double>(b) / R::kEarRows;
        const Vector3d across = (1 - t) * position_[floor[b][0]] +
                                t * position_[floor[b][R::kEarColumns]];
        const double depth = std::sin(kPi * v) * (a == 1 ? 1.0 : 0.45);
        position_[floor[b][a]] = across - depth * thick * outward;
      }
    }
  }

  void PlaceArm() {
    const TemplateTables& tables = solid_.tables();
    const Vector3d hole = ArmHoleCenter();
    const double lean = tables.arm_hole_lean;
    const Vector3d hole_normal(std::cos(lean), std::sin(lean), 0);
    const DistanceFunction trunk_and_arm = [&](const Vector3d& p) {
      return SmoothMin(
          solid_.Trunk(p), solid_.Arm(p), tables.blend.arm * stature_);
    };
    const DistanceFunction arm = [&](const Vector3d& p) {
      return solid_.Arm(p);
    };
    constexpr int kFreeRow = 12;  // the first ring square to the arm
    const double free_bones = Bones(tables.arm_rings, kFreeRow);
    for (int row = 0; row <= R::kPalmRow; ++row) {
      const double bones = Bones(tables.arm_rings, row);
      const double turn = SmoothStep(static_cast<double>(row) / kFreeRow);
      const Vector3d normal =
          ((1 - turn) * hole_normal + turn * solid_.arm_along()).normalized();
      Vector3d center = solid_.ArmCenter(bones);
      if (row < kFreeRow) {
        const double t = static_cast<double>(row) / kFreeRow;
        center = (1 - t) * hole + t * solid_.ArmCenter(free_bones);
      }
      const Vector3d front = solid_.arm_thumb();
      const Vector3d under = normal.cross(front);
      // Towards the hand columns are spaced by length, not by angle.
      const double by_length = SmoothStep((row - 34.0) / 10.0);
      const std::vector<double> theta =
          RingAngles(row < kFreeRow ? trunk_and_arm : arm,
                     center,
                     front,
                     under,
                     by_length);
      for (int j = 0; j < R::kArmColumns; ++j) {
        const int id = half_.arm[row][j];
        if (id < 0) continue;
        const Vector3d ray =
            std::cos(theta[j]) * front + std::sin(theta[j]) * under;
        position_[id] = Exit(row < kFreeRow ? trunk_and_arm : arm, center, ray);
        if (row == 0 || row >= kFreeRow) continue;
        // Rays that would run on through the trunk stop near the arm.
        const Vector3d on_arm = Exit(arm, center, ray);
        const double limit =
            (on_arm - center).norm() + tables.blend.arm * stature_;
        const Vector3d reach = position_[id] - center;
        if (reach.norm() > limit)
          position_[id] = center + limit * reach.normalized();
      }
    }
  }

  // Angles of the columns, half a column off the front, by equal angle
  // (by_length 0) to equal length along the section (1).
  std::vector<double> RingAngles(const DistanceFunction& distance,
                                 const Vector3d& center,
                                 const Vector3d& x,
                                 const Vector3d& y,
                                 double by_length) const {
    const int n = R::kArmColumns;
    std::vector<double> angle(n);
    for (int j = 0; j < n; ++j) angle[j] = 2 * kPi * (j + 0.5) / n;
    if (by_length <= 0) return angle;
    constexpr int kSamples = 360;
    std::vector<double> length(kSamples + 1, 0.0);
    Vector3d last = Vector3d::Zero();
    for (int i = 0; i <= kSamples; ++i) {
      const double theta = 2 * kPi * i / kSamples;
      const Vector3d point =
          Exit(distance, center, std::cos(theta) * x + std::sin(theta) * y);
      if (i > 0) length[i] = length[i - 1] + (point - last).norm();
      last = point;
    }
    for (int j = 0; j < n; ++j) {
      const double target = length.back() * (j + 0.5) / n;
      const int i = static_cast<int>(
          std::upper_bound(length.begin(), length.end(), target) -
          length.begin());
      const double t = (target - length[i - 1]) / (length[i] - length[i - 1]);
      const double theta = 2 * kPi * (i - 1 + t) / kSamples;
      angle[j] += by_length * (theta - angle[j]);
    }
    return angle;
  }

  void PlaceFingers() {
    constexpr int kFreeRow = 4;
    for (int f = 0; f < 5; ++f)
      PlaceDigit(solid_.finger(f), half_.finger[f], kFreeRow);
  }

  // Rings along the axis of the tube; up to free_row they turn from the base's
  // own shape into sections.
  void PlaceDigit(const Tube& tube,
                  const HalfComplex::Digit& digit,
                  int free_row) {
    const Vector3d root = tube.point[0];
    const Vector3d along = (tube.point[1] - root).normalized();
    const double tip_radius = tube.radius.back();
    const double end = tube.Length() + tip_radius;
    const std::vector<int>& base = digit.ring[0];
    Vector3d middle = Vector3d::Zero();
    for (int id : base) middle += position_[id] / base.size();
    const double start = (middle - root).dot(along);
    // Column 0 keeps the direction that it has in the base.
    const Vector3d reference =
        position_[base[0]] + position_[base.back()] - 2 * middle;
    const DistanceFunction distance = [&](const Vector3d& p) {
      return tube.Distance(p);
    };
    const int count = static_cast<int>(base.size());
    const int rows = static_cast<int>(digit.ring.size()) - 1;
    double first = start;
    for (int id : base)
      first = std::max(first, (position_[id] - root).dot(along));
    // The last two rings round the tip.
    const double last_free = end - 0.62 * tip_radius;
    const double last_ring = end - 0.16 * tip_radius;
    for (int row = 1; row <= rows; ++row) {
      const double t = std::min(1.0, static_cast<double>(row) / (rows - 1));
      // Closer towards the tip.
      const double s =
          row == rows ? last_ring
                      : first + (last_free - first) * (t + 0.25 * t * (1 - t));
      const double free = SmoothStep(static_cast<double>(row) / free_row);
      const Vector3d direction = tube.Direction(s, tip_radius);
      const Vector3d x =
          (reference - reference.dot(direction) * direction).normalized();
      const Vector3d y = direction.cross(x);
      for (int j = 0; j < count; ++j) {
        const double theta = 2 * kPi * (j + 0.5) / count;
        const Vector3d on_tube = Exit(
            distance, tube.At(s), std::cos(theta) * x + std::sin(theta) * y);
        const double advance = (first - start) * t + (s - first);
        const Vector3d from_base = position_[base[j]] + advance * along;
        position_[digit.ring[row][j]] = (1 - free) * from_base + free * on_tube;
      }
    }
    position_[digit.tip] =
        tube.At(end - tip_radius) +
        tip_radius * tube.Direction(end - tip_radius, 0.1 * tip_radius);
  }

  // Angle of a leg column in the ring's plane, from the front over the inside.
  static double LegAngle(int j) {
    return kPi / 4 - 2 * kPi * j / R::kLegColumns;
  }

  void PlaceLeg() {
    const TemplateTables& tables = solid_.tables();
    // Rays stop short of the mid plane, where the other leg begins.
    const double mid_plane = 0.005 * stature_;
    const DistanceFunction distance = [&](const Vector3d& p) {
      return std::max(SmoothMin(solid_.Trunk(p),
                                solid_.LegAndFoot(p),
                                tables.blend.leg * stature_),
                      mid_plane - p.x());
    };
    PlaceStrip();
    constexpr int kLevelRow = 14;  // the first ring in a horizontal plane
    const double first_height =
        solid_.LegCenter(Bones(tables.leg_rings, 0)).y();
    for (int row = 1; row <= R::kAnkleRow; ++row) {
      const Vector3d center = solid_.LegCenter(Bones(tables.leg_rings, row));
      // The ring hangs from the first one, along groin and crotch.
      const double level = SmoothStep(static_cast<double>(row) / kLevelRow);
      for (int j = 0; j < R::kLegColumns; ++j) {
        const double theta = LegAngle(j);
        const Vector3d outward(-std::sin(theta), 0, std::cos(theta));
        Vector3d ray = outward;
        if (level < 1) {
          const double hanging = position_[half_.leg[0][j]].y() - first_height;
          const Vector3d flat = Exit(distance, center, outward) - center;
          ray = flat + (1 - level) * hanging * Vector3d::UnitY();
        }
        position_[half_.leg[row][j]] = Exit(distance, center, ray);
      }
    }
  }

  // Straight down onto the surface between the legs.
  void PlaceStrip() {
    const Vector3d front = position_[half_.strip.front()];
    const Vector3d back = position_[half_.strip.back()];
    const DistanceFunction body = [&](const Vector3d& p) {
      return solid_.Body(p);
    };
    for (int i = 1; i < R::kStripEdges; ++i) {
      const double t = static_cast<double>(i) / R::kStripEdges;
      Vector3d from = (1 - t) * front + t * back;
      from.y() = std::max(front.y(), back.y()) + 0.01 * stature_;
      position_[half_.strip[i]] = Exit(body, from, -Vector3d::UnitY());
      position_[half_.strip[i]].x() = 0;
    }
  }

  // Rings turn about a hinge in front of the ankle from level to upright,
  // around the heel, and then move forward to the toes.
  void PlaceFoot() {
    const TemplateTables& tables = solid_.tables();
    const DistanceFunction distance = [&](const Vector3d& p) {
      return solid_.LegAndFoot(p);
    };
    const Vector3d forward = solid_.foot_forward();
    const Vector3d lateral = solid_.foot_lateral();
    const Vector3d up = Vector3d::UnitY();
    constexpr int kTurnRows = 14;
    const int first = R::kAnkleRow;
    const Vector3d leg_center =
        solid_.LegCenter(Bones(tables.leg_rings, first));
    const double upright_at = 0.040 * stature_;  // in front of the ankle
    const Vector3d foot_center = solid_.FootCenter(upright_at);
    for (int row = first + 1; row <= first + kTurnRows; ++row) {
      const double t = static_cast<double>(row - first) / kTurnRows;
      const double turn = t * kPi / 2;
      const Vector3d center = HeelPath(leg_center, foot_center, t);
      // Columns: 0 deg in front of the leg, which becomes the top of the foot.
      const Vector3d front = std::cos(turn) * forward + std::sin(turn) * up;
      for (int j = 0; j < R::kLegColumns; ++j) {
        const double theta = LegAngle(j);
        position_[half_.leg[row][j]] =
            Exit(distance,
                 center,
                 std::cos(theta) * front - std::sin(theta) * lateral);
      }
    }
    // On to the webs between the toes, which lie farther back outside.
    const ToeWebs webs = FindToeWebs();
    for (int row = first + kTurnRows + 1; row <= R::kToeRow; ++row) {
      const double f = static_cast<double>(row - first - kTurnRows) /
                       (R::kToeRow - first - kTurnRows);
      for (int i = 0; i < R::kLegColumns; ++i) {
        const int j =
            (R::kFirstToeColumn + i + R::kLegColumns) % R::kLegColumns;
        const bool on_top = i <= R::kToeColumns;
        const double boundary = (on_top ? i : 2 * R::kToeColumns + 1 - i) / 3.0;
        const double at_web = AtBoundary(webs.forward, boundary);
        const Vector3d center =
            solid_.FootCenter(upright_at + f * (at_web - upright_at));
        const double even = LegAngle(R::kFirstToeColumn + i);
        const double across = AtBoundary(webs.lateral, boundary) -
                              (center - foot_origin_).dot(lateral);
        // Rays come to start most of the way to the column's place and to
        // run upwards or downwards.
        constexpr double kShift = 0.75;
        const double blend = SmoothStep(f);
        const double rise = 0.010 * stature_;
        double target =
            std::atan2(-(1 - kShift) * across, on_top ? rise : -rise);
        target += 2 * kPi * std::round((even - target) / (2 * kPi));
        const double theta = even + blend * (target - even);
        position_[half_.leg[row][j]] =
            Exit(distance,
                 center + blend * kShift * across * lateral,
                 std::cos(theta) * up - std::sin(theta) * lateral);
      }
    }
    constexpr int kFreeRow = 3;
    for (int i = 0; i < 5; ++i)
      PlaceDigit(solid_.toe(i), half_.toe[i], kFreeRow);
  }

  // Boundaries between toes, from the inside of the great toe to the outside
  // of the little one, in the foot's coordinates (metres).
  struct ToeWebs {
    std::array<double, 6> lateral, forward;
  };

  ToeWebs FindToeWebs() const {
    ToeWebs webs;
    std::array<double, 5> inner, outer, front;
    for (int i = 0; i < 5; ++i) {
      const Tube& toe = solid_.toe(i);
      const Vector3d knuckle = toe.point[1] - foot_origin_;
      const double across = knuckle.dot(solid_.foot_lateral());
      inner[i] = across - toe.radius[1];
      outer[i] = across + toe.radius[1];
      front[i] = (0.05 * (toe.point[0] - foot_origin_) + 0.95 * knuckle)
                     .dot(solid_.foot_forward());
    }
    webs.lateral[0] = inner[0];
    webs.forward[0] = front[0];
    for (int i = 1; i < 5; ++i) {
      webs.lateral[i] = (outer[i - 1] + inner[i]) / 2;
      webs.forward[i] = (front[i - 1] + front[i]) / 2;
    }
    webs.lateral[5] = outer[4];
    webs.forward[5] = front[4];
    return webs;
  }

  static double AtBoundary(const std::array<double, 6>& values, double at) {
    const int i = std::clamp(static_cast<int>(at), 0, 4);
    return values[i] + (at - i) * (values[i + 1] - values[i]);
  }

  static Vector3d HeelPath(const Vector3d& from, const Vector3d& to, double t) {
    // A quadratic curve whose corner lies under the leg and behind the foot.
    const Vector3d corner(from.x(), 0.6 * to.y() + 0.4 * from.y(), from.z());
    return (1 - t) * (1 - t) * from + 2 * t * (1 - t) * corner + t * t * to;
  }

  // How many relaxation passes a vertex takes part in.
  void Mark(int id, int passes) {
    if (id >= 0) passes_[id] = std::max(passes_[id], passes);
  }

  void MarkJunctions() {
    for (int row = 0; row < 6; ++row) {
      for (int id : half_.trunk[row]) Mark(id, kPasses * (6 - row) / 6);
    }
    for (int id : half_.strip) Mark(id, kPasses);
    for (int row = 0; row < 14; ++row) {
      for (int id : half_.leg[row]) Mark(id, kPasses * (14 - row) / 14);
    }
    const int bottom = R::kArmPatchRow;
    const int top = bottom + R::kArmPatchRows;
    for (int row = bottom - 5; row <= top + 5; ++row) {
      for (int k = 3; k <= 21; ++k) {
        const int away = std::max({bottom - row, row - top, 9 - k, k - 15, 0});
        Mark(half_.trunk[row][k], kPasses * (7 - away) / 7);
      }
    }
    for (int row = 0; row < 12; ++row) {
      for (int id : half_.arm[row]) Mark(id, kPasses * (12 - row) / 12);
    }
    for (int row = R::kNeckRow - 2; row < R::kTrunkRows; ++row) {
      for (int id : half_.trunk[row]) Mark(id, 4);
    }
    for (const auto& line : half_.crown) {
      for (int id : line) Mark(id, 12);
    }
    for (int row = R::kWristRow; row <= R::kPalmRow; ++row) {
      for (int id : half_.arm[row]) Mark(id, row < R::kPalmRow - 2 ? 6 : 16);
    }
    for (const HalfComplex::Digit& finger : half_.finger) {
      for (int row = 0; row < 5; ++row) {
        for (int id : finger.ring[row]) Mark(id, 20 - 4 * row);
      }
    }
    // The webs between the toes stay in their places.
    for (int row = R::kAnkleRow - 3; row < R::kToeRow; ++row) {
      for (int id : half_.leg[row])
        Mark(id, std::min(15, R::kToeRow - row - 1));
    }
    // Around the ear, whose base stays.
    constexpr int kAround = 12;
    for (int row = R::kEarRow - kAround;
         row <= R::kEarRow + R::kEarRows + kAround;
         ++row) {
      for (int k = R::kEarColumn - 5; k <= R::kHalfTrunk; ++k) {
        const int away = std::max({R::kEarRow - row,
                                   row - R::kEarRow - R::kEarRows,
                                   2 * (R::kEarColumn - k),
                                   0});
        Mark(half_.trunk[row][k], kPasses * (kAround - away) / kAround);
      }
    }
    for (int id : half_.ear[0]) passes_[id] = 0;
  }

  Vector3d Gradient(const Vector3d& point) const {
    const double h = 2e-4 * stature_;
    Vector3d gradient;
    for (int i = 0; i < 3; ++i) {
      Vector3d step = Vector3d::Zero();
      step[i] = h;
      gradient[i] =
          (solid_.Body(point + step) - solid_.Body(point - step)) / (2 * h);
    }
    return gradient;
  }

  // Tangential Laplacian smoothing, then one Newton step to the surface.
  void Relax() {
    for (int pass = 0; pass < kPasses; ++pass) {
      std::vector<Vector3d> next = position_;
      ForEachInPass(pass, [&](int v) { next[v] = Relaxed(v); });
      position_ = std::move(next);
    }
    // To the surface for good.
    ForEachInPass(0, [&](int v) {
      for (int pass = 0; pass < 3; ++pass) {
        position_[v] = Projected(position_[v], v);
      }
    });
  }

  // Vertices that still take part, in parallel.
  template <typename Visit>
  void ForEachInPass(int pass, const Visit& visit) const {
    std::vector<int> vertices;
    for (int v = 0; v < half_.num_vertices; ++v) {
      if (passes_[v] > pass) vertices.push_back(v);
    }
    tbb::parallel_for(tbb::blocked_range<size_t>(0, vertices.size(), 32),
                      [&](const tbb::blocked_range<size_t>& range) {
                        for (size_t i = range.begin(); i < range.end(); ++i) {
                          visit(vertices[i]);
                        }
                      });
  }

  Vector3d Relaxed(int v) const {
    const Vector3d& here = position_[v];
    Vector3d mean = Vector3d::Zero();
    double count = 0;
    for (int n : neighbors_[v]) {
      mean += position_[n];
      ++count;
      if (half_.on_mid_plane[v] && !half_.on_mid_plane[n]) {
        mean += position_[n].cwiseProduct(Vector3d(-1, 1, 1));
        ++count;
      }
    }
    // One-sided differences will do on the way.
    const double h = 2e-4 * stature_;
    const double value = solid_.Body(here);
    Vector3d gradient;
    for (int i = 0; i < 3; ++i) {
      gradient[i] = (solid_.Body(here + h * Vector3d::Unit(i)) - value) / h;
    }
    Vector3d move = 0.5 * (mean / count - here);
    const double squared = std::max(0.25, gradient.squaredNorm());
    move -= move.dot(gradient) / squared * gradient;
    const double limit = 0.01 * stature_;
    const double off = std::clamp(solid_.Body(here + move), -limit, limit);
    Vector3d moved = here + move - off / squared * gradient;
    if (half_.on_mid_plane[v]) moved.x() = 0;
    return moved;
  }

  Vector3d Projected(const Vector3d& point, int v) const {
    const Vector3d gradient = Gradient(point);
    const double limit = 0.01 * stature_;
    const double value = std::clamp(solid_.Body(point), -limit, limit);
    Vector3d moved =
        point - value * gradient / std::max(0.25, gradient.squaredNorm());
    if (half_.on_mid_plane[v]) moved.x() = 0;
    return moved;
  }

  static constexpr int kPasses = 40;

  const HalfComplex& half_;
  const TemplateSolid& solid_;
  const double stature_;
  std::vector<Vector3d> position_;
  const Vector3d foot_origin_;  // on the floor below the ankle
  std::vector<int> passes_;
  std::vector<std::vector<int>> neighbors_;
};

}  // namespace

std::vector<Eigen::Vector3d> PlaceHalf(const HalfComplex& half,
                                       const TemplateSolid& solid) {
  return HalfPlacer(half, solid).Run();
}

}  // namespace sweepfit
