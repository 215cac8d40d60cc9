// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "model/mesh.h"
#include "model/skeleton.h"
#include "model/sweep.h"

namespace sweepfit {

// Where a vertex sits on one sweep, measured at rest:
//   P = c(u) + R(u) (rho r(u,theta) (cos theta, sin theta, 0) + tau e3)
struct SweepAttachment {
  int sweep = -1;  // index into Body::sweeps; -1: unused
  double weight = 0;
  double u = 0;
  double theta = 0;  // radians
  double rho = 1;    // multiple of the fitted radius
  double tau = 0;    // metres along the tangent; non-zero beyond the ends only
};

// A vertex is bound to at most three sweeps, weights summing to 1, heaviest
// first.
struct Binding {
  std::array<SweepAttachment, 3> attachment;
};

// Parts of the body, for colours in pictures, per-part figures and weights.
enum class BodyPart : std::uint8_t {
  kTrunk,
  kHead,
  kLArm,
  kLHand,
  kRArm,
  kRHand,
  kLLeg,
  kLFoot,
  kRLeg,
  kRFoot
};

// Mesh connectivity that all bodies made from one template share.
struct BodyTopology {
  std::vector<Quad> quads;  // counter-clockwise from outside; imported
                            // templates have triangles, see IsTriangle
  std::vector<std::array<Eigen::Vector2f, 4>> uv;  // per quad corner, [0,1]^2,
                                                   // v up (0 at the bottom)
  std::vector<int> mirror_vertex;  // the vertex on the other side
  std::vector<BodyPart> part;      // per vertex
};

// An animatable body: skeleton at rest, sweeps, and a closed quad mesh bound
// to them. A template and a fitted person are both a Body.
struct Body {
  Skeleton skeleton;
  std::vector<Sweep> sweeps;
  BodyTopology topology;
  std::vector<Binding> binding;  // per vertex
  // Refinement of each vertex beyond the sweeps, in its section frame (e1, e2,
  // tangent of the heaviest attachment), metres; moves with that frame.
  std::vector<Eigen::Vector3d> displacement_in_section;
  // What the template was made from or the fit found.
  double sex = 0.5;       // 0 female .. 1 male
  double stature = 1.70;  // metres, at rest
  double mass = 70;       // kg

  int num_vertices() const { return static_cast<int>(binding.size()); }
};

// Binds vertices, given at rest, to sweeps. `sweep_weights` names for each
// vertex one to three (sweep index, positive weight) pairs; weights are scaled
// to sum to 1. Each attachment reproduces the vertex exactly at rest: u solves
// (P - c(u)) . t(u) = 0 (the nearest solution where the axis bends around P),
// clamped to the range of the sweep's keys, where tau takes the rest. Replaces
// binding and displacements (by zero).
void BindVertices(
    const std::vector<Eigen::Vector3d>& vertices_at_rest,
    const std::vector<std::vector<std::pair<int, double>>>& sweep_weights,
    Body* body);

// The joints and frames of the rest pose, root at `root_in_world` = 0.
JointFrames RestFrames(const Skeleton& skeleton);

// The axes of all sweeps in a posture.
std::vector<SweepAxis> MakeAxes(const Body& body, const JointFrames& frames);

// Vertices of the body at rest.
std::vector<Eigen::Vector3d> RestVertices(const Body& body);

// How a vertex moves in a posture: P_world = rotation P_rest + translation.
// The rotation is rigid, blended from the vertex's sections; what bending does
// to their shape is part of the translation. For the Jacobians of fits: a
// change of the rest position d moves the posed vertex by rotation d, up to
// the few per cent by which a bend scales the section.
struct VertexMotion {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
};

// Poses one body. What does not depend on the posture is computed once, so
// that a posture of 13,000 vertices takes a few milliseconds.
//
// Every vertex keeps its place in its section while the section moves from
// rest to the posture and changes its shape where the limb bends (see
// BendShape). Where several sweeps meet, the motions of their sections are
// blended as dual quaternions, the changes of shape linearly.
class BodyDeformer {
 public:
  // Keeps a pointer to the body, which must neither move nor change.
  explicit BodyDeformer(const Body& body);
  ~BodyDeformer();
  BodyDeformer(BodyDeformer&&) noexcept;
  BodyDeformer& operator=(BodyDeformer&&) noexcept;

  const std::vector<Eigen::Vector3d>& rest_vertices() const;
  // World, metres.
  std::vector<Eigen::Vector3d> Vertices(const Pose& pose) const;
  std::vector<VertexMotion> Motions(const Pose& pose) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The same for a single posture.
std::vector<Eigen::Vector3d> PoseVertices(const Body& body, const Pose& pose);

// d x_rest / d q for one vertex: the rest position changes by
// sum_k direction[k] * d log_ratio(sample[k]) where a sample is an element of
// one sweep's log_ratio (flat index row * K + column).
struct RestDerivative {
  struct Term {
    int sweep;
    int sample;
    Eigen::Vector3d direction_at_rest;
  };
  std::vector<Term> terms;
};
RestDerivative RestByLogRatio(const Body& body, int vertex);
// The same for every vertex, much faster than one by one.
std::vector<RestDerivative> RestByLogRatio(const Body& body);

// Replaces the bone lengths; sections keep their size, axes stretch.
// Vertices follow at the same (u, theta, rho, tau). The root's entry is
// ignored; CHECKs that the others are positive. Stature and mass stay as they
// are.
void SetBoneLengths(const std::array<double, kNumJoints>& length, Body* body);

// Multiplies every radius, centre offset, tau, displacement and bone length,
// the stature, and the mass by the cube.
void ScaleBody(double factor, Body* body);

}  // namespace sweepfit
