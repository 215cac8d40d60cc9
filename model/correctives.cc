// SPDX-License-Identifier: Apache-2.0
#include "model/correctives.h"

#include <glog/logging.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace sweepfit {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Principal components come from at most this many keys, evenly chosen.
constexpr int kMaxBasisKeys = 64;
// Skinning that flattens a vertex below this determinant cannot be corrected.
constexpr double kMinDeterminant = 0.02;

// Evaluates one clip's keys.
class ClipSkin {
 public:
  ClipSkin(const Body& body,
           const BodyDeformer& deformer,
           const SkinWeights& weights)
      : weights_(weights),
        deformer_(deformer),
        motions_(body, weights.helpers, deformer_),
        num_(body.num_vertices()) {}

  int num_vertices() const { return num_; }

  void Set(const Pose& pose) {
    wanted_ = deformer_.Vertices(pose);
    const std::vector<RigidMotion> motions = motions_.At(pose, wanted_);
    skinned_ = SkinVertices(deformer_.rest_vertices(), weights_, motions);
    linear_.resize(num_);
    for (int v = 0; v < num_; ++v) {
      linear_[v].setZero();
      for (int i = 0; i < 4; ++i) {
        const double w = weights_.weight[v][i];
        if (w == 0) continue;
        linear_[v] += w * motions[weights_.joint[v][i]].rotation;
      }
    }
  }

  // Offsets of rest vertices that make skinning meet the sweeps, stacked.
  VectorXd Offsets() const {
    VectorXd offsets(3 * num_);
    for (int v = 0; v < num_; ++v) {
      const bool is_flat = linear_[v].determinant() < kMinDeterminant;
      offsets.segment<3>(3 * v) =
          is_flat ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                  : Eigen::Vector3d(linear_[v].inverse() *
                                    (wanted_[v] - skinned_[v]));
    }
    return offsets;
  }

  // Adds the squared errors with these offsets.
  void AddErrors(const VectorXd& offsets, double* sum, double* max) const {
    for (int v = 0; v < num_; ++v) {
      const double error =
          (skinned_[v] + linear_[v] * offsets.segment<3>(3 * v) - wanted_[v])
              .norm();
      *sum += error * error;
      *max = std::max(*max, error);
    }
  }

 private:
  const SkinWeights& weights_;
  const BodyDeformer& deformer_;
  JointMotions motions_;
  int num_;
  std::vector<Eigen::Vector3d> wanted_, skinned_;
  std::vector<Eigen::Matrix3d> linear_;
};

// Orthonormal components of the keys' offsets, as many as the error needs.
MatrixXd Components(const std::vector<Pose>& keys,
                    const CorrectiveOptions& options,
                    ClipSkin* skin) {
  const int count = std::min<int>(kMaxBasisKeys, static_cast<int>(keys.size()));
  MatrixXd offsets(3 * skin->num_vertices(), count);
  for (int i = 0; i < count; ++i) {
    skin->Set(keys[i * keys.size() / count]);
    offsets.col(i) = skin->Offsets();
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> gram(offsets.transpose() *
                                                     offsets);
  const double per_key = static_cast<double>(count) * skin->num_vertices();
  const VectorXd energy = gram.eigenvalues().cwiseMax(0) / per_key;
  int num_targets = 0;
  double left = energy.sum();
  const double negligible = 1e-12 * left;
  while (num_targets < std::min(count, options.max_targets) &&
         left > options.rms * options.rms &&
         energy[count - 1 - num_targets] > negligible) {
    left -= energy[count - 1 - num_targets];
    ++num_targets;
  }
  MatrixXd components(offsets.rows(), num_targets);
  for (int k = 0; k < num_targets; ++k) {
    components.col(k) =
        (offsets * gram.eigenvectors().col(count - 1 - k)).normalized();
  }
  return components;
}

std::vector<Eigen::Vector3d> Unstacked(const VectorXd& stacked) {
  std::vector<Eigen::Vector3d> vectors(stacked.size() / 3);
  for (std::size_t v = 0; v < vectors.size(); ++v) {
    vectors[v] = stacked.segment<3>(3 * static_cast<Eigen::Index>(v));
  }
  return vectors;
}

}  // namespace

Correctives BakeCorrectives(const Body& body,
                            const BodyDeformer& deformer,
                            const SkinWeights& weights,
                            const std::vector<Pose>& keys,
                            const CorrectiveOptions& options) {
  CHECK(!keys.empty());
  ClipSkin skin(body, deformer, weights);
  const MatrixXd components = Components(keys, options, &skin);
  const int num_components = static_cast<int>(components.cols());

  Correctives result;
  MatrixXd share(num_components, keys.size());
  double sum_without = 0, sum_with = 0;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    skin.Set(keys[k]);
    skin.AddErrors(
        VectorXd::Zero(components.rows()), &sum_without, &result.max_without);
    share.col(k) = components.transpose() * skin.Offsets();
    skin.AddErrors(components * share.col(k), &sum_with, &result.max_with);
  }
  const double count =
      static_cast<double>(keys.size()) * std::max(1, skin.num_vertices());
  result.rms_without = std::sqrt(sum_without / count);
  result.rms_with = std::sqrt(sum_with / count);
  result.weight.resize(keys.size());
  if (num_components == 0 || result.rms_without < options.negligible_rms) {
    result.rms_with = result.rms_without;
    result.max_with = result.max_without;
    return result;
  }

  // Weights from 0 to 1: a constant target takes the smallest share of all.
  const VectorXd low = share.rowwise().minCoeff();
  const VectorXd range = share.rowwise().maxCoeff() - low;
  result.target.push_back(Unstacked(components * low));
  std::vector<int> varying;
  for (int c = 0; c < num_components; ++c) {
    if (range[c] <= 1e-9) continue;
    varying.push_back(c);
    result.target.push_back(Unstacked(components.col(c) * range[c]));
  }
  for (std::size_t k = 0; k < keys.size(); ++k) {
    result.weight[k].push_back(1);
    for (const int c : varying) {
      result.weight[k].push_back((share(c, k) - low[c]) / range[c]);
    }
  }
  return result;
}

}  // namespace sweepfit
