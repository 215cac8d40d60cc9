// SPDX-License-Identifier: Apache-2.0
// Fits the weights of linear blend skinning to the sweeps; see lbs.h.
#include <glog/logging.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "model/joint_limits.h"
#include "model/lbs.h"
#include "model/simplex.h"
#include "model/skin_candidates.h"
#include "model/skin_samples.h"
#include "model/vertex_neighbours.h"

namespace sweepfit {
namespace {

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
constexpr float kErrorFloor = 1e-6F;
// Left and right count as mirror images below this, metres.
constexpr double kSymmetryTolerance = 1e-6;

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

// The problem of one vertex: the squared error of weights w over all poses is
// w^T H w, since they sum to 1.
struct VertexProblem {
  SkinCandidates candidates;
  SimplexMatrix H;
  SimplexVector weight{};  // at present, per candidate
  // On the plane of symmetry: the candidate on the other side.
  std::array<int, kMaxSimplexSize> partner{};
};

// Index of a joint among the candidates, -1 if it is none.
int Find(const SkinCandidates& candidates, int joint) {
  const int* const begin = candidates.joint.data();
  const int* const end = begin + candidates.count;
  const int* const found = std::find(begin, end, joint);
  return found == end ? -1 : static_cast<int>(found - begin);
}

// Keeps the candidates that are wanted, in their order.
void Keep(const SimplexSet& wanted, VertexProblem* problem) {
  SkinCandidates kept;
  SimplexVector weight{};
  for (int i = 0; i < problem->candidates.count; ++i) {
    if (!wanted[i]) continue;
    weight[kept.count] = problem->weight[i];
    kept.joint[kept.count++] = problem->candidates.joint[i];
  }
  problem->candidates = kept;
  problem->weight = weight;
}

// Leaves the present joints of a vertex but drops them one after the other,
// that whose loss costs least first, until `most` are left. On the plane of
// symmetry joints of both sides are kept or dropped together. Returns the best
// weights, those of dropped joints 0.
SimplexVector SolveForFew(const VertexProblem& problem,
                          double ridge,
                          const SimplexVector& b,
                          int most,
                          bool on_symmetry_plane) {
  // Of more than so many the lightest go unseen.
  constexpr std::size_t kMostTried = 7;
  const int n = problem.candidates.count;
  const SimplexVector& weight = problem.weight;
  std::vector<int> present;  // heaviest first
  for (int i = 0; i < n; ++i) {
    if (weight[i] >= kNegligibleWeight) present.push_back(i);
  }
  std::stable_sort(present.begin(), present.end(), [&weight](int a, int c) {
    return weight[a] > weight[c];
  });
  if (present.size() > kMostTried) present.resize(kMostTried);
  SimplexSet kept{};
  for (const int i : present) kept[i] = true;
  int count = static_cast<int>(present.size());
  SimplexVector best = weight;
  bool is_solved = false;
  while (count > most) {
    double lowest = std::numeric_limits<double>::infinity();
    SimplexSet best_kept{};
    SimplexVector best_weight{};
    for (const int i : present) {
      if (!kept[i]) continue;
      SimplexSet rest = kept;
      rest[i] = false;
      if (on_symmetry_plane) rest[problem.partner[i]] = false;
      if (rest == SimplexSet{}) continue;
      SimplexVector trial = best;
      const double cost = SolveOnSimplex(problem.H, ridge, b, n, rest, &trial);
      if (cost < lowest) {
        lowest = cost;
        best_kept = rest;
        best_weight = trial;
      }
    }
    kept = best_kept;
    best = best_weight;
    count = static_cast<int>(std::count(kept.begin(), kept.end(), true));
    is_solved = true;
  }
  if (!is_solved) SolveOnSimplex(problem.H, ridge, b, n, kept, &best);
  return best;
}

// The products of all pairs of rows, below the diagonal. Rows follow each other
// in memory; their number is filled up with zeros to an even one, `size` is a
// multiple of four.
void MultiplyRows(const float* rows, int n, int size, SimplexMatrix* H) {
  using Four = Eigen::Array4f;
  const auto load = [](const float* at) { return Eigen::Map<const Four>(at); };
  for (int i = 0; i < n; i += 2) {
    for (int j = 0; j <= i; j += 2) {
      const float* a = rows + static_cast<std::ptrdiff_t>(i) * size;
      const float* b = rows + static_cast<std::ptrdiff_t>(j) * size;
      Four s00 = Four::Zero(), s01 = Four::Zero();
      Four s10 = Four::Zero(), s11 = Four::Zero();
      for (int k = 0; k < size; k += 4) {
        const Four b0 = load(b + k);
        const Four b1 = load(b + size + k);
        const Four a0 = load(a + k);
        s00 += a0 * b0;
        s01 += a0 * b1;
        const Four a1 = load(a + size + k);
        s10 += a1 * b0;
        s11 += a1 * b1;
      }
      (*H)[i][j] = s00.sum();
      (*H)[i][j + 1] = s01.sum();
      (*H)[i + 1][j] = s10.sum();
      (*H)[i + 1][j + 1] = s11.sum();
    }
  }
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
        samples_(body, helpers_, SamplePoses(body.skeleton, num_poses, seed)),
        neighbours_(VertexNeighbours(body.topology.quads, body.num_vertices())),
        symmetric_(IsMirrorSymmetric(body, samples_.rest())) {
    CHECK_LE(kNumJoints + helpers.size(), std::size_t{kMaxSkinJoints});
    const double error = kSmoothnessShare * body.stature;
    smoothness_ = samples_.num_poses() * error * error;
  }

  SkinFit Fit() {
    MakeProblems();
    Accumulate(/*by_error=*/false);
    Solve(/*share_of_smoothness=*/0.01, kMaxSimplexSize);
    for (int pass = 0; pass < kReweightings; ++pass) {
      DropIdle(/*keep_wanted=*/true);
      Accumulate(/*by_error=*/true);
      Solve(/*share_of_smoothness=*/1, kMaxSimplexSize);
    }
    for (int pass = 0; pass < kSmoothingPasses; ++pass) {
      Solve(/*share_of_smoothness=*/1, kMaxSimplexSize);
    }
    for (int most = kMaxInfluences + 2; most >= kMaxInfluences; --most) {
      Solve(/*share_of_smoothness=*/1, most);
    }
    for (int pass = 0; pass < kReweightings; ++pass) {
      DropIdle(/*keep_wanted=*/false);
      Accumulate(/*by_error=*/true);
      Solve(/*share_of_smoothness=*/1, kMaxInfluences);
    }
    return Pack();
  }

 private:
  int num_vertices() const { return static_cast<int>(problems_.size()); }

  // The vertex whose solution, mirrored, is that of vertex v.
  int Source(int v) const {
    return symmetric_ ? std::min(v, body_.topology.mirror_vertex[v]) : v;
  }
  bool OnSymmetryPlane(int v) const {
    return symmetric_ && body_.topology.mirror_vertex[v] == v;
  }

  // The first wish: nothing known, all candidates alike.
  void MakeProblems() {
    problems_.resize(samples_.rest().size());
    importance_.setOnes(samples_.size(), num_vertices());
    next_.resize(problems_.size());
    tbb::parallel_for(0, num_vertices(), [&](int v) {
      VertexProblem& problem = problems_[v];
      problem.candidates = FindSkinCandidates(body_, helpers_, Source(v));
      if (Source(v) != v) {
        for (int& joint : problem.candidates.joint) joint = mirror_[joint];
      }
      if (OnSymmetryPlane(v)) KeepPairs(&problem);
      const int n = problem.candidates.count;
      for (int i = 0; i < n; ++i) problem.weight[i] = 1.0 / n;
    });
  }

  // On the plane of symmetry a joint is no candidate without its partner.
  void KeepPairs(VertexProblem* problem) const {
    SimplexSet has_partner{};
    for (int i = 0; i < problem->candidates.count; ++i) {
      has_partner[i] =
          Find(problem->candidates, mirror_[problem->candidates.joint[i]]) >= 0;
    }
    if (has_partner != SimplexSet{}) Keep(has_partner, problem);
    FindPartners(problem);
  }

  void FindPartners(VertexProblem* problem) const {
    for (int i = 0; i < problem->candidates.count; ++i) {
      const int partner =
          Find(problem->candidates, mirror_[problem->candidates.joint[i]]);
      problem->partner[i] = partner < 0 ? i : partner;
    }
  }

  // The mean weights of the neighbours.
  SimplexVector Wanted(int v) const {
    std::array<double, kMaxSkinJoints> sum{};
    for (const int neighbour : neighbours_[v]) {
      const VertexProblem& other = problems_[neighbour];
      for (int i = 0; i < other.candidates.count; ++i) {
        sum[other.candidates.joint[i]] += other.weight[i];
      }
    }
    const SkinCandidates& candidates = problems_[v].candidates;
    const double count =
        static_cast<double>(std::max<std::size_t>(1, neighbours_[v].size()));
    SimplexVector wanted{};
    for (int i = 0; i < candidates.count; ++i) {
      wanted[i] = sum[candidates.joint[i]] / count;
    }
    return wanted;
  }

  // Candidates that neither the vertex nor, with `keep_wanted`, any of its
  // neighbours uses leave the problem.
  void DropIdle(bool keep_wanted) {
    std::vector<SimplexSet> kept(problems_.size());
    tbb::parallel_for(0, num_vertices(), [&](int v) {
      const VertexProblem& problem = problems_[v];
      const SimplexVector wanted =
          keep_wanted ? Wanted(Source(v)) : SimplexVector{};
      for (int i = 0; i < problem.candidates.count; ++i) {
        kept[v][i] = problem.weight[i] > 0 || wanted[i] > 0;
      }
    });
    tbb::parallel_for(0, num_vertices(), [&](int v) {
      Keep(kept[v], &problems_[v]);
      if (OnSymmetryPlane(v)) FindPartners(&problems_[v]);
    });
  }

  // Sums the squared errors over all poses. `by_error`: first the importance of
  // every pose goes half the way (of the logarithm) to the squared error of the
  // present weights; the full way would swing to and fro.
  void Accumulate(bool by_error) {
    tbb::parallel_for(tbb::blocked_range<int>(0, num_vertices(), 64),
                      [&](const tbb::blocked_range<int>& range) {
                        Eigen::ArrayXXf errors;
                        for (int v = range.begin(); v < range.end(); ++v) {
                          if (Source(v) != v) continue;
                          FindErrors(v, &errors);
                          if (by_error) UpdateImportance(v, errors);
                          AccumulateVertex(v, &errors);
                        }
                      });
  }

  // Where each candidate alone would put the vertex, from where it should be,
  // metres: a column per candidate, its axes one after the other. Columns of
  // zeros make their number even.
  void FindErrors(int v, Eigen::ArrayXXf* errors) const {
    const SkinCandidates& candidates = problems_[v].candidates;
    const int size = samples_.size();
    errors->resize(3 * size, kMaxSimplexSize);
    for (int i = 0; i < candidates.count; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        samples_.Errors(
            v, candidates.joint[i], axis, errors->col(i).data() + axis * size);
      }
    }
    if (candidates.count % 2 != 0) errors->col(candidates.count).setZero();
  }

  // Per pose, of the present weights.
  Eigen::ArrayXf SquaredErrors(int v, const Eigen::ArrayXXf& errors) const {
    const VertexProblem& problem = problems_[v];
    Eigen::ArrayXf present = Eigen::ArrayXf::Zero(errors.rows());
    for (int i = 0; i < problem.candidates.count; ++i) {
      if (problem.weight[i] == 0) continue;
      present += static_cast<float>(problem.weight[i]) * errors.col(i);
    }
    const int size = samples_.size();
    return present.head(size).square() + present.segment(size, size).square() +
           present.tail(size).square();
  }

  void UpdateImportance(int v, const Eigen::ArrayXXf& errors) {
    importance_.col(v) =
        (importance_.col(v) * (SquaredErrors(v, errors) + kErrorFloor)).sqrt();
  }

  // Weighs the errors by the importance of their poses.
  void AccumulateVertex(int v, Eigen::ArrayXXf* errors) {
    VertexProblem& problem = problems_[v];
    const int n = problem.candidates.count;
    const int size = samples_.size();
    const auto importance = importance_.col(v);
    const Eigen::ArrayXf scale =
        (importance / importance.head(samples_.num_poses()).mean()).sqrt();
    for (int i = 0; i < n; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        errors->col(i).segment(axis * size, size) *= scale;
      }
    }
    MultiplyRows(errors->data(), n, 3 * size, &problem.H);
    for (int i = 0; i < n; ++i) {
      for (int j = i + 1; j < n; ++j) problem.H[i][j] = problem.H[j][i];
    }
  }

  // Solves one vertex of each mirrored pair, with the mean of its neighbours
  // as wish, for at most `most` of its present joints, and copies the result.
  void Solve(double share_of_smoothness, int most) {
    const double smoothness = share_of_smoothness * smoothness_;
    SimplexSet all;
    all.fill(true);
    tbb::parallel_for(0, num_vertices(), [&](int v) {
      if (Source(v) != v) return;
      const VertexProblem& problem = problems_[v];
      const int n = problem.candidates.count;
      // |w - wanted|^2 without what does not depend on w.
      SimplexVector b = Wanted(v);
      for (double& entry : b) entry *= smoothness;
      if (most < kMaxSimplexSize) {
        next_[v] =
            SolveForFew(problem, smoothness, b, most, OnSymmetryPlane(v));
      } else {
        next_[v] = problem.weight;
        SolveOnSimplex(problem.H, smoothness, b, n, all, &next_[v]);
      }
      if (!OnSymmetryPlane(v)) return;
      const SimplexVector one_side = next_[v];
      for (int i = 0; i < n; ++i) {
        next_[v][i] = 0.5 * (one_side[i] + one_side[problem.partner[i]]);
      }
    });
    for (int v = 0; v < num_vertices(); ++v) {
      problems_[v].weight = next_[Source(v)];
    }
  }

  // Takes the heaviest joints, heaviest first, their sum 1, and measures.
  SkinFit Pack() {
    SkinFit fit;
    fit.weights.helpers = helpers_;
    fit.weights.joint.assign(problems_.size(), {});
    fit.weights.weight.assign(problems_.size(), {});
    std::vector<double> sums(problems_.size()), largest(problems_.size());
    tbb::parallel_for(
        tbb::blocked_range<int>(0, num_vertices(), 64),
        [&](const tbb::blocked_range<int>& range) {
          Eigen::ArrayXXf errors;
          for (int v = range.begin(); v < range.end(); ++v) {
            PackVertex(
                &problems_[v], &fit.weights.joint[v], &fit.weights.weight[v]);
            FindErrors(v, &errors);
            const Eigen::ArrayXf squared = SquaredErrors(v, errors);
            sums[v] = squared.sum();
            largest[v] = squared.maxCoeff();
          }
        });
    double sum = 0, max = 0;
    for (int v = 0; v < num_vertices(); ++v) {
      sum += sums[v];
      max = std::max(max, largest[v]);
    }
    const double count = std::max(
        1.0, static_cast<double>(samples_.num_poses()) * num_vertices());
    fit.rms = std::sqrt(sum / count);
    fit.max = std::sqrt(max);
    return fit;
  }

  static void PackVertex(VertexProblem* problem,
                         std::array<int, kMaxInfluences>* joint,
                         std::array<double, kMaxInfluences>* weight) {
    std::vector<std::pair<double, int>> order;
    for (int i = 0; i < problem->candidates.count; ++i) {
      if (problem->weight[i] < kNegligibleWeight) continue;
      order.emplace_back(-problem->weight[i], problem->candidates.joint[i]);
    }
    std::sort(order.begin(), order.end());
    CHECK(!order.empty());
    order.resize(std::min<std::size_t>(order.size(), kMaxInfluences));
    double sum = 0;
    for (const auto& [minus_weight, j] : order) sum -= minus_weight;
    problem->candidates.count = static_cast<int>(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
      (*joint)[i] = problem->candidates.joint[i] = order[i].second;
      (*weight)[i] = problem->weight[i] = -order[i].first / sum;
    }
  }

  const Body& body_;
  const std::vector<HelperJoint> helpers_;
  const std::array<int, kMaxSkinJoints> mirror_;
  const SkinSamples samples_;
  const std::vector<std::vector<int>> neighbours_;
  const bool symmetric_;
  double smoothness_ = 0;
  std::vector<VertexProblem> problems_;
  std::vector<SimplexVector> next_;
  Eigen::ArrayXXf importance_;  // per pose and vertex
};

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

}  // namespace sweepfit
