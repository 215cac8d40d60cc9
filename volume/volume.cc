// SPDX-License-Identifier: Apache-2.0
#include "volume/volume.h"

#include <utility>

#include "model/input_error.h"
#include "volume/mesh_distance.h"
#include "volume/volume_impl.h"

namespace sweepfit {

Volume::Volume(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Volume::Volume(Volume&&) noexcept = default;
Volume& Volume::operator=(Volume&&) noexcept = default;
Volume::~Volume() = default;

double Volume::voxel_size() const { return impl_->blocks.voxel_size(); }

double Volume::band_half_width() const { return impl_->blocks.band(); }

double Volume::Sample(const Eigen::Vector3d& point_in_world) const {
  return impl_->blocks.Sample(point_in_world, nullptr);
}

double Volume::SampleWithGradient(const Eigen::Vector3d& point_in_world,
                                  Eigen::Vector3d* gradient) const {
  return impl_->blocks.Sample(point_in_world, gradient);
}

TriangleMesh Volume::ExtractMesh() const { return MeshVdbGrid(*impl_->vdb); }

double Volume::EnclosedVolume() const { return impl_->blocks.EnclosedVolume(); }

Eigen::Vector3d Volume::BoxMin() const { return impl_->box_min; }

Eigen::Vector3d Volume::BoxMax() const { return impl_->box_max; }

void Volume::SaveVdb(const std::string& path) const {
  SaveVdbGrid(*impl_->vdb, path);
}

Volume MakeVolume(BlockGrid blocks) {
  auto vdb = MakeVdbGrid(blocks);
  return Volume(
      std::make_unique<Volume::Impl>(std::move(blocks), std::move(vdb)));
}

Volume VolumeFromMesh(const TriangleMesh& mesh, double voxel_size) {
  if (mesh.triangles.empty() || !(voxel_size > 0)) {
    throw InputError("a volume needs a mesh with triangles and a voxel size");
  }
  const double band = kBandVoxels * voxel_size;
  return MakeVolume(BlockGrid(
      voxel_size, band, MeshDistance(mesh, voxel_size, band).Blocks()));
}

}  // namespace sweepfit
