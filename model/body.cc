// SPDX-License-Identifier: Apache-2.0
#include "model/body.h"

#include <glog/logging.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "model/bend_shape.h"
#include "model/rigid_motion.h"
#include "model/smooth_step.h"
#include "model/unfold.h"

namespace sweepfit {
namespace {

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

int NumAttachments(const Binding& binding) {
  int count = 0;
  while (count < 3 && binding.attachment[count].sweep >= 0) ++count;
  return count;
}

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

std::vector<SweepAxis> MakeAxes(const Body& body, const JointFrames& frames) {
  std::vector<SweepAxis> axes;
  axes.reserve(body.sweeps.size());
  for (const Sweep& sweep : body.sweeps) {
    axes.emplace_back(sweep, body.skeleton, frames);
  }
  return axes;
}

std::vector<Eigen::Vector3d> RestVertices(const Body& body) {
  const std::vector<SweepAxis> axes = MakeAxes(body, RestFrames(body.skeleton));
  std::vector<Eigen::Vector3d> vertices(body.num_vertices());
  tbb::parallel_for(0, body.num_vertices(), [&](int v) {
    vertices[v] = RestVertex(body, axes, v);
  });
  return vertices;
}

// Dual quaternions swell a joint that bends between two sweeps, linear
// blending shrinks it: shoulders and hips keep their volume in between.
constexpr double kLinearShare = 0.4;

// The skull is rigid, but its joint lies between the ears: face and occiput
// would bend with the sections of the neck below it. From a little below the
// border between trunk and head to a little above it, shares of stature,
// vertices pass from the section they are bound to over to the rigid end of the
// sweep.
constexpr double kSkullBelowBorder = 0.04;
constexpr double kSkullAboveBorder = 0.025;

// Per vertex how far it belongs to the skull, 0 to 1.
std::vector<double> SkullShare(const Body& body,
                               const std::vector<Eigen::Vector3d>& rest) {
  const std::vector<BodyPart>& part = body.topology.part;
  std::vector<double> share(rest.size(), 0);
  if (part.size() != rest.size()) return share;
  std::vector<int> border;
  for (const Quad& quad : body.topology.quads) {
    const bool mixed = std::any_of(quad.begin(), quad.end(), [&](int v) {
      return part[v] != BodyPart::kHead;
    });
    for (const int v : quad) {
      if (mixed && part[v] == BodyPart::kHead) border.push_back(v);
    }
  }
  std::sort(border.begin(), border.end());
  border.erase(std::unique(border.begin(), border.end()), border.end());
  if (border.empty()) return share;
  const double below = kSkullBelowBorder * body.stature;
  const double above = kSkullAboveBorder * body.stature;
  for (std::size_t v = 0; v < rest.size(); ++v) {
    const bool is_head = part[v] == BodyPart::kHead;
    if (!is_head && part[v] != BodyPart::kTrunk) continue;
    double nearest = 1e9;
    for (const int b : border) {
      nearest = std::min(nearest, (rest[v] - rest[b]).squaredNorm());
    }
    const double height = (is_head ? 1 : -1) * std::sqrt(nearest);
    share[v] = SmoothStep((height + below) / (below + above));
  }
  return share;
}

// Where sections of a sweep that ends in the head are the skull's: beyond the
// rounded corner of the last bone.
double SkullParameter(const Sweep& sweep, double u) {
  return std::max(u, sweep.num_bones() - 0.5);
}

struct BodyDeformer::Impl {
  explicit Impl(const Body& b)
      : body(b),
        rest_axes(MakeAxes(b, RestFrames(b.skeleton))),
        rest_vertices(RestVertices(b)),
        attached(b.num_vertices()) {
    zones.reserve(body.sweeps.size());
    for (std::size_t s = 0; s < body.sweeps.size(); ++s) {
      zones.emplace_back(body.sweeps[s], rest_axes[s]);
    }
    const std::vector<double> skull = SkullShare(body, rest_vertices);
    tbb::parallel_for(
        0, body.num_vertices(), [&](int v) { AttachVertex(v, skull[v]); });
    unfolder.emplace(body.topology.quads, rest_vertices);
  }

  void AttachVertex(int v, double skull_share) {
    for (const SweepAttachment& a : body.binding[v].attachment) {
      if (a.sweep < 0) break;
      const Sweep& sweep = body.sweeps[a.sweep];
      const double share = sweep.chain.back() == kHeadEnd ? skull_share : 0;
      if (share < 1) AddAttached(v, a.sweep, (1 - share) * a.weight, a.u);
      if (share > 0) {
        AddAttached(v, a.sweep, share * a.weight, SkullParameter(sweep, a.u));
      }
    }
  }

  void AddAttached(int v, int sweep, double weight, double u) {
    Attached at;
    at.sweep = sweep;
    at.weight = weight;
    at.u = u;
    at.offset = CenterOffset(body.sweeps[sweep], u);
    const SectionFrame section = rest_axes[sweep].OnAxis(u);
    at.world_from_section_at_rest = section.world_from_section;
    at.point_in_section = section.world_from_section.transpose() *
                          (rest_vertices[v] - section.center_in_world);
    at.rest_change =
        zones[sweep].RestChange(u,
                                section.world_from_section,
                                at.offset,
                                at.point_in_section.head<2>() - at.offset);
    attached[v].push_back(at);
  }

  // A vertex on a section that moves it.
  struct Attached {
    int sweep;
    double weight;
    double u;
    Eigen::Vector2d offset;            // section centre from the axis
    Eigen::Vector3d point_in_section;  // from the axis, at rest
    Eigen::Vector2d rest_change;
    Eigen::Matrix3d world_from_section_at_rest;
  };

  void Deform(const Pose& pose,
              std::vector<Eigen::Matrix3d>* rotations,
              std::vector<Eigen::Vector3d>* vertices) const {
    rotations->resize(rest_vertices.size());
    vertices->resize(rest_vertices.size());
    const std::vector<SweepAxis> axes =
        MakeAxes(body, ForwardKinematics(body.skeleton, pose));
    std::vector<BendShape> shapes;
    shapes.reserve(axes.size());
    for (std::size_t s = 0; s < axes.size(); ++s) {
      shapes.emplace_back(zones[s], axes[s]);
    }
    tbb::parallel_for(0, body.num_vertices(), [&](int v) {
      MotionBlend blend;
      Eigen::Vector3d change_in_world = Eigen::Vector3d::Zero();
      for (const Attached& at : attached[v]) {
        const SectionFrame posed = axes[at.sweep].OnAxis(at.u);
        const Eigen::Matrix3d& frame = posed.world_from_section;
        const Eigen::Vector2d change =
            shapes[at.sweep].Change(at.u,
                                    frame,
                                    at.offset,
                                    at.point_in_section.head<2>() - at.offset) -
            at.rest_change;
        const Eigen::Matrix3d rotation =
            frame * at.world_from_section_at_rest.transpose();
        const Eigen::Vector3d moved =
            posed.center_in_world + frame * at.point_in_section;
        if (attached[v].size() == 1) {
          (*rotations)[v] = rotation;
          (*vertices)[v] = moved + frame.leftCols<2>() * change;
          return;
        }
        change_in_world +=
            at.weight * (frame.leftCols<2>() * change + kLinearShare * moved);
        blend.Add(at.weight, {rotation, moved - rotation * rest_vertices[v]});
      }
      const RigidMotion motion = blend.Normalized();
      (*rotations)[v] = motion.rotation;
      (*vertices)[v] =
          (1 - kLinearShare) *
              (motion.rotation * rest_vertices[v] + motion.translation) +
          change_in_world;
    });
    unfolder->Apply(*rotations, vertices);
  }

  const Body& body;
  std::vector<SweepAxis> rest_axes;
  std::vector<BendZones> zones;
  std::vector<Eigen::Vector3d> rest_vertices;
  std::vector<std::vector<Attached>> attached;  // per vertex
  std::optional<Unfolder> unfolder;
};

BodyDeformer::BodyDeformer(const Body& body)
    : impl_(std::make_unique<Impl>(body)) {}
BodyDeformer::~BodyDeformer() = default;
BodyDeformer::BodyDeformer(BodyDeformer&&) noexcept = default;
BodyDeformer& BodyDeformer::operator=(BodyDeformer&&) noexcept = default;

const std::vector<Eigen::Vector3d>& BodyDeformer::rest_vertices() const {
  return impl_->rest_vertices;
}

std::vector<Eigen::Vector3d> BodyDeformer::Vertices(const Pose& pose) const {
  std::vector<Eigen::Matrix3d> rotations;
  std::vector<Eigen::Vector3d> vertices;
  impl_->Deform(pose, &rotations, &vertices);
  return vertices;
}

std::vector<VertexMotion> BodyDeformer::Motions(const Pose& pose) const {
  std::vector<Eigen::Matrix3d> rotations;
  std::vector<Eigen::Vector3d> vertices;
  impl_->Deform(pose, &rotations, &vertices);
  std::vector<VertexMotion> motions(vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    motions[v] = {rotations[v],
                  vertices[v] - rotations[v] * impl_->rest_vertices[v]};
  }
  return motions;
}

std::vector<Eigen::Vector3d> PoseVertices(const Body& body, const Pose& pose) {
  return BodyDeformer(body).Vertices(pose);
}

RestDerivative RestByLogRatio(const Body& body, int vertex) {
  return DerivativeOfVertex(
      body, MakeAxes(body, RestFrames(body.skeleton)), vertex);
}

std::vector<RestDerivative> RestByLogRatio(const Body& body) {
  const std::vector<SweepAxis> axes = MakeAxes(body, RestFrames(body.skeleton));
  std::vector<RestDerivative> derivatives(body.num_vertices());
  tbb::parallel_for(0, body.num_vertices(), [&](int v) {
    derivatives[v] = DerivativeOfVertex(body, axes, v);
  });
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
