// SPDX-License-Identifier: Apache-2.0
#include "solver/joints.h"

#include <algorithm>
#include <cmath>

#include "model/anthropometry.h"
#include "model/joint_angles.h"
#include "solver/person_problem.h"

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Sets the rotation-vector coordinates of a ball joint.
void SetBall(const JointAngles& angles,
             int joint,
             const Vector3d& rotation_vector,
             std::vector<double>* pose) {
  for (size_t i = 0; i < angles.angles().size(); ++i) {
    const JointAngle& angle = angles.angles()[i];
    if (angle.joint == joint && angle.kind == JointAngle::Kind::kBall) {
      (*pose)[3 + i] = angle.axis.dot(rotation_vector);
    }
  }
}

// Turns a straight limb from its rest direction towards the landmarks of its
// two ends, given the root's orientation.
void AimLimb(const JointAngles& angles,
             const Skeleton& base,
             const Matrix3d& world_from_root,
             const LandmarkResult& landmarks,
             int first,
             std::vector<double>* pose) {
  const Landmark3* from = landmarks.Find(kJointNames[first]);
  const Landmark3* to = landmarks.Find(kJointNames[first + 2]);
  if (to == nullptr) to = landmarks.Find(kJointNames[first + 3]);
  if (from == nullptr || to == nullptr) return;
  const Vector3d limb = to->point_in_world - from->point_in_world;
  if (limb.norm() < 0.05) return;
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(
      base.rest_direction[first + 1],
      world_from_root.transpose() * limb.normalized());
  const Eigen::AngleAxisd angle_axis(turn);
  SetBall(angles, first, angle_axis.angle() * angle_axis.axis(), pose);
}

std::vector<double> InitialPose(const JointAngles& angles,
                                const Skeleton& base,
                                const LandmarkResult& landmarks) {
  std::vector<double> pose(angles.num_parameters(), 0.0);
  for (size_t i = 0; i < angles.angles().size(); ++i) {
    pose[3 + i] = angles.angles()[i].usual;
  }
  Vector3d root = Vector3d::Zero();
  if (const Landmark3* known = landmarks.Find("root")) {
    root = known->point_in_world;
  } else {
    for (const Landmark3& landmark : landmarks.landmarks) {
      root += landmark.point_in_world / landmarks.landmarks.size();
    }
  }
  Eigen::Map<Vector3d>(pose.data()) = root;
  const double yaw =
      std::atan2(landmarks.facing_in_world.x(), landmarks.facing_in_world.z());
  SetBall(angles, kRoot, yaw * Vector3d::UnitY(), &pose);
  const Matrix3d world_from_root =
      Eigen::AngleAxisd(yaw, Vector3d::UnitY()).toRotationMatrix();
  for (const int first : {kLShoulder, kRShoulder, kLHip, kRHip}) {
    AimLimb(angles, base, world_from_root, landmarks, first, &pose);
  }
  return pose;
}

struct Stature {
  double value, sigma;
};

// The mean of the poses' estimates, each by its own variance.
Stature CombinedStature(const std::vector<LandmarkResult>& landmarks) {
  double weight = 0, sum = 0;
  for (const LandmarkResult& pose : landmarks) {
    const double w = 1 / (pose.stature_sigma * pose.stature_sigma);
    weight += w;
    sum += w * pose.stature;
  }
  // Poses of one person share hair and shoes, so the error does not average
  // out.
  double smallest = landmarks.front().stature_sigma;
  for (const LandmarkResult& pose : landmarks) {
    smallest = std::min(smallest, pose.stature_sigma);
  }
  return {sum / weight, smallest};
}

double SumOfWeights(const JointOptions::Weights& weights) {
  return weights.landmark + weights.template_ratio + weights.anthropometric;
}

// The paper's evaluation (reconstruction A): parent to child, the refined
// length of a bone is the convex combination of the observed length and those
// of template and tables, along the observed direction.
std::array<Vector3d, kNumJoints> EvaluateClosedForm(
    const std::array<Vector3d, kNumJoints>& initial,
    const Skeleton& base,
    double base_stature,
    const Anthropometry& tables,
    double stature,
    const JointOptions::Weights& weights) {
  std::array<Vector3d, kNumJoints> joints = initial;
  for (int j = 1; j < kNumJoints; ++j) {
    const int parent = kJointParents[j];
    const Vector3d bone = initial[j] - initial[parent];
    const double observed = std::max(bone.norm(), 1e-6);
    const double template_ratio =
        base.length[j] / base_stature * stature / observed;
    const double table_ratio = tables.bone[j].Mean(0.5) * stature / observed;
    joints[j] = joints[parent] +
                (weights.landmark + weights.template_ratio * template_ratio +
                 weights.anthropometric * table_ratio) *
                    bone;
  }
  return joints;
}

}  // namespace

std::optional<std::string> JointOptions::Check() const {
  if (mode != "sigma" && mode != "simplex" && mode != "paper") {
    return "joints.mode must be sigma, simplex or paper, not '" + mode + "'";
  }
  for (const double w : {weights.landmark,
                         weights.template_ratio,
                         weights.anthropometric,
                         weights.pose,
                         weights.stature,
                         weights.silhouette,
                         weights.photo}) {
    if (!(w >= 0) || !std::isfinite(w)) {
      return "joints.weights must be finite and not negative";
    }
  }
  if (mode != "sigma" && std::abs(SumOfWeights(weights) - 1) > 1e-9) {
    return "joints.weights landmark + template_ratio + anthropometric must be "
           "1 in mode " +
           mode + ": set all three, for instance 0.4, 0.3 and 0.3";
  }
  if (!(template_sigma > 0)) return "joints.template_sigma must be positive";
  return std::nullopt;
}

JointOptions::Weights JointOptions::FamilyWeights() const {
  Weights families = weights;
  if (mode != "sigma") {
    const Weights whole;
    families.landmark = whole.landmark;
    families.template_ratio = whole.template_ratio;
    families.anthropometric = whole.anthropometric;
  }
  return families;
}

JointResult EstimateJoints(const std::vector<LandmarkResult>& landmarks,
                           const Skeleton& base,
                           double base_stature,
                           const JointOptions& options,
                           StageSummary* summary) {
  const JointAngles angles(base);
  const Anthropometry& tables = Anthropometry::Default();
  const Stature stature = CombinedStature(landmarks);

  PersonParameters parameters;
  parameters.person = {stature.value, 0.5};
  for (const LandmarkResult& pose : landmarks) {
    parameters.pose.push_back(InitialPose(angles, base, pose));
  }

  bool usable = false;
  const auto solve = [&](const JointOptions::Weights& weights,
                         const std::vector<std::vector<Landmark3>>& points,
                         double loss_scale) {
    auto problem = std::make_unique<PersonProblem>(base, &angles, &parameters);
    for (size_t p = 0; p < points.size(); ++p) {
      for (const Landmark3& landmark : points[p]) {
        problem->AddLandmark(static_cast<int>(p),
                             landmark.joint,
                             landmark.point_in_world,
                             landmark.covariance,
                             weights.landmark,
                             loss_scale);
      }
    }
    problem->AddAnthropometric(tables, weights.anthropometric);
    problem->AddTemplateRatio(
        base, base_stature, options.template_sigma, weights.template_ratio);
    problem->AddPosePrior(weights.pose);
    problem->AddPersonPrior(stature.value, stature.sigma, weights.stature);
    problem->NoteStart();
    usable = problem->Solve(50);
    return problem;
  };

  std::vector<std::vector<Landmark3>> points;
  for (const LandmarkResult& pose : landmarks) {
    points.push_back(pose.landmarks);
  }
  // In the other modes to fill joints no landmark speaks of.
  JointOptions::Weights weights = options.FamilyWeights();
  // Graduated non-convexity: a wide loss first, so that one bad landmark cannot
  // trap a limb.
  std::unique_ptr<PersonProblem> problem;
  for (const double loss_scale : {8.0, 4.0, 2.0}) {
    problem = solve(weights, points, loss_scale);
  }

  if (options.mode != "sigma") {
    // Joints by the simplex weights, then forward kinematics through them.
    const Skeleton initial_skeleton = problem->CurrentSkeleton();
    for (size_t p = 0; p < points.size(); ++p) {
      const JointFrames frames = ForwardKinematics(
          initial_skeleton, angles.ToPose(parameters.pose[p].data()));
      std::array<Vector3d, kNumJoints> initial = frames.joint_in_world;
      for (const Landmark3& landmark : landmarks[p].landmarks) {
        initial[landmark.joint] = landmark.point_in_world;
      }
      points[p].clear();
      const auto closed_form = EvaluateClosedForm(
          initial, base, base_stature, tables, stature.value, options.weights);
      constexpr double kSigma = 0.02;  // metres, isotropic as in the paper
      for (int j = 0; j < kNumJoints; ++j) {
        Landmark3 point;
        point.joint = j;
        point.covariance = kSigma * kSigma * Matrix3d::Identity();
        if (options.mode == "paper") {
          point.point_in_world = closed_form[j];
          points[p].push_back(point);
          continue;
        }
        // simplex: three candidates per joint against the initial parent,
        // weighted; their minimiser is the convex combination.
        const int parent = std::max(0, kJointParents[j]);
        const Vector3d direction =
            j == 0 ? Vector3d::Zero()
                   : Vector3d((initial[j] - initial[parent]).normalized());
        const auto candidate = [&](double length, double weight) {
          if (weight <= 0) return;
          point.point_in_world =
              j == 0 ? initial[j]
                     : Vector3d(initial[parent] + length * direction);
          point.covariance = kSigma * kSigma / weight * Matrix3d::Identity();
          points[p].push_back(point);
        };
        candidate((initial[j] - initial[parent]).norm(),
                  options.weights.landmark);
        candidate(base.length[j] / base_stature * stature.value,
                  options.weights.template_ratio);
        candidate(tables.bone[j].Mean(0.5) * stature.value,
                  options.weights.anthropometric);
      }
    }
    weights.anthropometric = 1e-4;  // only to keep lengths regular
    weights.pose *= 0.01;
    problem = solve(weights, points, 0);
  }

  JointResult result;
  result.base = base;
  result.stature_sigma = stature.sigma;
  FillJointResult(*problem, angles, parameters, true, &result);
  for (size_t p = 0; p < landmarks.size(); ++p) {
    result.poses[p].reliability[kRoot] =
        landmarks[p].Find("root") != nullptr ? 1.0 : 0.0;
  }
  summary->figures = problem->Report();
  summary->figures["mode"] = options.mode;
  summary->figures["stature_m"] = result.stature;
  summary->figures["sex_male"] = result.sex;
  summary->status = usable ? "ok" : "failed";
  return result;
}

}  // namespace sweepfit
