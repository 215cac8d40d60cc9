// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/silhouette.h"
#include "model/mesh.h"

namespace sweepfit {

// A level set on an OpenVDB grid: signed distance in metres, negative inside,
// known within a narrow band, constant beyond. World coordinates.
class Volume {
 public:
  Volume(Volume&&) noexcept;
  Volume& operator=(Volume&&) noexcept;
  ~Volume();

  double voxel_size() const;
  double band_half_width() const;  // metres; values saturate there
  // Trilinear value and gradient.
  double Sample(const Eigen::Vector3d& point_in_world) const;
  double SampleWithGradient(const Eigen::Vector3d& point_in_world,
                            Eigen::Vector3d* gradient) const;
  // The closed zero surface (triangles, outward).
  TriangleMesh ExtractMesh() const;
  double EnclosedVolume() const;  // cubic metres
  // Corners of the box around the inside.
  Eigen::Vector3d BoxMin() const;
  Eigen::Vector3d BoxMax() const;
  // Writes a .vdb (grid "surface", level set, transform in metres) whose bytes
  // depend on the content only. InputError when it cannot be written.
  void SaveVdb(const std::string& path) const;

  struct Impl;
  explicit Volume(std::unique_ptr<Impl> impl);
  const Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

struct HullOptions {
  double voxel_size = 0.004;  // metres; finer does not lower the hull's bias
  std::optional<std::string> Check() const;
};

// The hull's surface moved inwards to where the pictures agree. "Pixels" are
// those of the pictures at the person's distance.
struct PhotoOptions {
  double max_depth = 0.04;        // below the hull, metres
  double sample_spacing = 0.006;  // along the surface, metres
  int rounds = 2;                 // of matching and moving
  int patch_side = 9;             // taps along a patch, a pixel apart
  // Log likelihood that a pixel of difference in depth between neighbouring
  // samples costs.
  double smoothness = 0.7;
  double sigma_match = 0.35;    // of a matched depth, pixels
  double sigma_rim = 0.25;      // of the edge of a silhouette, pixels
  double sigma_curvature = 20;  // of the surface, 1 / metres
  // Off where less than this share of the samples that two views see has
  // texture that they agree on.
  double min_support = 0.4;
  std::optional<std::string> Check() const;
};

// Surface voxels of the hull carved where the pictures disagree.
struct GreedyOptions {
  double max_depth = 0.03;  // below the hull, metres
  double sigma_color = 8;   // of one surface colour between views, 8 bit
  // Log likelihood ratio, "one colour" against "any colours", below which a
  // voxel may go.
  double threshold = -6;
  std::optional<std::string> Check() const;
};

struct VolumeOptions {
  std::string mode = "hull";  // hull | photo | greedy
  double voxel_size = 0.004;  // of the hull, metres
  PhotoOptions photo;
  GreedyOptions greedy;
  std::optional<std::string> Check() const;
};

// The volume by the mode of the options.
Volume BuildVolume(const std::vector<View>& views,
                   const VolumeOptions& options,
                   Progress* progress,
                   StageSummary* summary);

// Hierarchical visual hull (algorithm: intersection of silhouette cones,
//   phi(x) = max_i D_i(pi_i(x)) z_i(x) / f_i,
// refined only near the surface). Outside its frame a camera abstains. Keeps
// the component with the largest volume. Finds the person's place by itself.
// FitError when the cones have no common part.
Volume BuildVisualHull(const std::vector<View>& views,
                       const HullOptions& options,
                       Progress* progress,
                       StageSummary* summary);

// A signed distance volume of a closed mesh.
Volume VolumeFromMesh(const TriangleMesh& mesh, double voxel_size);

}  // namespace sweepfit
