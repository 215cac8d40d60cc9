// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "capture/silhouette.h"
#include "volume/block_grid.h"

namespace sweepfit {

// While the cones of a block are gone through: the greatest phi of those so
// far, and how many cameras see the voxel.
struct BlockField {
  BlockGrid::BlockValues values;
  std::array<std::uint16_t, BlockGrid::kBlockSize> num_views;
};

// The silhouette of one view as a cone in the world,
//   phi_i(x) = D_i(pi_i(x)) z_i(x) / f_i   [metres; > 0 outside],
// known where the point lies in front of the camera and inside its frame.
class SilhouetteCone {
 public:
  explicit SilhouetteCone(const View& view);

  // False when the camera does not see the point.
  bool Evaluate(const Eigen::Vector3d& point_in_world, double* phi) const;

  // Raises the field of a block to phi at the voxels that the camera sees, but
  // for those that have reached `limit`, and counts the camera there. Offsets
  // as in BlockGrid; the first voxel is centred at `first_in_world`.
  void RaiseBlock(const Eigen::Vector3d& first_in_world,
                  double voxel_size,
                  float limit,
                  BlockField* field) const;

  enum class Sees { kNothing, kPart, kAll };
  // How much of a ball the camera sees. phi: of the centre when it sees all, a
  // lower bound over what it sees when it sees a part.
  Sees EvaluateBall(const Eigen::Vector3d& center_in_world,
                    double radius,
                    double* phi) const;

  const Eigen::Vector3d& center_in_world() const { return center_in_world_; }
  // Unit ray through the middle of the silhouette.
  const Eigen::Vector3d& axis_in_world() const { return axis_in_world_; }

 private:
  double Distance(double u, double v) const;

  Eigen::Matrix3d pixel_from_world_;  // K R
  Eigen::Vector3d world_in_pixel_;    // K t
  Eigen::Vector3d center_in_world_;
  Eigen::Vector3d axis_in_world_;
  Eigen::Vector2d principal_point_;
  double focal_length_;
  cv::Mat1f signed_distance_;  // shares the view's pixels
};

// One cone per view, in that order. FitError for an empty silhouette or fewer
// than two views.
std::vector<SilhouetteCone> MakeSilhouetteCones(const std::vector<View>& views);

// The point nearest to all cones' axes, least squares. FitError when the axes
// are parallel.
Eigen::Vector3d MeetingPoint(const std::vector<SilhouetteCone>& cones);

}  // namespace sweepfit
