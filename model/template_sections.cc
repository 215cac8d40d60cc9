// SPDX-License-Identifier: Apache-2.0
#include "model/template_sections.h"

#include <glog/logging.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "model/body.h"
#include "model/cross_section.h"

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Where a sweep's sections come from.
struct SectionSource {
  // Distance to the part, with the floor at y = 0.
  std::function<double(const Vector3d&)> distance;
  // A point inside the part near parameter u.
  std::function<Vector3d(double u)> inside;
};

struct Row {
  double u;
  double feature_weight;
};

// The corners of the axis depend on the mean radii at the joints, the sections
// on the axis: a few rounds agree to a fraction of a millimetre.
constexpr int kRounds = 3;

Sweep MakeSweep(const std::string& name,
                const std::vector<int>& chain,
                const Vector3d& reference,
                int columns,
                const std::vector<Row>& rows) {
  Sweep sweep;
  sweep.name = name;
  sweep.chain = chain;
  sweep.rest_reference = reference;
  const int count = static_cast<int>(rows.size());
  sweep.center_offset = Eigen::Matrix2Xd::Zero(2, count);
  sweep.radius = Eigen::MatrixXd::Constant(count, columns, 0.03);
  sweep.log_ratio = Eigen::MatrixXd::Zero(count, columns);
  sweep.feature_weight.resize(count);
  for (int i = 0; i < count; ++i) {
    sweep.key_u.push_back(rows[i].u);
    sweep.feature_weight[i] = rows[i].feature_weight;
  }
  return sweep;
}

// The palm ends here; further on the hand's sections go around the fingers.
constexpr double kKnuckles = 2.45;
// From here on the foot's sections go around the toes.
constexpr double kToes = 0.72;

// The part's section around `center` in a frame of e1, e2, tangent.
CrossSection CastSection(const SectionSource& source,
                         const Vector3d& center,
                         const Eigen::Matrix3d& frame,
                         int columns,
                         double step) {
  std::vector<double> radii(columns);
  for (int k = 0; k < columns; ++k) {
    const double theta = 2 * std::numbers::pi * k / columns;
    radii[k] = ExitDistance(
        source.distance,
        center,
        std::cos(theta) * frame.col(0) + std::sin(theta) * frame.col(1),
        step);
  }
  return CrossSection(radii);
}

constexpr double kWhole = std::numeric_limits<double>::infinity();

// Rows at `end_u` and beyond are left alone.
void FillSections(const SectionSource& source,
                  const Skeleton& skeleton,
                  const Vector3d& root_in_solid,
                  double step,
                  double end_u,
                  Sweep* sweep) {
  const JointFrames frames = RestFrames(skeleton);
  for (int round = 0; round < kRounds; ++round) {
    Sweep bare = *sweep;
    bare.center_offset.setZero();
    const SweepAxis axis(bare, skeleton, frames);
    tbb::parallel_for(0, sweep->num_rows(), [&](int i) {
      const double u = sweep->key_u[i];
      if (u >= end_u) return;
      const SectionFrame section = axis.At(u);
      const Eigen::Matrix3d& frame = section.world_from_section;
      const Vector3d on_axis = section.center_in_world + root_in_solid;
      Vector2d offset =
          frame.leftCols<2>().transpose() * (source.inside(u) - on_axis);
      CrossSection cast;
      // Twice towards the centroid, so that the star centre is well inside.
      for (int k = 0; k < 3; ++k) {
        cast = CastSection(source,
                           on_axis + frame.leftCols<2>() * offset,
                           frame,
                           sweep->num_columns(),
                           step);
        CHECK_GT(cast.Area(), 0)
            << sweep->name << ": no section of the part at u = " << u;
        if (k < 2) offset += cast.Centroid();
      }
      sweep->center_offset.col(i) = offset;
      sweep->radius.row(i) = Eigen::Map<const Eigen::RowVectorXd>(
          cast.radii().data(), sweep->num_columns());
    });
  }
}

// Sections from `first_u` on: ellipses around the fingers or toes, which are
// not one star-shaped solid.
void FillDigitRows(const std::vector<Tube>& digits,
                   const Skeleton& skeleton,
                   const Vector3d& root_in_solid,
                   double first_u,
                   Sweep* sweep) {
  constexpr double kExponent = 2.5;
  Sweep bare = *sweep;
  bare.center_offset.setZero();
  const SweepAxis axis(bare, skeleton, RestFrames(skeleton));
  for (int i = 0; i < sweep->num_rows(); ++i) {
    const double u = sweep->key_u[i];
    if (u < first_u) continue;
    const SectionFrame section = axis.At(u);
    const Vector3d center = section.center_in_world + root_in_solid;
    Eigen::AlignedBox2d box;
    for (const Tube& digit : digits) {
      for (size_t k = 0; k + 1 < digit.point.size(); ++k) {
        const Eigen::Matrix3d& frame = section.world_from_section;
        const Vector3d a = frame.transpose() * (digit.point[k] - center);
        const Vector3d b = frame.transpose() * (digit.point[k + 1] - center);
        const double t = a.z() / (a.z() - b.z());
        // The last sphere reaches beyond the last point.
        const bool is_last = k + 2 == digit.point.size();
        const double reach =
            is_last ? 0.7 * digit.radius[k + 1] / (b - a).norm() : 0;
        if (t < 0 || t > 1 + reach) continue;
        const double on = std::min(t, 1.0);
        const double radius =
            digit.radius[k] + on * (digit.radius[k + 1] - digit.radius[k]);
        const Vector2d point = (a + on * (b - a)).head<2>();
        box.extend(point - Vector2d(radius, radius));
        box.extend(point + Vector2d(radius, radius));
      }
    }
    CHECK(!box.isEmpty()) << sweep->name << ": no digit at u = " << u;
    sweep->center_offset.col(i) = box.center();
    const CrossSection ellipse =
        CrossSection::Superellipse(box.sizes().x() / 2,
                                   box.sizes().y() / 2,
                                   kExponent,
                                   sweep->num_columns());
    sweep->radius.row(i) = Eigen::Map<const Eigen::RowVectorXd>(
        ellipse.radii().data(), sweep->num_columns());
  }
}

Sweep MirrorSweep(const Sweep& left, const std::string& name) {
  Sweep right = left;
  right.name = name;
  for (int& joint : right.chain) joint = MirrorJoint(joint);
  right.rest_reference.x() = -right.rest_reference.x();
  right.center_offset.row(1) = -right.center_offset.row(1);
  const int columns = left.num_columns();
  for (int k = 0; k < columns; ++k) {
    const int from = (columns - k) % columns;
    right.radius.col(k) = left.radius.col(from);
    right.log_ratio.col(k) = left.log_ratio.col(from);
  }
  return right;
}

}  // namespace

std::vector<Sweep> TemplateSweeps(const TemplateSolid& solid,
                                  const Skeleton& skeleton) {
  const Vector3d root = solid.joints()[kRoot];
  const double step = 5e-4 * solid.stature();
  const Vector3d front = Vector3d::UnitZ();

  std::vector<Sweep> sweeps(kNumTemplateSweeps);

  Sweep trunk = MakeSweep(
      "trunk",
      {kRoot, kSpine, kNeck, kHead, kHeadEnd},
      front,
      24,
      {{-0.18, 0.5}, {-0.08, 0.5}, {0.05, 0.8},  {0.25, 0.8},  {0.50, 0.8},
       {0.75, 0.8},  {1.00, 0.8},  {1.20, 0.8},  {1.35, 0.8},  {1.50, 0.5},
       {1.64, 0.5},  {1.76, 0.5},  {1.86, 0.3},  {1.94, 0.3},  {2.10, 0.3},
       {2.50, 0.3},  {2.90, 0.15}, {3.15, 0.15}, {3.40, 0.15}, {3.60, 0.15},
       {3.78, 0.15}, {3.90, 0.15}, {3.96, 0.15}});
  trunk.rigid_end = true;  // the skull
  FillSections({[&](const Vector3d& p) { return solid.Trunk(p); },
                [&](double u) -> Vector3d {
                  static constexpr int kChain[] = {
                      kRoot, kSpine, kNeck, kHead, kHeadEnd};
                  const int k = std::clamp(static_cast<int>(u), 0, 3);
                  const Vector3d& a = solid.joints()[kChain[k]];
                  const Vector3d& b = solid.joints()[kChain[k + 1]];
                  return a + (u - k) * (b - a);
                }},
               skeleton,
               root,
               step,
               kWhole,
               &trunk);

  Sweep arm = MakeSweep(
      "l_arm",
      {kLShoulder, kLElbow, kLWrist, kLHandEnd},
      front,
      16,
      {{0.00, 0.5},  {0.12, 0.5},  {0.25, 0.5},  {0.40, 1},    {0.55, 1},
       {0.70, 1},    {0.85, 1},    {1.00, 1},    {1.12, 1},    {1.25, 1},
       {1.40, 1},    {1.55, 1},    {1.70, 1},    {1.85, 1},    {2.00, 0.15},
       {2.15, 0.15}, {2.30, 0.15}, {2.45, 0.15}, {2.60, 0.15}, {2.75, 0.15},
       {2.88, 0.15}, {2.96, 0.15}});
  arm.rigid_end = true;
  FillSections({[&](const Vector3d& p) { return solid.Arm(p); },
                [&](double u) { return solid.ArmCenter(std::min(u, 2.4)); }},
               skeleton,
               root,
               step,
               kKnuckles,
               &arm);
  std::vector<Tube> fingers;
  for (int i = 0; i < 4; ++i) fingers.push_back(solid.finger(i));
  FillDigitRows(fingers, skeleton, root, kKnuckles, &arm);

  Sweep leg = MakeSweep("l_leg",
                        {kLHip, kLKnee, kLAnkle},
                        front,
                        16,
                        {{0.00, 0.5},
                         {0.10, 0.5},
                         {0.20, 0.5},
                         {0.32, 1},
                         {0.46, 1},
                         {0.60, 1},
                         {0.75, 1},
                         {0.88, 1},
                         {1.00, 1},
                         {1.10, 1},
                         {1.20, 1},
                         {1.32, 1},
                         {1.46, 1},
                         {1.60, 1},
                         {1.75, 1},
                         {1.88, 0.3},
                         {2.00, 0.3}});
  FillSections({[&](const Vector3d& p) { return solid.Leg(p); },
                [&](double u) { return solid.LegCenter(u); }},
               skeleton,
               root,
               step,
               kWhole,
               &leg);

  Sweep foot = MakeSweep("l_foot",
                         {kLAnkle, kLFootEnd},
                         Vector3d::UnitY(),
                         16,
                         {{-0.28, 0.15},
                          {-0.18, 0.15},
                          {-0.08, 0.15},
                          {0.04, 0.15},
                          {0.18, 0.15},
                          {0.34, 0.15},
                          {0.50, 0.15},
                          {0.66, 0.15},
                          {0.80, 0.15},
                          {0.90, 0.15},
                          {0.96, 0.15}});
  foot.rigid_end = true;
  const Vector3d ankle_to_toe =
      solid.joints()[kLFootEnd] - solid.joints()[kLAnkle];
  FillSections(
      {[&](const Vector3d& p) { return solid.Foot(p); },
       [&](double u) {
         return solid.FootCenter(u * ankle_to_toe.dot(solid.foot_forward()));
       }},
      skeleton,
      root,
      step,
      kToes,
      &foot);
  std::vector<Tube> toes;
  for (int i = 0; i < 5; ++i) toes.push_back(solid.toe(i));
  FillDigitRows(toes, skeleton, root, kToes, &foot);

  sweeps[kTrunkSweep] = trunk;
  sweeps[kLArmSweep] = arm;
  sweeps[kRArmSweep] = MirrorSweep(arm, "r_arm");
  sweeps[kLLegSweep] = leg;
  sweeps[kRLegSweep] = MirrorSweep(leg, "r_leg");
  sweeps[kLFootSweep] = foot;
  sweeps[kRFootSweep] = MirrorSweep(foot, "r_foot");
  return sweeps;
}

}  // namespace sweepfit
