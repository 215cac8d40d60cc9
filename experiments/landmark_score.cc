// SPDX-License-Identifier: Apache-2.0
#include "experiments/landmark_score.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "model/input_error.h"

namespace sweepfit {
namespace {

using Json = nlohmann::ordered_json;

LandmarkScore ScoreOne(const Json& landmark, const JointPositions& truth) {
  LandmarkScore score;
  score.name = landmark.at("name");
  score.source = landmark.at("source");
  score.num_views = landmark.at("views");
  const std::string joint_name = landmark.at("joint");
  const auto joint =
      std::find(kJointNames.begin(), kJointNames.end(), joint_name);
  if (joint == kJointNames.end()) {
    throw InputError("unknown joint '" + joint_name + "'");
  }
  Eigen::Matrix3d covariance;
  for (int row = 0; row < 3; ++row) {
    score.error_in_world[row] = landmark.at("point").at(row);
    for (int column = 0; column < 3; ++column) {
      covariance(row, column) = landmark.at("covariance").at(3 * row + column);
    }
  }
  score.error_in_world -= truth[joint - kJointNames.begin()];
  const Eigen::LLT<Eigen::Matrix3d> cholesky(covariance);
  if (cholesky.info() != Eigen::Success) {
    throw InputError("landmark '" + score.name +
                     "': the covariance is not positive definite");
  }
  score.chi2_per_dof =
      cholesky.matrixL().solve(score.error_in_world).squaredNorm() / 3;
  return score;
}

}  // namespace

std::vector<LandmarkScore> ScoreLandmarks(
    const std::filesystem::path& landmarks_json,
    const std::string& pose_name,
    const JointPositions& truth) {
  std::ifstream file(landmarks_json, std::ios::binary);
  if (!file) {
    throw InputError(landmarks_json.string() + ": cannot read the file");
  }
  std::vector<LandmarkScore> scores;
  try {
    const Json json = Json::parse(file);
    for (const Json& landmark :
         json.at("poses").at(pose_name).at("landmarks")) {
      if (landmark.at("joint").is_null()) continue;
      scores.push_back(ScoreOne(landmark, truth));
    }
  } catch (const Json::exception& error) {
    throw InputError(landmarks_json.string() + ": " + error.what());
  } catch (const InputError& error) {
    throw InputError(landmarks_json.string() + ": " + error.what());
  }
  return scores;
}

}  // namespace sweepfit
