// SPDX-License-Identifier: Apache-2.0
#include "volume/vdb_grid.h"

#include <glog/logging.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <vector>

#include "model/file_io.h"
#include "model/hash.h"
#include "model/input_error.h"

namespace sweepfit {

struct VdbGrid {
  openvdb::FloatGrid::Ptr grid;
};

namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
static_assert(Leaf::DIM == BlockGrid::kSide);

void InitializeOnce() {
  static const bool done = [] {
    openvdb::initialize();
    return true;
  }();
  static_cast<void>(done);
}

openvdb::FloatGrid::Ptr EmptyLevelSet(double voxel_size, double band) {
  InitializeOnce();
  auto grid = openvdb::FloatGrid::create(static_cast<float>(band));
  grid->setTransform(
      openvdb::math::Transform::createLinearTransform(voxel_size));
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  grid->setName("surface");
  return grid;
}

// Magic (8 bytes), file version, library major and minor (4 each) and the
// offset flag (1) come before the UUID's 36 characters.
constexpr size_t kUuidOffset = 21;
constexpr size_t kUuidLength = 36;

std::string UuidOf(const std::string& bytes) {
  const std::uint64_t a = FnvHash(bytes);
  const std::uint64_t b = FnvHash(bytes, 0x9e3779b97f4a7c15ULL);
  // Version 8 ("custom"), variant 1.
  char text[kUuidLength + 1];
  std::snprintf(text,
                sizeof text,
                "%08x-%04x-8%03x-%04x-%012llx",
                static_cast<unsigned>(a >> 32),
                static_cast<unsigned>(a >> 16 & 0xffff),
                static_cast<unsigned>(a & 0xfff),
                static_cast<unsigned>((b >> 48 & 0x3fff) | 0x8000),
                static_cast<unsigned long long>(b & 0xffffffffffffULL));
  return text;
}

// Makes the bytes of a .vdb file depend on its content only.
void OverwriteUuid(std::string* bytes) {
  CHECK_GE(bytes->size(), kUuidOffset + kUuidLength);
  CHECK_EQ((*bytes)[kUuidOffset + 8], '-') << "unexpected .vdb header";
  std::fill_n(bytes->begin() + kUuidOffset, kUuidLength, '0');
  bytes->replace(kUuidOffset, kUuidLength, UuidOf(*bytes));
}

}  // namespace

std::shared_ptr<const VdbGrid> MakeVdbGrid(const BlockGrid& blocks) {
  auto grid = EmptyLevelSet(blocks.voxel_size(), blocks.band());
  const auto band = static_cast<float>(blocks.band());
  const auto origin_of = [](const BlockGrid::Block& block) {
    return openvdb::Coord(block.index.x() * BlockGrid::kSide,
                          block.index.y() * BlockGrid::kSide,
                          block.index.z() * BlockGrid::kSide);
  };
  const std::vector<BlockGrid::Block>& all = blocks.blocks();
  std::vector<std::unique_ptr<Leaf>> leaves(all.size());
  std::vector<char> is_tile(all.size(), 0);
  tbb::parallel_for(size_t{0}, all.size(), [&](size_t b) {
    const BlockGrid::BlockValues& values = all[b].values;
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    if (*low >= band) return;
    is_tile[b] = *high <= -band;
    if (is_tile[b]) return;
    leaves[b] = std::make_unique<Leaf>(origin_of(all[b]), band, false);
    for (int o = 0; o < BlockGrid::kBlockSize; ++o) {
      if (std::abs(values[o]) < band) {
        leaves[b]->setValueOn(o, values[o]);
      } else {
        leaves[b]->setValueOff(o, values[o]);
      }
    }
  });
  openvdb::FloatTree& tree = grid->tree();
  for (size_t b = 0; b < all.size(); ++b) {
    if (is_tile[b]) tree.addTile(1, origin_of(all[b]), -band, false);
    // The tree owns its leaves.
    if (leaves[b] != nullptr) tree.addLeaf(leaves[b].release());
  }
  return std::make_shared<VdbGrid>(VdbGrid{grid});
}

TriangleMesh MeshVdbGrid(const VdbGrid& vdb) {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec4I> vdb_quads;
  openvdb::tools::volumeToMesh(*vdb.grid, points, vdb_quads, 0.0);
  TriangleMesh mesh;
  mesh.vertices.reserve(points.size());
  for (const openvdb::Vec3s& p : points) {
    mesh.vertices.emplace_back(p.x(), p.y(), p.z());
  }
  std::vector<Quad> quads;
  quads.reserve(vdb_quads.size());
  for (const openvdb::Vec4I& q : vdb_quads) {
    // OpenVDB orders quads clockwise as seen from outside.
    quads.push_back({static_cast<int>(q[3]),
                     static_cast<int>(q[2]),
                     static_cast<int>(q[1]),
                     static_cast<int>(q[0])});
  }
  mesh.triangles = TriangulateQuads(quads, mesh.vertices);
  return mesh;
}

void SaveVdbGrid(const VdbGrid& vdb, const std::string& path) {
  // OpenVDB writes files only; this one is ours to read, and goes in any case.
  struct PartFile {
    std::string path;
    ~PartFile() { std::remove(path.c_str()); }
  };
  const PartFile part{path + ".part"};
  try {
    openvdb::io::File file(part.path);
    file.write({vdb.grid});
  } catch (const openvdb::Exception& error) {
    throw InputError(path + ": cannot be written: " + error.what());
  }
  std::string bytes = ReadWholeFile(part.path);
  OverwriteUuid(&bytes);
  WriteWholeFile(bytes, path);
}

}  // namespace sweepfit
