// SPDX-License-Identifier: Apache-2.0
#include "model/body.h"

#include <glog/logging.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

namespace sweepfit {
namespace {

std::vector<SweepAxis> MakeAxes(const Body& body, const JointFrames& frames) {
  std::vector<SweepAxis> axes;
  axes.reserve(body.sweeps.size());
  for (const Sweep& sweep : body.sweeps) {
    axes.emplace_back(sweep, body.skeleton, frames);
  }
  return axes;
}

Eigen::Vector3d Around(double theta) {
  return {std::cos(theta), std::sin(theta), 0};
}

// ---------------------------------------------------------------- binding

// The foot of a perpendicular from a point onto an axis.
struct AxisFoot {
  double u;
  SectionFrame section;
  double distance;
};

// Finds the section whose plane holds a point: u with (P - c(u)) . t(u) = 0.
// Where the axis bends around the point there may be several; the nearest is
// taken. Beyond the range of the keys it is the end section.
class AxisProjector {
 public:
  AxisProjector(const Sweep& sweep, const SweepAxis& axis) : axis_(axis) {
    const double first = sweep.key_u.front();
    const double range = sweep.key_u.back() - first;
    for (int i = 0; i < kNumSamples; ++i) {
      const double u = first + range * i / (kNumSamples - 1);
      samples_[i] = {u, axis.At(u)};
    }
  }

  AxisFoot Project(const Eigen::Vector3d& point) const {
    std::optional<AxisFoot> nearest;
    const auto consider = [&](double u) {
      const SectionFrame section = axis_.At(u);
      const double distance = (point - section.center_in_world).norm();
      if (!nearest || distance < nearest->distance) {
        nearest = AxisFoot{u, section, distance};
      }
    };
    // Along the axis the distance falls while the point lies ahead, and so
    // has a minimum where it ceases to, or at an end.
    double ahead = Ahead(point, samples_.front().section);
    if (ahead <= 0) consider(samples_.front().u);
    for (int i = 1; i < kNumSamples; ++i) {
      const double ahead_next = Ahead(point, samples_[i].section);
      if (ahead > 0 && ahead_next <= 0) {
        consider(Solve(
            point, {samples_[i - 1].u, ahead}, {samples_[i].u, ahead_next}));
      }
      ahead = ahead_next;
    }
    if (ahead > 0) consider(samples_.back().u);
    return *nearest;
  }

 private:
  static constexpr int kNumSamples = 64;
  struct Sample {
    double u;
    SectionFrame section;
  };
  struct Trial {
    double u;
    double ahead;
  };

  static double Ahead(const Eigen::Vector3d& point,
                      const SectionFrame& section) {
    return (point - section.center_in_world)
        .dot(section.world_from_section.col(2));
  }

  // Newton's method with the slope between the last two trials, kept inside
  // the bracket by bisection.
  double Solve(const Eigen::Vector3d& point, Trial low, Trial high) const {
    constexpr int kMaxTrials = 100;
    constexpr double kTolerance = 1e-14;  // metres
    Trial last = low;
    Trial now = high;
    for (int i = 0; i < kMaxTrials; ++i) {
      if (std::abs(now.ahead) <= kTolerance) break;
      double u =
          now.u - now.ahead * (now.u - last.u) / (now.ahead - last.ahead);
      if (!(u > low.u && u < high.u)) u = 0.5 * (low.u + high.u);
      if (u == low.u || u == high.u) break;  // neighbouring numbers
      last = now;
      now = {u, Ahead(point, axis_.At(u))};
      (now.ahead > 0 ? low : high) = now;
    }
    return now.u;
  }

  const SweepAxis& axis_;
  std::array<Sample, kNumSamples> samples_;
};

SweepAttachment Attach(const Eigen::Vector3d& point,
                       const Sweep& sweep,
                       const AxisProjector& projector) {
  const AxisFoot foot = projector.Project(point);
  const Eigen::Vector3d point_in_section =
      foot.section.world_from_section.transpose() *
      (point - foot.section.center_in_world);
  SweepAttachment attachment;
  attachment.u = foot.u;
  attachment.theta = std::atan2(point_in_section.y(), point_in_section.x());
  attachment.rho = point_in_section.head<2>().norm() /
                   Radius(sweep, foot.u, attachment.theta);
  attachment.tau = point_in_section.z();
  return attachment;
}

// ----------------------------------------------------------------- posing

// x -> rotation x + translation.
using RigidMotion = VertexMotion;

RigidMotion MotionBetween(const SectionFrame& from, const SectionFrame& to) {
  const Eigen::Matrix3d rotation =
      to.world_from_section * from.world_from_section.transpose();
  return {rotation, to.center_in_world - rotation * from.center_in_world};
}

// Sums rigid motions as dual quaternions.
class MotionBlend {
 public:
  void Add(double weight, const RigidMotion& motion) {
    const Eigen::Quaterniond real(motion.rotation);
    const Eigen::Vector3d& t = motion.translation;
    const Eigen::Quaterniond dual =
        Eigen::Quaterniond(0, t.x() / 2, t.y() / 2, t.z() / 2) * real;
    // q and -q are the same motion; the first one decides.
    if (real_.dot(real.coeffs()) < 0) weight = -weight;
    real_ += weight * real.coeffs();
    dual_ += weight * dual.coeffs();
  }

  RigidMotion Normalized() const {
    const double norm = real_.norm();
    const Eigen::Quaterniond real(Eigen::Vector4d(real_ / norm));
    const Eigen::Quaterniond dual(Eigen::Vector4d(dual_ / norm));
    return {real.toRotationMatrix(), 2 * (dual * real.conjugate()).vec()};
  }

 private:
  Eigen::Vector4d real_ = Eigen::Vector4d::Zero();
  Eigen::Vector4d dual_ = Eigen::Vector4d::Zero();
};

int NumAttachments(const Binding& binding) {
  int count = 0;
  while (count < 3 && binding.attachment[count].sweep >= 0) ++count;
  return count;
}

// The axes of a body at rest and in a posture.
//
// Sections are moved, not reshaped: a point keeps its place in its section
// frame. What bending does to the shape of a section (the volume lost where
// the rounded axis is shorter than the bones it replaces, the inner side
// folding over) would be a scaling of the point within the section, here.
class SectionMotions {
 public:
  SectionMotions(const Body& body, const Pose& pose)
      : rest_axes_(MakeAxes(body, RestFrames(body.skeleton))),
        posed_axes_(MakeAxes(body, ForwardKinematics(body.skeleton, pose))) {}

  RigidMotion At(const Binding& binding) const {
    const int count = NumAttachments(binding);
    if (count == 1) return At(binding.attachment[0]);
    MotionBlend blend;
    for (int i = 0; i < count; ++i) {
      const SweepAttachment& attachment = binding.attachment[i];
      blend.Add(attachment.weight, At(attachment));
    }
    return blend.Normalized();
  }

 private:
  RigidMotion At(const SweepAttachment& attachment) const {
    return MotionBetween(rest_axes_[attachment.sweep].At(attachment.u),
                         posed_axes_[attachment.sweep].At(attachment.u));
  }

  std::vector<SweepAxis> rest_axes_;
  std::vector<SweepAxis> posed_axes_;
};

// ------------------------------------------------------------------- rest

Eigen::Vector3d RestVertex(const Body& body,
                           const std::vector<SweepAxis>& rest_axes,
                           int vertex) {
  const Binding& binding = body.binding[vertex];
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  for (int i = 0; i < NumAttachments(binding); ++i) {
    const SweepAttachment& a = binding.attachment[i];
    const SectionFrame section = rest_axes[a.sweep].At(a.u);
    Eigen::Vector3d point_in_section =
        a.rho * Radius(body.sweeps[a.sweep], a.u, a.theta) * Around(a.theta);
    point_in_section.z() = a.tau;
    position += a.weight * (section.center_in_world +
                            section.world_from_section * point_in_section);
    if (i == 0) {
      position +=
          section.world_from_section * body.displacement_in_section[vertex];
    }
  }
  return position;
}

RestDerivative DerivativeOfVertex(const Body& body,
                                  const std::vector<SweepAxis>& rest_axes,
                                  int vertex) {
  const Binding& binding = body.binding[vertex];
  RestDerivative derivative;
  for (int i = 0; i < NumAttachments(binding); ++i) {
    const SweepAttachment& a = binding.attachment[i];
    const Sweep& sweep = body.sweeps[a.sweep];
    // r = r_T exp(sum_k w_k q_k), so d r / d q_k = r w_k.
    const Eigen::Vector3d by_log_radius =
        a.weight * a.rho * Radius(sweep, a.u, a.theta) *
        (rest_axes[a.sweep].At(a.u).world_from_section * Around(a.theta));
    const SampleWeights samples = RadiusWeights(sweep, a.u, a.theta);
    for (int k = 0; k < 16; ++k) {
      if (samples.weight[k] == 0) continue;
      derivative.terms.push_back(
          {a.sweep, samples.index[k], samples.weight[k] * by_log_radius});
    }
  }
  return derivative;
}

}  // namespace

void BindVertices(
    const std::vector<Eigen::Vector3d>& vertices_at_rest,
    const std::vector<std::vector<std::pair<int, double>>>& sweep_weights,
    Body* body) {
  CHECK_EQ(vertices_at_rest.size(), sweep_weights.size());
  const std::vector<SweepAxis> axes =
      MakeAxes(*body, RestFrames(body->skeleton));
  std::vector<AxisProjector> projectors;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    projectors.emplace_back(body->sweeps[i], axes[i]);
  }

  body->binding.assign(vertices_at_rest.size(), Binding());
  body->displacement_in_section.assign(vertices_at_rest.size(),
                                       Eigen::Vector3d::Zero());
  for (std::size_t v = 0; v < vertices_at_rest.size(); ++v) {
    std::vector<std::pair<int, double>> weights = sweep_weights[v];
    std::stable_sort(
        weights.begin(), weights.end(), [](const auto& a, const auto& b) {
          return a.second > b.second;
        });
    CHECK(!weights.empty() && weights.size() <= 3) << "vertex " << v;
    double sum = 0;
    for (const auto& [sweep, weight] : weights) {
      CHECK_GT(weight, 0) << "vertex " << v;
      sum += weight;
    }
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const auto& [sweep, weight] = weights[i];
      SweepAttachment& attachment = body->binding[v].attachment[i];
      attachment = Attach(
          vertices_at_rest[v], body->sweeps.at(sweep), projectors[sweep]);
      attachment.sweep = sweep;
      attachment.weight = weight / sum;
    }
  }
}

JointFrames RestFrames(const Skeleton& skeleton) {
  return ForwardKinematics(skeleton, Pose());
}

std::vector<Eigen::Vector3d> RestVertices(const Body& body) {
  const std::vector<SweepAxis> axes = MakeAxes(body, RestFrames(body.skeleton));
  std::vector<Eigen::Vector3d> vertices(body.num_vertices());
  for (int v = 0; v < body.num_vertices(); ++v) {
    vertices[v] = RestVertex(body, axes, v);
  }
  return vertices;
}

std::vector<VertexMotion> VertexMotions(const Body& body, const Pose& pose) {
  const SectionMotions sections(body, pose);
  std::vector<VertexMotion> motions(body.num_vertices());
  for (int v = 0; v < body.num_vertices(); ++v) {
    motions[v] = sections.At(body.binding[v]);
  }
  return motions;
}

std::vector<Eigen::Vector3d> PoseVertices(const Body& body, const Pose& pose) {
  const std::vector<VertexMotion> motions = VertexMotions(body, pose);
  std::vector<Eigen::Vector3d> vertices = RestVertices(body);
  for (int v = 0; v < body.num_vertices(); ++v) {
    vertices[v] = motions[v].rotation * vertices[v] + motions[v].translation;
  }
  return vertices;
}

RestDerivative RestByLogRatio(const Body& body, int vertex) {
  return DerivativeOfVertex(
      body, MakeAxes(body, RestFrames(body.skeleton)), vertex);
}

std::vector<RestDerivative> RestByLogRatio(const Body& body) {
  const std::vector<SweepAxis> axes = MakeAxes(body, RestFrames(body.skeleton));
  std::vector<RestDerivative> derivatives(body.num_vertices());
  for (int v = 0; v < body.num_vertices(); ++v) {
    derivatives[v] = DerivativeOfVertex(body, axes, v);
  }
  return derivatives;
}

void SetBoneLengths(const std::array<double, kNumJoints>& length, Body* body) {
  for (int joint = 0; joint < kNumJoints; ++joint) {
    if (kJointParents[joint] < 0) continue;
    CHECK(length[joint] > 0 && std::isfinite(length[joint]))
        << kJointNames[joint] << " " << length[joint];
    body->skeleton.length[joint] = length[joint];
  }
}

void ScaleBody(double factor, Body* body) {
  CHECK(factor > 0 && std::isfinite(factor)) << factor;
  for (double& length : body->skeleton.length) length *= factor;
  for (Sweep& sweep : body->sweeps) {
    sweep.radius *= factor;
    sweep.center_offset *= factor;
  }
  for (Binding& binding : body->binding) {
    for (SweepAttachment& attachment : binding.attachment) {
      attachment.tau *= factor;
    }
  }
  for (Eigen::Vector3d& displacement : body->displacement_in_section) {
    displacement *= factor;
  }
  body->stature *= factor;
  body->mass *= factor * factor * factor;
}

}  // namespace sweepfit
