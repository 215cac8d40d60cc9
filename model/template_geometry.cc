// SPDX-License-Identifier: Apache-2.0
#include "model/template_geometry.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <set>

namespace sweepfit {
namespace {

using Eigen::Vector3d;
using R = TemplateRings;
using DistanceFunction = std::function<double(const Vector3d&)>;

constexpr double kPi = std::numbers::pi;

double SmoothStep(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

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
        passes_(half.num_vertices, 0) {
    FindNeighbors();
  }

  std::vector<Vector3d> Run() {
    PlaceTrunk();
    PlaceCrown();
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
      const double crowd = 0.35 * SmoothStep((row - R::kNeckRow) / 12.0);
      for (int k = 0; k <= R::kHalfTrunk; ++k) {
        const int id = half_.trunk[row][k];
        if (id < 0) continue;
        const double even = 2 * kPi * k / R::kTrunkColumns;
        const double theta = even - crowd * std::sin(even);
        const double c = std::cos(theta);
        const double s = k == R::kHalfTrunk ? 0 : std::sin(theta);
        const Vector3d center = stature_ * Vector3d(0, y - dip * c * c, z);
        position_[id] = Exit(distance, center, {s, -tilt * c, c});
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
    for (int f = 0; f < 5; ++f) {
      const Tube& tube = solid_.finger(f);
      const Vector3d root = tube.point[0];
      const Vector3d tip = tube.point[1];
      const Vector3d along = (tip - root).normalized();
      const double end = (tip - root).norm() + tube.radius[1];
      const VertexGrid& grid = half_.finger[f];
      // The ring's own frame: column 0 keeps the direction it has in the base.
      const std::vector<int>& base = grid[0];
      Vector3d middle = Vector3d::Zero();
      for (int id : base) middle += position_[id] / base.size();
      const double start = (middle - root).dot(along);
      Vector3d x = position_[base[0]] + position_[base.back()] - 2 * middle;
      x = (x - x.dot(along) * along).normalized();
      const Vector3d y = along.cross(x);
      const DistanceFunction distance = [&](const Vector3d& p) {
        return tube.Distance(p);
      };
      const int count = static_cast<int>(base.size());
      // The first rings turn from the base's own shape into sections.
      constexpr int kFreeRow = 4;
      double first = start;
      for (int id : base)
        first = std::max(first, (position_[id] - root).dot(along));
      const double last_ring = end - 0.35 * tube.radius[1];
      for (int row = 1; row <= R::kFingerRows; ++row) {
        const double t = static_cast<double>(row) / R::kFingerRows;
        // Closer towards the tip.
        const double s = first + (last_ring - first) * (t + 0.25 * t * (1 - t));
        const double free = SmoothStep(static_cast<double>(row) / kFreeRow);
        for (int j = 0; j < count; ++j) {
          const double theta = 2 * kPi * (j + 0.5) / count;
          const Vector3d on_tube =
              Exit(distance,
                   root + s * along,
                   std::cos(theta) * x + std::sin(theta) * y);
          const double advance = (first - start) * t + (s - first);
          const Vector3d from_base = position_[base[j]] + advance * along;
          position_[grid[row][j]] = (1 - free) * from_base + free * on_tube;
        }
      }
      position_[half_.finger_tip[f]] = root + end * along;
    }
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
    const double side_height = position_[half_.trunk[0][R::kHalfTrunk / 2]].y();
    const double crotch = position_[half_.strip[R::kStripEdges / 2]].y();
    for (int row = 1; row <= R::kAnkleRow; ++row) {
      const Vector3d center = solid_.LegCenter(Bones(tables.leg_rings, row));
      // Outside the ring hangs from the side of the hip, inside from the strip.
      const double level = SmoothStep(static_cast<double>(row) / kLevelRow);
      const double below_strip = crotch - 0.003 * stature_ * row;
      const double inner = center.x() - mid_plane;
      const double outer_slope =
          (1 - level) * (side_height - center.y()) / (2 * inner);
      const double inner_slope =
          (1 - level) * std::max(0.0, center.y() - below_strip) / inner;
      for (int j = 0; j < R::kLegColumns; ++j) {
        const double theta = LegAngle(j);
        const double lateral = -std::sin(theta);
        const double slope = lateral > 0 ? outer_slope : inner_slope;
        position_[half_.leg[row][j]] =
            Exit(distance, center, {lateral, slope * lateral, std::cos(theta)});
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
    const double toe =
        (solid_.tables().foot.sections.back().s - 0.006) * stature_;
    for (int row = first + 1; row <= R::kToeRow; ++row) {
      const double t =
          std::min(1.0, static_cast<double>(row - first) / kTurnRows);
      const double turn = t * kPi / 2;
      Vector3d center = HeelPath(leg_center, foot_center, t);
      if (row > first + kTurnRows) {
        const double f = static_cast<double>(row - first - kTurnRows) /
                         (R::kToeRow - first - kTurnRows);
        center = solid_.FootCenter(upright_at + f * (toe - upright_at));
      }
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
    PlaceToeCap(distance);
  }

  static Vector3d HeelPath(const Vector3d& from, const Vector3d& to, double t) {
    // A quadratic curve whose corner lies under the leg and behind the foot.
    const Vector3d corner(from.x(), 0.6 * to.y() + 0.4 * from.y(), from.z());
    return (1 - t) * (1 - t) * from + 2 * t * (1 - t) * corner + t * t * to;
  }

  void PlaceToeCap(const DistanceFunction& distance) {
    const int side = R::kToeCapSide;
    const VertexGrid& cap = half_.toe_cap;
    auto at = [&](int a, int b) -> Vector3d { return position_[cap[b][a]]; };
    const double toe = solid_.tables().foot.sections.back().s * stature_;
    const Vector3d center = solid_.FootCenter(toe - 0.03 * stature_);
    for (int b = 1; b < side; ++b) {
      for (int a = 1; a < side; ++a) {
        const double s = static_cast<double>(a) / side;
        const double t = static_cast<double>(b) / side;
        // Coons patch over the last ring, pushed out to the surface.
        const Vector3d coons =
            (1 - s) * at(0, b) + s * at(side, b) + (1 - t) * at(a, 0) +
            t * at(a, side) - (1 - s) * (1 - t) * at(0, 0) -
            s * (1 - t) * at(side, 0) - (1 - s) * t * at(0, side) -
            s * t * at(side, side);
        position_[cap[b][a]] = Exit(distance, center, coons - center);
      }
    }
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
    for (int row = 0; row < 8; ++row) {
      for (int id : half_.leg[row]) Mark(id, kPasses * (8 - row) / 8);
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
    for (const VertexGrid& finger : half_.finger) {
      for (int row = 0; row < 4; ++row) {
        for (int id : finger[row]) Mark(id, 16 - 4 * row);
      }
    }
    for (int row = R::kAnkleRow - 3; row <= R::kToeRow; ++row) {
      for (int id : half_.leg[row]) Mark(id, 15);
    }
    for (const auto& line : half_.toe_cap) {
      for (int id : line) Mark(id, 15);
    }
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
      for (int v = 0; v < half_.num_vertices; ++v) {
        if (pass >= passes_[v]) continue;
        next[v] = Relaxed(v);
      }
      position_ = next;
    }
    // To the surface for good.
    for (int pass = 0; pass < 3; ++pass) {
      for (int v = 0; v < half_.num_vertices; ++v) {
        if (passes_[v] > 0) position_[v] = Projected(position_[v], v);
      }
    }
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
    const Vector3d normal = Gradient(here).normalized();
    Vector3d move = 0.5 * (mean / count - here);
    move -= move.dot(normal) * normal;
    return Projected(here + move, v);
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
  std::vector<int> passes_;
  std::vector<std::vector<int>> neighbors_;
};

}  // namespace

std::vector<Eigen::Vector3d> PlaceHalf(const HalfComplex& half,
                                       const TemplateSolid& solid) {
  return HalfPlacer(half, solid).Run();
}

}  // namespace sweepfit
