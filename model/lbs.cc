// SPDX-License-Identifier: Apache-2.0
#include "model/lbs.h"

#include <glog/logging.h>
#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "model/joint_limits.h"
#include "model/vertex_neighbours.h"

namespace sweepfit {
namespace {

constexpr int kMaxCandidates = 16;
// Joints and helpers.
constexpr int kMaxSkinJoints = 96;
constexpr int kMaxInfluences = 4;
// Weights below this are noise: a tenth of a metre of relative motion would
// show a tenth of a millimetre.
constexpr double kNegligibleWeight = 1e-3;
// Neighbours whose weights differ by 1 are as bad as this share of the stature
// of position error in every pose.
constexpr double kSmoothnessShare = 0.01;
constexpr int kSmoothingPasses = 4;
// Passes in which larger errors count more.
constexpr int kReweightings = 3;
// Squared errors below this all count alike, square metres.
constexpr double kErrorFloor = 1e-6;
// Left and right count as mirror images below this, metres.
constexpr double kSymmetryTolerance = 1e-6;

using CandidateVector = Eigen::Matrix<double, kMaxCandidates, 1>;
using CandidateMatrix = Eigen::Matrix<double, kMaxCandidates, kMaxCandidates>;
using JointWeights = std::array<double, kMaxSkinJoints>;
using JointSet = std::array<bool, kMaxSkinJoints>;

// ---------------------------------------------------------------------------
// Sampled poses

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

// Postures within the joint limits, in mirrored pairs: a third with one joint
// at a limit, the others random. The root stays: blending with weights that sum
// to 1 commutes with rigid motion of the whole body.
std::vector<Pose> SamplePoses(const Skeleton& skeleton,
                              int num_poses,
                              unsigned seed) {
  const JointLimits limits(skeleton);
  const int num_pairs = std::max(1, (num_poses + 1) / 2);
  const int num_single = num_pairs / 3;
  std::vector<Pose> chosen = limits.RandomPoses(num_pairs - num_single, seed);
  const std::vector<Pose> single = limits.LimitPoses();
  for (int i = 0; i < num_single; ++i) {
    chosen.push_back(single[i * single.size() / num_single]);
  }
  std::vector<Pose> poses;
  for (const Pose& pose : chosen) {
    poses.push_back(pose);
    poses.push_back(MirrorPose(pose));
  }
  return poses;
}

// ---------------------------------------------------------------------------
// Candidates

// The joints that may move one vertex, most plausible first.
struct Candidates {
  int count = 0;
  std::array<int, kMaxCandidates> joint{};
};

bool HasChildren(int joint) {
  for (int child = joint + 1; child < kNumJoints; ++child) {
    if (kJointParents[child] == joint) return true;
  }
  return false;
}

// A joint turns the bone that starts there, so bone k of a chain belongs to
// chain[k]; its neighbours in the chain and the parent of the chain matter
// where bones meet and where twist is spread. Helpers matter near their
// section, those that blend sweeps to vertices that do.
Candidates FindCandidates(const Body& body,
                          const std::vector<HelperJoint>& helpers,
                          int vertex) {
  // Parameters of distance that halve the score.
  constexpr double kNear = 0.1;
  // Beyond so many parameters a joint does not matter.
  constexpr double kReach = 1.2;
  // A helper that rides on skin matters only near it.
  constexpr double kSkinReach = 0.6;
  JointWeights score{};
  const auto& attachments = body.binding[vertex].attachment;
  for (const SweepAttachment& attachment : attachments) {
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
      if (distance > kReach) continue;
      score[joint] += attachment.weight / (kNear + distance);
    }
  }
  for (std::size_t h = 0; h < helpers.size(); ++h) {
    const double reach = helpers[h].skin.empty() ? kReach : kSkinReach;
    double lowest = 1e9;
    for (const HelperJoint::Source& source : helpers[h].sources) {
      double here = 0;
      for (const SweepAttachment& attachment : attachments) {
        if (attachment.sweep != source.sweep || attachment.weight <= 0) {
          continue;
        }
        const double distance = helpers[h].sources.size() > 1
                                    ? 0
                                    : std::abs(attachment.u - source.u);
        if (distance <= reach) here += attachment.weight / (kNear + distance);
      }
      lowest = std::min(lowest, here);
    }
    score[kNumJoints + h] = lowest;
  }
  std::vector<int> order;
  for (int j = 0; j < kMaxSkinJoints; ++j) {
    if (score[j] > 0) order.push_back(j);
  }
  std::stable_sort(order.begin(), order.end(), [&score](int a, int b) {
    return score[a] > score[b];
  });
  if (order.empty()) order.push_back(kRoot);  // loose ends
  Candidates candidates;
  candidates.count =
      static_cast<int>(std::min<std::size_t>(kMaxCandidates, order.size()));
  std::copy_n(order.begin(), candidates.count, candidates.joint.begin());
  return candidates;
}

// ---------------------------------------------------------------------------
// Least squares on the simplex

// Minimises w^T A w / 2 - b^T w subject to sum w = 1, w >= 0 over the first n
// entries, by a primal active-set method; A symmetric positive definite.
CandidateVector SolveOnSimplex(const CandidateMatrix& A,
                               const CandidateVector& b,
                               int n) {
  CandidateVector w = CandidateVector::Zero();
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
  CandidateMatrix H = CandidateMatrix::Zero();
};

JointWeights Spread(const Candidates& candidates, const CandidateVector& w) {
  JointWeights weights{};
  for (int i = 0; i < candidates.count; ++i) {
    weights[candidates.joint[i]] = w[i];
  }
  return weights;
}

// The joint or helper on the other side, per joint.
std::array<int, kMaxSkinJoints> MirrorTable(
    const std::vector<HelperJoint>& helpers) {
  std::array<int, kMaxSkinJoints> mirror{};
  for (int j = 0; j < kMaxSkinJoints; ++j) mirror[j] = j;
  for (int j = 0; j < kNumJoints; ++j) mirror[j] = MirrorJoint(j);
  for (std::size_t h = 0; h < helpers.size(); ++h) {
    std::string other = helpers[h].name;
    if (other.starts_with("l_")) {
      other[0] = 'r';
    } else if (other.starts_with("r_")) {
      other[0] = 'l';
    } else if (other.ends_with("_left")) {
      other.replace(other.size() - 4, 4, "right");
    } else if (other.ends_with("_right")) {
      other.replace(other.size() - 5, 5, "left");
    }
    for (std::size_t k = 0; k < helpers.size(); ++k) {
      if (helpers[k].name == other) {
        mirror[kNumJoints + h] = kNumJoints + static_cast<int>(k);
      }
    }
  }
  return mirror;
}

JointWeights Mirrored(const JointWeights& weights,
                      const std::array<int, kMaxSkinJoints>& mirror) {
  JointWeights mirrored{};
  for (int j = 0; j < kMaxSkinJoints; ++j) mirrored[mirror[j]] = weights[j];
  return mirrored;
}

JointWeights Mean(const std::vector<JointWeights>& all,
                  const std::vector<int>& vertices) {
  JointWeights mean{};
  for (const int v : vertices) {
    for (int j = 0; j < kMaxSkinJoints; ++j) mean[j] += all[v][j];
  }
  for (double& w : mean) w /= std::max<std::size_t>(1, vertices.size());
  return mean;
}

// Weights of one vertex that follow the poses and, with `smoothness` (square
// metres over all poses), the wanted weights. `allowed` limits the joints.
JointWeights SolveVertex(const VertexProblem& problem,
                         const JointWeights& wanted,
                         double smoothness,
                         const JointSet& allowed) {
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
  CandidateVector b = CandidateVector::Zero();
  for (int r = 0; r < n; ++r) {
    for (int c = 0; c < n; ++c) part.H(r, c) = problem.H(source[r], source[c]);
    b[r] = smoothness * wanted[part.candidates.joint[r]];
    part.H(r, r) += smoothness;
  }
  return Spread(part.candidates, SolveOnSimplex(part.H, b, n));
}

double CostOfWeights(const VertexProblem& problem,
                     const JointWeights& weights,
                     const JointWeights& wanted,
                     double smoothness) {
  CandidateVector w = CandidateVector::Zero();
  double from_wanted = 0;
  for (int i = 0; i < problem.candidates.count; ++i) {
    const int joint = problem.candidates.joint[i];
    w[i] = weights[joint];
    from_wanted += (w[i] - wanted[joint]) * (w[i] - wanted[joint]);
  }
  return w.dot(problem.H * w) + smoothness * from_wanted;
}

// Leaves the present joints of a vertex but drops them one after the other,
// that whose loss costs least first, until `most` are left. On the plane of
// symmetry joints of both sides are kept or dropped together.
JointSet JointsToKeep(const VertexProblem& problem,
                      const JointWeights& weights,
                      const JointWeights& wanted,
                      double smoothness,
                      int most,
                      bool on_symmetry_plane,
                      const std::array<int, kMaxSkinJoints>& mirror) {
  // Of more than so many the lightest go unseen.
  constexpr int kMostTried = 7;
  std::vector<int> present;  // heaviest first
  for (int j = 0; j < kMaxSkinJoints; ++j) {
    if (weights[j] >= kNegligibleWeight) present.push_back(j);
  }
  std::stable_sort(present.begin(), present.end(), [&weights](int a, int b) {
    return weights[a] > weights[b];
  });
  if (present.size() > kMostTried) present.resize(kMostTried);
  const auto without = [&](int joint) {
    std::vector<int> rest;
    for (const int j : present) {
      if (j == joint || (on_symmetry_plane && j == mirror[joint])) continue;
      rest.push_back(j);
    }
    return rest;
  };
  const auto as_set = [](const std::vector<int>& joints) {
    JointSet set{};
    for (const int j : joints) set[j] = true;
    return set;
  };
  while (static_cast<int>(present.size()) > most) {
    double lowest = std::numeric_limits<double>::infinity();
    std::vector<int> best;
    for (const int joint : present) {
      const std::vector<int> rest = without(joint);
      if (rest.empty()) continue;
      const double cost =
          CostOfWeights(problem,
                        SolveVertex(problem, wanted, smoothness, as_set(rest)),
                        wanted,
                        smoothness);
      if (cost < lowest) {
        lowest = cost;
        best = rest;
      }
    }
    present = best;
  }
  return as_set(present);
}

// The four heaviest, heaviest first, summing to 1.
void Pack(const JointWeights& weights,
          std::array<int, 4>* joint,
          std::array<double, 4>* weight) {
  std::vector<int> order;
  for (int j = 0; j < kMaxSkinJoints; ++j) {
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

Eigen::Vector3d Skin(const std::vector<RigidMotion>& motions,
                     const std::array<int, 4>& joint,
                     const std::array<double, 4>& weight,
                     const Eigen::Vector3d& rest) {
  Eigen::Vector3d posed = Eigen::Vector3d::Zero();
  for (int i = 0; i < kMaxInfluences; ++i) {
    if (weight[i] == 0) continue;
    posed += weight[i] * (motions[joint[i]] * rest);
  }
  return posed;
}

// Fits the weights of all vertices; see FitSkinWeights.
class SkinWeightFitter {
 public:
  SkinWeightFitter(const Body& body,
                   const std::vector<HelperJoint>& helpers,
                   int num_poses,
                   unsigned seed)
      : body_(body),
        helpers_(helpers),
        mirror_(MirrorTable(helpers)),
        rest_(RestVertices(body)),
        neighbours_(VertexNeighbours(body.topology.quads, body.num_vertices())),
        symmetric_(IsMirrorSymmetric(body, rest_)) {
    CHECK_LE(kNumJoints + helpers.size(), std::size_t{kMaxSkinJoints});
    const BodyDeformer deformer(body);
    const JointMotions motions(body, helpers_);
    const std::vector<Pose> poses = SamplePoses(body.skeleton, num_poses, seed);
    motions_.resize(poses.size());
    targets_.resize(poses.size());
    tbb::parallel_for(std::size_t{0}, poses.size(), [&](std::size_t p) {
      motions_[p] = motions.At(poses[p]);
      targets_[p] = deformer.Vertices(poses[p]);
    });
    const double error = kSmoothnessShare * body.stature;
    smoothness_ = motions_.size() * error * error;
  }

  SkinFit Fit() {
    problems_.resize(rest_.size());
    errors_.resize(rest_.size());
    importance_.assign(rest_.size(), std::vector<double>(motions_.size(), 1));
    weights_.assign(rest_.size(), JointWeights{});
    for (int v = 0; v < num_vertices(); ++v) {
      problems_[v].candidates = FindCandidates(body_, helpers_, v);
      // The first wish: nothing known, all candidates alike.
      const Candidates& candidates = problems_[v].candidates;
      for (int i = 0; i < candidates.count; ++i) {
        weights_[v][candidates.joint[i]] = 1.0 / candidates.count;
      }
    }
    Accumulate(/*by_error=*/false);
    Solve(/*share_of_smoothness=*/0.01, kMaxCandidates);
    for (int pass = 0; pass < kReweightings; ++pass) {
      Accumulate(/*by_error=*/true);
      Solve(/*share_of_smoothness=*/1, kMaxCandidates);
    }
    for (int pass = 0; pass < kSmoothingPasses; ++pass) {
      Solve(/*share_of_smoothness=*/1, kMaxCandidates);
    }
    for (int most = kMaxInfluences + 2; most >= kMaxInfluences; --most) {
      Solve(/*share_of_smoothness=*/1, most);
    }
    for (int pass = 0; pass < kReweightings; ++pass) {
      Accumulate(/*by_error=*/true);
      Solve(/*share_of_smoothness=*/1, kMaxInfluences);
    }
    SkinFit fit;
    fit.weights.helpers = helpers_;
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

  // Sums the squared errors over all poses. `by_error`: first the importance of
  // every pose goes half the way (of the logarithm) to the squared error of the
  // present weights; the full way would swing to and fro.
  void Accumulate(bool by_error) {
    tbb::parallel_for(0, num_vertices(), [&](int v) {
      if (Source(v) == v) AccumulateVertex(v, by_error);
    });
  }

  void AccumulateVertex(int v, bool by_error) {
    VertexProblem& problem = problems_[v];
    const int n = problem.candidates.count;
    const auto num_poses = static_cast<Eigen::Index>(motions_.size());
    std::vector<double>& importance = importance_[v];
    Eigen::MatrixXf errors = ErrorsOfVertex(v);
    if (by_error) {
      Eigen::VectorXf w(n);
      for (int i = 0; i < n; ++i) {
        w[i] = static_cast<float>(weights_[v][problem.candidates.joint[i]]);
      }
      const Eigen::VectorXf present = errors * w;
      for (Eigen::Index p = 0; p < num_poses; ++p) {
        const double squared = present.segment<3>(3 * p).squaredNorm();
        importance[p] = std::sqrt(importance[p] * (squared + kErrorFloor));
      }
    }
    double mean = 0;
    for (const double i : importance) {
      mean += i / static_cast<double>(num_poses);
    }
    for (Eigen::Index p = 0; p < num_poses; ++p) {
      errors.middleRows<3>(3 * p) *=
          static_cast<float>(std::sqrt(importance[p] / mean));
    }
    problem.H.setZero();
    problem.H.topLeftCorner(n, n) =
        (errors.transpose() * errors).eval().cast<double>();
  }

  // Where each candidate alone would put the vertex, from where it should be,
  // metres; three rows a pose. Kept from the first time on.
  const Eigen::MatrixXf& ErrorsOfVertex(int v) {
    Eigen::MatrixXf& errors = errors_[v];
    if (errors.size() > 0) return errors;
    const Candidates& candidates = problems_[v].candidates;
    const auto num_poses = static_cast<Eigen::Index>(motions_.size());
    errors.resize(3 * num_poses, candidates.count);
    for (int i = 0; i < candidates.count; ++i) {
      for (Eigen::Index p = 0; p < num_poses; ++p) {
        const Eigen::Vector3d error =
            motions_[p][candidates.joint[i]] * rest_[v] - targets_[p][v];
        errors.block<3, 1>(3 * p, i) = error.cast<float>();
      }
    }
    return errors;
  }

  // Solves one vertex of each mirrored pair, with the mean of its neighbours
  // as wish, for at most `most` of its present joints, and copies the result.
  void Solve(double share_of_smoothness, int most) {
    std::vector<JointWeights> next(weights_.size());
    tbb::parallel_for(0, num_vertices(), [&](int v) {
      if (Source(v) != v) return;
      const JointWeights wanted = Mean(weights_, neighbours_[v]);
      const double smoothness = share_of_smoothness * smoothness_;
      JointSet allowed;
      allowed.fill(true);
      if (most < kMaxCandidates) {
        allowed = JointsToKeep(problems_[v],
                               weights_[v],
                               wanted,
                               smoothness,
                               most,
                               OnSymmetryPlane(v),
                               mirror_);
      }
      next[v] = SolveVertex(problems_[v], wanted, smoothness, allowed);
      if (OnSymmetryPlane(v)) {
        const JointWeights mirrored = Mirrored(next[v], mirror_);
        for (int j = 0; j < kMaxSkinJoints; ++j) {
          next[v][j] = 0.5 * (next[v][j] + mirrored[j]);
        }
      }
    });
    for (int v = 0; v < num_vertices(); ++v) {
      if (Source(v) != v) next[v] = Mirrored(next[Source(v)], mirror_);
    }
    weights_ = std::move(next);
  }

  void Measure(SkinFit* fit) const {
    double sum = 0;
    for (std::size_t p = 0; p < motions_.size(); ++p) {
      const std::vector<Eigen::Vector3d> skinned =
          SkinVertices(rest_, fit->weights, motions_[p]);
      for (std::size_t v = 0; v < rest_.size(); ++v) {
        const double error = (skinned[v] - targets_[p][v]).norm();
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
  const std::vector<HelperJoint> helpers_;
  const std::array<int, kMaxSkinJoints> mirror_;
  const std::vector<Eigen::Vector3d> rest_;
  const std::vector<std::vector<int>> neighbours_;
  const bool symmetric_;
  std::vector<std::vector<RigidMotion>> motions_;      // per pose
  std::vector<std::vector<Eigen::Vector3d>> targets_;  // per pose, vertex
  double smoothness_ = 0;
  std::vector<VertexProblem> problems_;
  std::vector<Eigen::MatrixXf> errors_;          // per vertex
  std::vector<std::vector<double>> importance_;  // per vertex and pose
  std::vector<JointWeights> weights_;
};

void CheckSizes(const SkinWeights& weights, std::size_t num_vertices) {
  CHECK_EQ(weights.joint.size(), num_vertices);
  CHECK_EQ(weights.weight.size(), num_vertices);
}

}  // namespace

SkinFit FitSkinWeights(const Body& body,
                       int num_poses,
                       unsigned seed,
                       bool with_helpers) {
  CHECK_GT(num_poses, 0);
  return SkinWeightFitter(
             body,
             with_helpers ? MakeHelperJoints(body) : std::vector<HelperJoint>(),
             num_poses,
             seed)
      .Fit();
}

std::vector<Eigen::Vector3d> SkinVertices(
    const std::vector<Eigen::Vector3d>& rest_vertices,
    const SkinWeights& weights,
    const std::vector<RigidMotion>& motions) {
  CheckSizes(weights, rest_vertices.size());
  std::vector<Eigen::Vector3d> posed(rest_vertices.size());
  for (std::size_t v = 0; v < rest_vertices.size(); ++v) {
    posed[v] =
        Skin(motions, weights.joint[v], weights.weight[v], rest_vertices[v]);
  }
  return posed;
}

std::vector<Eigen::Vector3d> PoseVerticesLbs(const Body& body,
                                             const SkinWeights& weights,
                                             const Pose& pose) {
  return SkinVertices(RestVertices(body),
                      weights,
                      JointMotions(body, weights.helpers).At(pose));
}

std::vector<Eigen::Vector3d> PoseVerticesDualQuaternion(
    const Body& body, const SkinWeights& weights, const Pose& pose) {
  std::vector<Eigen::Vector3d> vertices = RestVertices(body);
  CheckSizes(weights, vertices.size());
  const std::vector<RigidMotion> motions =
      JointMotions(body, weights.helpers).At(pose);
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    MotionBlend blend;
    for (int i = 0; i < kMaxInfluences; ++i) {
      if (weights.weight[v][i] == 0) continue;
      blend.Add(weights.weight[v][i], motions[weights.joint[v][i]]);
    }
    vertices[v] = blend.Normalized() * vertices[v];
  }
  return vertices;
}

}  // namespace sweepfit
