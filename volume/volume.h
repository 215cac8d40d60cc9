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
  std::string mode = "hull";  // photo and greedy deepen this stage
  double voxel_size = 0.004;  // metres; finer does not lower the hull's bias
  std::optional<std::string> Check() const;
};

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
