// SPDX-License-Identifier: Apache-2.0
#include "solver/carried_surface.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// Bones around a joint share the surface within this fraction of a bone.
constexpr double kBlend = 0.12;

// Adds the joints that carry the section at u of a sweep.
void AddCarriers(const Sweep& sweep,
                 double u,
                 double weight,
                 std::map<int, double>* carriers) {
  const int last = sweep.num_bones() - 1;
  const int bone = std::clamp(static_cast<int>(std::floor(u)), 0, last);
  const double f = u - bone;
  double here = weight;
  // Only interior joints are shared: a limb's first section belongs to the
  // limb.
  if (f < kBlend && bone > 0) {
    const double before = weight * 0.5 * (1 - std::max(f, 0.0) / kBlend);
    (*carriers)[sweep.chain[bone - 1]] += before;
    here -= before;
  } else if (f > 1 - kBlend && bone < last) {
    const double after = weight * 0.5 * (1 - std::max(1 - f, 0.0) / kBlend);
    (*carriers)[sweep.chain[bone + 1]] += after;
    here -= after;
  }
  (*carriers)[sweep.chain[bone]] += here;
}

// Shares by which bone lengths move the section at u.
void AddStretch(const Sweep& sweep,
                double u,
                double weight,
                std::map<int, double>* stretch) {
  const int bone =
      std::clamp(static_cast<int>(std::floor(u)), 0, sweep.num_bones() - 1);
  for (int j = sweep.chain[bone]; j > 0; j = kJointParents[j]) {
    (*stretch)[j] += weight;
  }
  (*stretch)[sweep.chain[bone + 1]] += weight * (u - bone);
}

// How a section may differ from the template's: its size, its depth against its
// breadth, and its place in front of or behind the axis. Without the last one
// an outline would move the joints instead.
struct Mode {
  const char* name;
  int harmonic;
  double sigma;
};
constexpr Mode kModes[] = {
    {"_girth", 0, 0.15}, {"_shape", 2, 0.08}, {"_offset", 1, 0.15}};

// The k-th piecewise linear hat over the knots; flat beyond the ends.
double Hat(const std::vector<double>& knots, size_t k, double u) {
  u = std::clamp(u, knots.front(), knots.back());
  if (k > 0 && u >= knots[k - 1] && u <= knots[k]) {
    return (u - knots[k - 1]) / (knots[k] - knots[k - 1]);
  }
  if (k + 1 < knots.size() && u >= knots[k] && u <= knots[k + 1]) {
    return (knots[k + 1] - u) / (knots[k + 1] - knots[k]);
  }
  return 0;
}

}  // namespace

int MirrorSweep(const Body& body, int sweep) {
  for (size_t s = 0; s < body.sweeps.size(); ++s) {
    if (body.sweeps[s].chain[0] == MirrorJoint(body.sweeps[sweep].chain[0]) &&
        body.sweeps[s].chain.back() ==
            MirrorJoint(body.sweeps[sweep].chain.back())) {
      return static_cast<int>(s);
    }
  }
  return sweep;
}

GirthBasis::GirthBasis(const Body& body) {
  samples_.resize(body.sweeps.size());
  for (size_t s = 0; s < body.sweeps.size(); ++s) {
    const Sweep& sweep = body.sweeps[s];
    samples_[s].resize(sweep.num_rows() * sweep.num_columns());
    const int mirror = MirrorSweep(body, static_cast<int>(s));
    if (mirror < static_cast<int>(s)) {
      // Rows of mirrored sweeps agree, and all modes are the same on both
      // sides.
      samples_[s] = samples_[mirror];
      continue;
    }
    // Hats at joints and, on long bones, in the middle; a rigid end (hand,
    // head) has one for its whole bone.
    std::vector<double> knots;
    const double first = sweep.key_u.front(), last = sweep.key_u.back();
    if (first < -0.3) knots.push_back(first);
    for (int b = 0; b < sweep.num_bones(); ++b) {
      knots.push_back(b);
      const bool is_end = sweep.rigid_end && b == sweep.num_bones() - 1;
      if (!is_end) knots.push_back(b + 0.5);
    }
    knots.push_back(std::max(last, sweep.num_bones() - 0.5));
    // Which of cos theta and sin theta points to the front (or back) on both
    // sides: the reference direction, unless it points sideways.
    const double to_front =
        std::abs(sweep.rest_reference.x()) > 0.5 ? 0.5 * std::numbers::pi : 0.0;
    for (size_t k = 0; k < knots.size(); ++k) {
      for (const Mode& mode : kModes) {
        const int parameter = num_parameters();
        names_.push_back(sweep.name + "_" + std::to_string(k) + mode.name);
        sigma_.push_back(mode.sigma);
        for (int row = 0; row < sweep.num_rows(); ++row) {
          const double hat = Hat(knots, k, sweep.key_u[row]);
          if (hat <= 0) continue;
          for (int c = 0; c < sweep.num_columns(); ++c) {
            const double theta = 2 * std::numbers::pi * c / sweep.num_columns();
            samples_[s][row * sweep.num_columns() + c].emplace_back(
                parameter,
                hat * std::cos(mode.harmonic *
                               (theta - (mode.harmonic == 1 ? to_front : 0))));
          }
        }
      }
    }
  }
}

void GirthBasis::Apply(const std::vector<double>& girth, Body* body) const {
  for (size_t s = 0; s < body->sweeps.size(); ++s) {
    Sweep& sweep = body->sweeps[s];
    for (int row = 0; row < sweep.num_rows(); ++row) {
      for (int c = 0; c < sweep.num_columns(); ++c) {
        double q = 0;
        for (const auto& [k, value] :
             samples_[s][row * sweep.num_columns() + c]) {
          q += value * girth[k];
        }
        sweep.log_ratio(row, c) = q;
      }
    }
  }
}

std::shared_ptr<const ShapedPoint> CarryVertex(
    const Body& body,
    const JointFrames& frames,
    const PosedBody& posed,
    int vertex,
    const GirthBasis* basis,
    const RestDerivative* rest_derivative,
    const std::vector<double>& girth) {
  std::map<int, double> carriers, stretch;
  for (const SweepAttachment& attachment : body.binding[vertex].attachment) {
    if (attachment.sweep < 0 || attachment.weight <= 0) continue;
    const Sweep& sweep = body.sweeps[attachment.sweep];
    AddCarriers(sweep, attachment.u, attachment.weight, &carriers);
    AddStretch(sweep, attachment.u, attachment.weight, &stretch);
  }
  std::vector<std::pair<double, int>> heaviest;
  for (const auto& [joint, weight] : carriers) {
    heaviest.emplace_back(-weight, joint);
  }
  std::sort(heaviest.begin(), heaviest.end());
  heaviest.resize(std::min<size_t>(heaviest.size(), 4));
  double total = 0;
  for (const auto& [weight, joint] : heaviest) total -= weight;

  auto point = std::make_shared<ShapedPoint>();
  const Vector3d& x = posed.mesh.vertices[vertex];
  for (auto& rotation : point->world_from_joint) rotation.setIdentity();
  for (auto& p : point->carried.point_in_joint) p.setZero();
  for (size_t b = 0; b < heaviest.size(); ++b) {
    const int joint = heaviest[b].second;
    point->carried.joint[b] = joint;
    point->carried.weight[b] = -heaviest[b].first / total;
    point->world_from_joint[b] = frames.world_from_joint[joint];
    point->carried.point_in_joint[b] =
        frames.world_from_joint[joint].transpose() *
        (x - frames.joint_in_world[joint]);
  }
  point->carried.stretch.assign(stretch.begin(), stretch.end());
  if (basis == nullptr) return point;
  std::map<int, Vector3d> directions;
  for (const auto& term : rest_derivative->terms) {
    for (const auto& [k, value] : basis->OfSample(term.sweep, term.sample)) {
      auto [it, inserted] = directions.try_emplace(k, Vector3d::Zero());
      it->second +=
          value * (posed.motions[vertex].rotation * term.direction_at_rest);
    }
  }
  point->girth.assign(directions.begin(), directions.end());
  point->girth_at_linearisation = girth;
  return point;
}

}  // namespace sweepfit
