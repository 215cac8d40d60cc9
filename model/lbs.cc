// SPDX-License-Identifier: Apache-2.0
#include "model/lbs.h"

#include <glog/logging.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

namespace sweepfit {
namespace {

constexpr int kMaxCandidates = 6;
constexpr int kMaxInfluences = 4;
// Weights below this are noise: a tenth of a metre of relative motion would
// show a tenth of a millimetre.
constexpr double kNegligibleWeight = 1e-3;
// Neighbours whose weights differ by 1 are as bad as this share of the stature
// of position error in every pose.
constexpr double kSmoothnessShare = 0.02;
constexpr int kSmoothingPasses = 8;
// Left and right count as mirror images below this, metres.
constexpr double kSymmetryTolerance = 1e-6;

using Vector6 = Eigen::Matrix<double, kMaxCandidates, 1>;
using Matrix6 = Eigen::Matrix<double, kMaxCandidates, kMaxCandidates>;
using JointWeights = std::array<double, kNumJoints>;

// ---------------------------------------------------------------------------
// Sampled poses

// How far a joint turns, degrees: `flex` takes the bone that starts there
// towards `flex_towards`, `side` takes it towards the outside of the body,
// `twist` turns it about itself.
struct JointRange {
  int joint;
  Eigen::Vector3d flex_towards;
  double flex_min, flex_max;
  double side_min, side_max;
  double twist_max;
};

const std::vector<JointRange>& JointRanges() {
  const Eigen::Vector3d up(0, 1, 0), front(0, 0, 1), back(0, 0, -1);
  static const auto* ranges = new std::vector<JointRange>{
      {kSpine, front, -20, 45, -25, 25, 30},
      {kNeck, front, -20, 30, -20, 20, 30},
      {kHead, front, -30, 40, -25, 25, 50},
      {kLShoulder, front, -40, 100, -45, 100, 60},
      {kLElbow, front, 0, 135, 0, 0, 20},
      {kLWrist, front, -60, 60, -20, 20, 70},
      {kLHip, front, -20, 100, -15, 40, 30},
      {kLKnee, back, 0, 130, 0, 0, 10},
      {kLAnkle, up, -40, 20, -15, 15, 15},
      {kRShoulder, front, -40, 100, -45, 100, 60},
      {kRElbow, front, 0, 135, 0, 0, 20},
      {kRWrist, front, -60, 60, -20, 20, 70},
      {kRHip, front, -20, 100, -15, 40, 30},
      {kRKnee, back, 0, 130, 0, 0, 10},
      {kRAnkle, up, -40, 20, -15, 15, 15},
  };
  return *ranges;
}

// The joint that ends the bone which this joint turns. Of several, the one
// that continues the axis of the body.
int MainChild(int joint) {
  for (int child = joint + 1; child < kNumJoints; ++child) {
    if (kJointParents[child] == joint) return child;
  }
  return -1;
}

bool HasChildren(int joint) { return MainChild(joint) >= 0; }

bool IsRightSide(int joint) { return MirrorJoint(joint) < joint; }

// Rotation by `angle` about the axis that takes `from` towards `towards`.
Eigen::Quaterniond Towards(const Eigen::Vector3d& from,
                           const Eigen::Vector3d& towards,
                           double angle) {
  Eigen::Vector3d axis = from.cross(towards);
  if (axis.norm() < 1e-6) axis = from.unitOrthogonal();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized()));
}

constexpr double kRadians = std::numbers::pi / 180;

// Rotation of one joint from its three angles in degrees.
Eigen::Quaterniond JointRotation(const Skeleton& skeleton,
                                 const JointRange& range,
                                 const std::array<double, 3>& degrees) {
  const Eigen::Vector3d bone =
      skeleton.rest_direction[MainChild(range.joint)].normalized();
  const Eigen::Vector3d outside(IsRightSide(range.joint) ? -1 : 1, 0, 0);
  return Towards(bone, range.flex_towards, degrees[0] * kRadians) *
         Towards(bone, outside, degrees[1] * kRadians) *
         Eigen::Quaterniond(Eigen::AngleAxisd(degrees[2] * kRadians, bone));
}

// Rotation of a collar bone that lifts the shoulder and brings it forward.
Eigen::Quaterniond CollarRotation(const Skeleton& skeleton,
                                  int shoulder,
                                  double lift_degrees,
                                  double forward_degrees) {
  const Eigen::Vector3d& bone = skeleton.rest_direction[shoulder];
  return Towards(bone, Eigen::Vector3d::UnitZ(), forward_degrees * kRadians) *
         Towards(bone, Eigen::Vector3d::UnitY(), lift_degrees * kRadians);
}

// The posture reflected at the plane x = 0.
Pose MirrorPose(const Pose& pose) {
  Pose mirrored;
  mirrored.root_in_world = pose.root_in_world;
  mirrored.root_in_world.x() *= -1;
  const auto reflected = [](const Eigen::Quaterniond& q) {
    return Eigen::Quaterniond(q.w(), q.x(), -q.y(), -q.z());
  };
  for (int j = 0; j < kNumJoints; ++j) {
    mirrored.rotation[MirrorJoint(j)] = reflected(pose.rotation[j]);
  }
  mirrored.collar = {reflected(pose.collar[1]), reflected(pose.collar[0])};
  return mirrored;
}

// Postures in mirrored pairs: in the first third every joint turns about one
// of its axes by half or all of its range, in the others about all of them by
// random angles; collar bones turn in all. The root stays: blending with
// weights that sum to 1 commutes with rigid motion of the whole body.
std::vector<Pose> SamplePoses(const Skeleton& skeleton,
                              int num_poses,
                              unsigned seed) {
  std::mt19937 generator(seed);
  // Own mapping to [0, 1): that of the standard library is not specified.
  const auto uniform = [&generator] { return generator() / 4294967296.0; };
  const int num_pairs = std::max(1, (num_poses + 1) / 2);
  const int num_single_axis = std::max(1, num_pairs / 3);
  std::vector<Pose> poses;
  for (int i = 0; i < num_pairs; ++i) {
    Pose pose;
    for (const JointRange& range : JointRanges()) {
      const std::array<double, 3> low = {
          range.flex_min, range.side_min, -range.twist_max};
      const std::array<double, 3> high = {
          range.flex_max, range.side_max, range.twist_max};
      std::array<double, 3> degrees = {0, 0, 0};
      if (i < num_single_axis) {
        const int axis = (i + range.joint) % 3;
        const double share = uniform() < 0.5 ? 0.5 : 1.0;
        degrees[axis] = share * (uniform() < 0.5 ? low[axis] : high[axis]);
      } else {
        for (int axis = 0; axis < 3; ++axis) {
          degrees[axis] = low[axis] + uniform() * (high[axis] - low[axis]);
        }
      }
      pose.rotation[range.joint] = JointRotation(skeleton, range, degrees);
    }
    for (int side = 0; side < 2; ++side) {
      const double lift = -5 + 30 * uniform();
      const double forward = -10 + 25 * uniform();
      pose.collar[side] = CollarRotation(
          skeleton, side == 0 ? kLShoulder : kRShoulder, lift, forward);
    }
    poses.push_back(pose);
    poses.push_back(MirrorPose(pose));
  }
  return poses;
}

// ---------------------------------------------------------------------------
// Bone motions

struct RigidMotion {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
};
using BoneMotions = std::array<RigidMotion, kNumJoints>;

// How each joint carries points from rest to the posture: T_j T_j,rest^-1.
BoneMotions MotionsFromRest(const Skeleton& skeleton, const Pose& pose) {
  const JointFrames rest = RestFrames(skeleton);
  const JointFrames posed = ForwardKinematics(skeleton, pose);
  BoneMotions motions;
  for (int j = 0; j < kNumJoints; ++j) {
    motions[j].rotation =
        posed.world_from_joint[j] * rest.world_from_joint[j].transpose();
    motions[j].translation =
        posed.joint_in_world[j] - motions[j].rotation * rest.joint_in_world[j];
  }
  return motions;
}

// ---------------------------------------------------------------------------
// Candidates

// The joints that may move one vertex, at most six, most plausible first.
struct Candidates {
  int count = 0;
  std::array<int, kMaxCandidates> joint{};

  int Find(int wanted) const {
    for (int i = 0; i < count; ++i) {
      if (joint[i] == wanted) return i;
    }
    return -1;
  }
};

// A joint turns the bone that starts there, so bone k of a chain belongs to
// chain[k]; its neighbours in the chain and the parent of the chain matter
// where bones meet and where twist is spread.
Candidates FindCandidates(const Body& body, int vertex) {
  JointWeights score{};
  for (const SweepAttachment& attachment : body.binding[vertex].attachment) {
    if (attachment.sweep < 0 || attachment.weight <= 0) continue;
    const Sweep& sweep = body.sweeps[attachment.sweep];
    const int num_bones = sweep.num_bones();
    for (int bone = -1; bone <= num_bones; ++bone) {
      const int joint =
          bone < 0 ? kJointParents[sweep.chain[0]] : sweep.chain[bone];
      if (joint < 0 || !HasChildren(joint)) continue;
      // Distance from u to the bone's range [bone, bone + 1].
      const double distance =
          std::max({0.0, bone - attachment.u, attachment.u - (bone + 1)});
      if (distance > 1) continue;
      score[joint] += attachment.weight / (0.1 + distance);
    }
  }
  std::vector<int> order;
  for (int j = 0; j < kNumJoints; ++j) {
    if (score[j] > 0) order.push_back(j);
  }
  std::stable_sort(order.begin(), order.end(), [&score](int a, int b) {
    return score[a] > score[b];
  });
  Candidates candidates;
  candidates.count = std::min<int>(kMaxCandidates, order.size());
  if (candidates.count == 0) candidates.count = 1;  // the root, for loose ends
  std::copy_n(order.begin(),
              std::min<std::size_t>(candidates.count, order.size()),
              candidates.joint.begin());
  return candidates;
}

// ---------------------------------------------------------------------------
// Least squares on the simplex

// Minimises w^T A w / 2 - b^T w subject to sum w = 1, w >= 0 over the first n
// entries, by a primal active-set method; A symmetric positive definite.
Vector6 SolveOnSimplex(const Matrix6& A, const Vector6& b, int n) {
  Vector6 w = Vector6::Zero();
  w.head(n).setConstant(1.0 / n);
  std::array<bool, kMaxCandidates> free{};
  std::fill_n(free.begin(), n, true);
  const double scale = A.topLeftCorner(n, n).diagonal().maxCoeff();
  for (int iteration = 0; iteration < 8 * kMaxCandidates; ++iteration) {
    std::array<int, kMaxCandidates> index{};
    int m = 0;
    for (int i = 0; i < n; ++i) {
      if (free[i]) index[m++] = i;
    }
    // Minimum on the free entries with sum 1: A_ff z = b_f + nu 1.
    Eigen::Matrix<double,
                  Eigen::Dynamic,
                  Eigen::Dynamic,
                  0,
                  kMaxCandidates,
                  kMaxCandidates>
        A_free(m, m);
    Eigen::Matrix<double, Eigen::Dynamic, 2, 0, kMaxCandidates, 2> rhs(m, 2);
    for (int r = 0; r < m; ++r) {
      for (int c = 0; c < m; ++c) A_free(r, c) = A(index[r], index[c]);
      rhs(r, 0) = b[index[r]];
      rhs(r, 1) = 1;
    }
    const auto solved = A_free.llt().solve(rhs).eval();
    const double nu = (1 - solved.col(0).sum()) / solved.col(1).sum();
    // Go there, or to the first bound on the way.
    double step = 1;
    int blocking = -1;
    for (int r = 0; r < m; ++r) {
      const double target = solved(r, 0) + nu * solved(r, 1);
      const double current = w[index[r]];
      if (target < 0 && current / (current - target) < step) {
        step = current / (current - target);
        blocking = index[r];
      }
    }
    for (int r = 0; r < m; ++r) {
      const double target = solved(r, 0) + nu * solved(r, 1);
      w[index[r]] += step * (target - w[index[r]]);
    }
    if (blocking >= 0) {
      w[blocking] = 0;
      free[blocking] = false;
      continue;
    }
    // Optimal unless letting go of a bound lowers the cost.
    int entering = -1;
    double most_negative = -1e-9 * scale;
    for (int i = 0; i < n; ++i) {
      if (free[i]) continue;
      const double multiplier = (A.row(i).head(n).dot(w.head(n)) - b[i]) - nu;
      if (multiplier < most_negative) {
        most_negative = multiplier;
        entering = i;
      }
    }
    if (entering < 0) break;
    free[entering] = true;
  }
  w = w.cwiseMax(0);
  return w / w.sum();
}

// ---------------------------------------------------------------------------
// The fit

// The problem of one vertex: the squared error of weights w over all poses is
// w^T H w, since they sum to 1.
struct VertexProblem {
  Candidates candidates;
  Matrix6 H = Matrix6::Zero();
};

void AccumulatePose(const BoneMotions& motions,
                    const Eigen::Vector3d& rest,
                    const Eigen::Vector3d& target,
                    VertexProblem* problem) {
  const int n = problem->candidates.count;
  Eigen::Matrix<double, 3, kMaxCandidates> error;
  for (int i = 0; i < n; ++i) {
    const RigidMotion& motion = motions[problem->candidates.joint[i]];
    error.col(i) = motion.rotation * rest + motion.translation - target;
  }
  problem->H.topLeftCorner(n, n).noalias() +=
      error.leftCols(n).transpose() * error.leftCols(n);
}

// Vertices that share an edge, ascending.
std::vector<std::vector<int>> EdgeNeighbours(const std::vector<Quad>& quads,
                                             int num_vertices) {
  std::vector<std::vector<int>> neighbours(num_vertices);
  for (const Quad& quad : quads) {
    for (int i = 0; i < 4; ++i) {
      const int a = quad[i];
      const int b = quad[(i + 1) % 4];
      neighbours[a].push_back(b);
      neighbours[b].push_back(a);
    }
  }
  for (std::vector<int>& list : neighbours) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return neighbours;
}

JointWeights Spread(const Candidates& candidates, const Vector6& w) {
  JointWeights weights{};
  for (int i = 0; i < candidates.count; ++i) {
    weights[candidates.joint[i]] = w[i];
  }
  return weights;
}

JointWeights Mirrored(const JointWeights& weights) {
  JointWeights mirrored{};
  for (int j = 0; j < kNumJoints; ++j) mirrored[MirrorJoint(j)] = weights[j];
  return mirrored;
}

JointWeights Mean(const std::vector<JointWeights>& all,
                  const std::vector<int>& vertices) {
  JointWeights mean{};
  for (const int v : vertices) {
    for (int j = 0; j < kNumJoints; ++j) mean[j] += all[v][j];
  }
  for (double& w : mean) w /= std::max<std::size_t>(1, vertices.size());
  return mean;
}

// Weights of one vertex that follow the poses and, with `smoothness` (square
// metres over all poses), the wanted weights. `allowed` limits the joints.
JointWeights SolveVertex(const VertexProblem& problem,
                         const JointWeights& wanted,
                         double smoothness,
                         const std::array<bool, kNumJoints>& allowed) {
  VertexProblem part;
  std::array<int, kMaxCandidates> source{};
  for (int i = 0; i < problem.candidates.count; ++i) {
    if (!allowed[problem.candidates.joint[i]]) continue;
    source[part.candidates.count] = i;
    part.candidates.joint[part.candidates.count++] =
        problem.candidates.joint[i];
  }
  const int n = part.candidates.count;
  CHECK_GT(n, 0);
  Vector6 b = Vector6::Zero();
  for (int r = 0; r < n; ++r) {
    for (int c = 0; c < n; ++c) part.H(r, c) = problem.H(source[r], source[c]);
    b[r] = smoothness * wanted[part.candidates.joint[r]];
    part.H(r, r) += smoothness;
  }
  return Spread(part.candidates, SolveOnSimplex(part.H, b, n));
}

// The joints to keep: at most four, heaviest first. On the plane of symmetry
// joints of both sides are kept or dropped together.
std::array<bool, kNumJoints> JointsToKeep(const JointWeights& weights,
                                          bool on_symmetry_plane) {
  std::vector<int> order(kNumJoints);
  for (int j = 0; j < kNumJoints; ++j) order[j] = j;
  std::stable_sort(order.begin(), order.end(), [&weights](int a, int b) {
    return weights[a] > weights[b];
  });
  std::array<bool, kNumJoints> keep{};
  int num_kept = 0;
  for (const int joint : order) {
    if (weights[joint] < kNegligibleWeight || keep[joint]) continue;
    const int partner = on_symmetry_plane ? MirrorJoint(joint) : joint;
    const int cost = partner == joint ? 1 : 2;
    if (num_kept + cost > kMaxInfluences) continue;
    keep[joint] = keep[partner] = true;
    num_kept += cost;
  }
  return keep;
}

void Symmetrise(JointWeights* weights) {
  const JointWeights mirrored = Mirrored(*weights);
  for (int j = 0; j < kNumJoints; ++j) {
    (*weights)[j] = 0.5 * ((*weights)[j] + mirrored[j]);
  }
}

// The four heaviest, heaviest first, summing to 1.
void Pack(const JointWeights& weights,
          std::array<int, 4>* joint,
          std::array<double, 4>* weight) {
  std::vector<int> order;
  for (int j = 0; j < kNumJoints; ++j) {
    if (weights[j] >= kNegligibleWeight) order.push_back(j);
  }
  std::stable_sort(order.begin(), order.end(), [&weights](int a, int b) {
    return weights[a] > weights[b];
  });
  CHECK(!order.empty());
  order.resize(std::min<std::size_t>(order.size(), kMaxInfluences));
  double sum = 0;
  for (const int j : order) sum += weights[j];
  joint->fill(0);
  weight->fill(0);
  for (std::size_t i = 0; i < order.size(); ++i) {
    (*joint)[i] = order[i];
    (*weight)[i] = weights[order[i]] / sum;
  }
}

// True when the body at rest is its own mirror image.
bool IsMirrorSymmetric(const Body& body,
                       const std::vector<Eigen::Vector3d>& rest) {
  if (body.topology.mirror_vertex.size() != rest.size()) return false;
  const JointFrames frames = RestFrames(body.skeleton);
  const auto mirrored = [](Eigen::Vector3d p) {
    p.x() *= -1;
    return p;
  };
  for (int j = 0; j < kNumJoints; ++j) {
    const Eigen::Vector3d other =
        mirrored(frames.joint_in_world[MirrorJoint(j)]);
    if ((frames.joint_in_world[j] - other).norm() > kSymmetryTolerance) {
      return false;
    }
  }
  for (std::size_t v = 0; v < rest.size(); ++v) {
    const Eigen::Vector3d other =
        mirrored(rest[body.topology.mirror_vertex[v]]);
    if ((rest[v] - other).norm() > kSymmetryTolerance) return false;
  }
  return true;
}

Eigen::Vector3d Skin(const BoneMotions& motions,
                     const std::array<int, 4>& joint,
                     const std::array<double, 4>& weight,
                     const Eigen::Vector3d& rest) {
  Eigen::Vector3d posed = Eigen::Vector3d::Zero();
  for (int i = 0; i < kMaxInfluences; ++i) {
    if (weight[i] == 0) continue;
    const RigidMotion& motion = motions[joint[i]];
    posed += weight[i] * (motion.rotation * rest + motion.translation);
  }
  return posed;
}

// Fits the weights of all vertices; see FitSkinWeights.
class SkinWeightFitter {
 public:
  SkinWeightFitter(const Body& body, int num_poses, unsigned seed)
      : body_(body),
        rest_(RestVertices(body)),
        neighbours_(EdgeNeighbours(body.topology.quads, body.num_vertices())),
        symmetric_(IsMirrorSymmetric(body, rest_)) {
    for (const Pose& pose : SamplePoses(body.skeleton, num_poses, seed)) {
      motions_.push_back(MotionsFromRest(body.skeleton, pose));
      targets_.push_back(PoseVertices(body, pose));
    }
    const double error = kSmoothnessShare * body.stature;
    smoothness_ = motions_.size() * error * error;
  }

  SkinFit Fit() {
    BuildProblems();
    SolveAll(/*share_of_smoothness=*/0.01);
    for (int pass = 0; pass < kSmoothingPasses; ++pass) {
      SolveAll(/*share_of_smoothness=*/1);
    }
    KeepHeaviest();
    SkinFit fit;
    fit.weights.joint.resize(rest_.size());
    fit.weights.weight.resize(rest_.size());
    for (std::size_t v = 0; v < rest_.size(); ++v) {
      Pack(weights_[v], &fit.weights.joint[v], &fit.weights.weight[v]);
    }
    Measure(&fit);
    return fit;
  }

 private:
  int num_vertices() const { return static_cast<int>(rest_.size()); }

  // The vertex whose solution, mirrored, is that of vertex v.
  int Source(int v) const {
    return symmetric_ ? std::min(v, body_.topology.mirror_vertex[v]) : v;
  }
  bool OnSymmetryPlane(int v) const {
    return symmetric_ && body_.topology.mirror_vertex[v] == v;
  }

  void BuildProblems() {
    problems_.resize(rest_.size());
    weights_.assign(rest_.size(), JointWeights{});
    for (int v = 0; v < num_vertices(); ++v) {
      VertexProblem& problem = problems_[v];
      problem.candidates = FindCandidates(body_, v);
      for (std::size_t p = 0; p < motions_.size(); ++p) {
        AccumulatePose(motions_[p], rest_[v], targets_[p][v], &problem);
      }
      // The first wish: nothing known, all candidates alike.
      for (int i = 0; i < problem.candidates.count; ++i) {
        weights_[v][problem.candidates.joint[i]] =
            1.0 / problem.candidates.count;
      }
    }
  }

  // Applies `solve` to one vertex of each mirrored pair and copies the result.
  template <typename Solve>
  void ForEachVertex(const Solve& solve) {
    std::vector<JointWeights> next(weights_.size());
    for (int v = 0; v < num_vertices(); ++v) {
      if (Source(v) != v) {
        next[v] = Mirrored(next[Source(v)]);
        continue;
      }
      next[v] = solve(v);
      if (OnSymmetryPlane(v)) Symmetrise(&next[v]);
    }
    weights_ = std::move(next);
  }

  void SolveAll(double share_of_smoothness) {
    std::array<bool, kNumJoints> all;
    all.fill(true);
    ForEachVertex([&](int v) {
      return SolveVertex(problems_[v],
                         Mean(weights_, neighbours_[v]),
                         share_of_smoothness * smoothness_,
                         all);
    });
  }

  void KeepHeaviest() {
    ForEachVertex([&](int v) {
      return SolveVertex(problems_[v],
                         weights_[v],
                         smoothness_,
                         JointsToKeep(weights_[v], OnSymmetryPlane(v)));
    });
  }

  void Measure(SkinFit* fit) const {
    double sum = 0;
    for (std::size_t p = 0; p < motions_.size(); ++p) {
      for (std::size_t v = 0; v < rest_.size(); ++v) {
        const double error = (Skin(motions_[p],
                                   fit->weights.joint[v],
                                   fit->weights.weight[v],
                                   rest_[v]) -
                              targets_[p][v])
                                 .norm();
        sum += error * error;
        fit->max = std::max(fit->max, error);
      }
    }
    const double count =
        std::max<double>(1,
                         static_cast<double>(motions_.size()) *
                             static_cast<double>(rest_.size()));
    fit->rms = std::sqrt(sum / count);
  }

  const Body& body_;
  const std::vector<Eigen::Vector3d> rest_;
  const std::vector<std::vector<int>> neighbours_;
  const bool symmetric_;
  std::vector<BoneMotions> motions_;                   // per pose
  std::vector<std::vector<Eigen::Vector3d>> targets_;  // per pose, vertex
  double smoothness_ = 0;
  std::vector<VertexProblem> problems_;
  std::vector<JointWeights> weights_;
};

}  // namespace

SkinFit FitSkinWeights(const Body& body, int num_poses, unsigned seed) {
  CHECK_GT(num_poses, 0);
  return SkinWeightFitter(body, num_poses, seed).Fit();
}

std::vector<Eigen::Vector3d> PoseVerticesLbs(const Body& body,
                                             const SkinWeights& weights,
                                             const Pose& pose) {
  const std::vector<Eigen::Vector3d> rest = RestVertices(body);
  CHECK_EQ(weights.joint.size(), rest.size());
  CHECK_EQ(weights.weight.size(), rest.size());
  const BoneMotions motions = MotionsFromRest(body.skeleton, pose);
  std::vector<Eigen::Vector3d> posed(rest.size());
  for (std::size_t v = 0; v < rest.size(); ++v) {
    posed[v] = Skin(motions, weights.joint[v], weights.weight[v], rest[v]);
  }
  return posed;
}

}  // namespace sweepfit
