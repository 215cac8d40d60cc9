// SPDX-License-Identifier: Apache-2.0
#include "model/mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "model/file_io.h"
#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;

// A cube of side `size` with a corner at `origin`.
TriangleMesh Cube(double size, const Eigen::Vector3d& origin) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.push_back(
        origin + size * Eigen::Vector3d(i & 1, (i >> 1) & 1, (i >> 2) & 1));
  }
  const std::vector<Quad> quads = {{0, 2, 3, 1},
                                   {4, 5, 7, 6},
                                   {0, 1, 5, 4},
                                   {2, 6, 7, 3},
                                   {0, 4, 6, 2},
                                   {1, 3, 7, 5}};
  mesh.triangles = TriangulateQuads(quads, mesh.vertices);
  return mesh;
}

TriangleMesh Joined(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh mesh = a;
  const int base = static_cast<int>(a.vertices.size());
  mesh.vertices.insert(
      mesh.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Triangle& t : b.triangles) {
    mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  }
  return mesh;
}

TEST(MeshTest, QuadsSplitAlongTheShorterDiagonal) {
  const std::vector<Eigen::Vector3d> vertices = {
      {0, 0, 0}, {1, 0, 0}, {2, 2, 0}, {0, 1, 0}};
  EXPECT_EQ(TriangulateQuads({{0, 1, 2, 3}}, vertices),
            (std::vector<Triangle>{{0, 1, 3}, {1, 2, 3}}));
  EXPECT_EQ(TriangulateQuads({{1, 2, 3, 0}}, vertices),
            (std::vector<Triangle>{{1, 2, 3}, {1, 3, 0}}));
  const TriangleMesh cube = Cube(1, Eigen::Vector3d::Zero());
  EXPECT_EQ(cube.triangles[0], (Triangle{0, 2, 3}));  // a tie
}

TEST(MeshTest, CubeHasItsVolumeAreaAndNormals) {
  const TriangleMesh cube = Cube(2, Eigen::Vector3d(1000, -2000, 300));
  EXPECT_NEAR(EnclosedVolume(cube), 8, 1e-9);
  EXPECT_NEAR(SurfaceArea(cube), 24, 1e-9);
  TriangleMesh inside_out = cube;
  for (Triangle& t : inside_out.triangles) std::swap(t[0], t[1]);
  EXPECT_NEAR(EnclosedVolume(inside_out), -8, 1e-9);
  const std::vector<Eigen::Vector3d> normals = VertexNormals(cube);
  const Eigen::Vector3d centre = Eigen::Vector3d(1001, -1999, 301);
  for (std::size_t v = 0; v < normals.size(); ++v) {
    EXPECT_NEAR(normals[v].norm(), 1, 1e-14);
    EXPECT_GT(normals[v].dot((cube.vertices[v] - centre).normalized()), 0.9);
  }
}

TEST(MeshTest, NormalsAreFiniteWithoutArea) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {5, 5, 5}};
  mesh.triangles = {{0, 1, 2}};
  for (const Eigen::Vector3d& normal : VertexNormals(mesh)) {
    EXPECT_NEAR(normal.norm(), 1, 1e-14);
  }
}

TEST(MeshTest, CubeIsAClosedManifold) {
  const MeshTopology topology = CheckTopology(Cube(1, {0, 0, 0}));
  EXPECT_TRUE(topology.IsClosedManifold());
  EXPECT_EQ(topology.euler_characteristic, 2);
  EXPECT_EQ(topology.num_components, 1);
}

TEST(MeshTest, FaultsAreCounted) {
  const TriangleMesh cube = Cube(1, {0, 0, 0});

  TriangleMesh open = cube;
  open.triangles.pop_back();
  EXPECT_EQ(CheckTopology(open).num_boundary_edges, 3);
  EXPECT_EQ(CheckTopology(open).num_non_manifold_vertices, 0);
  EXPECT_FALSE(CheckTopology(open).IsClosedManifold());

  TriangleMesh flipped = cube;
  std::swap(flipped.triangles[4][0], flipped.triangles[4][1]);
  EXPECT_EQ(CheckTopology(flipped).num_misoriented_edges, 3);
  EXPECT_EQ(CheckTopology(flipped).num_boundary_edges, 0);

  TriangleMesh fin = cube;
  fin.vertices.push_back({3, 3, 3});
  fin.triangles.push_back({0, 2, 8});
  EXPECT_EQ(CheckTopology(fin).num_non_manifold_edges, 1);
  EXPECT_EQ(CheckTopology(fin).num_boundary_edges, 2);

  TriangleMesh degenerate = cube;
  degenerate.triangles.push_back({0, 0, 1});
  EXPECT_FALSE(CheckTopology(degenerate).IsClosedManifold());

  TriangleMesh stray = cube;
  stray.vertices.push_back({3, 3, 3});
  EXPECT_EQ(CheckTopology(stray).num_components, 2);
}

TEST(MeshTest, TwoCubesThatShareACornerAreNotManifoldThere) {
  TriangleMesh two = Joined(Cube(1, {0, 0, 0}), Cube(1, {1, 1, 1}));
  EXPECT_TRUE(CheckTopology(two).IsClosedManifold());
  EXPECT_EQ(CheckTopology(two).num_components, 2);
  EXPECT_EQ(CheckTopology(two).euler_characteristic, 4);
  // Vertex 7 of the first is at vertex 0 of the second.
  for (Triangle& t : two.triangles) {
    for (int& index : t) index = index == 8 ? 7 : index > 8 ? index - 1 : index;
  }
  two.vertices.erase(two.vertices.begin() + 8);
  const MeshTopology topology = CheckTopology(two);
  EXPECT_EQ(topology.num_non_manifold_vertices, 1);
  EXPECT_EQ(topology.num_boundary_edges, 0);
  EXPECT_EQ(topology.num_non_manifold_edges, 0);
  EXPECT_FALSE(topology.IsClosedManifold());
}

TEST(MeshTest, TwoCubesThatShareAnEdgeAreNotManifoldThere) {
  TriangleMesh two = Joined(Cube(1, {0, 0, 0}), Cube(1, {1, 1, 0}));
  // Vertices 3, 7 of the first are at 0, 4 of the second.
  for (Triangle& t : two.triangles) {
    for (int& index : t) {
      if (index == 8) index = 3;
      if (index == 12) index = 7;
    }
  }
  EXPECT_EQ(CheckTopology(two).num_non_manifold_edges, 1);
}

TEST(MeshTest, LargestComponentIsTheOneWithMostVolume) {
  const TriangleMesh big = Cube(2, {5, 5, 5});
  TriangleMesh mesh =
      Joined(Joined(Cube(1, {0, 0, 0}), big), Cube(1.5, {9, 9, 9}));
  mesh.vertices.push_back({50, 50, 50});
  const TriangleMesh largest = LargestComponent(mesh);
  EXPECT_EQ(largest.vertices, big.vertices);
  EXPECT_EQ(largest.triangles, big.triangles);
  EXPECT_TRUE(LargestComponent(TriangleMesh()).vertices.empty());
}

class PlyTest : public ::testing::Test {
 protected:
  TriangleMesh Load(const std::string& text) {
    WriteWholeFile(text, path_);
    return LoadPly(path_);
  }
  std::string ErrorOf(const std::string& text) {
    try {
      Load(text);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }

  TemporaryFolder folder_;
  std::string path_ = (folder_.path() / "mesh.ply").string();
};

constexpr char kAscii[] =
    "ply\r\nformat ascii 1.0\r\ncomment by hand\r\n"
    "element vertex 4\r\nproperty double x\r\nproperty uchar red\r\n"
    "property double y\r\nproperty double z\r\n"
    "element edge 1\r\nproperty int a\r\nproperty int b\r\n"
    "element face 1\r\nproperty list uchar int vertex_index\r\n"
    "end_header\r\n"
    "0 255 0 0\r\n1 0 0 0\r\n1 7 1 0.5\r\n0 0 1 -1e-3\r\n"
    "0 1\r\n4 0 1 2 3\r\n";

TEST_F(PlyTest, RoundTripKeepsFloats) {
  const TriangleMesh cube = Cube(0.1f, {0.3f, 1.7f, -2.1f});
  SavePly(cube, path_);
  const TriangleMesh loaded = LoadPly(path_);
  EXPECT_EQ(loaded.triangles, cube.triangles);
  ASSERT_EQ(loaded.vertices.size(), cube.vertices.size());
  for (std::size_t v = 0; v < cube.vertices.size(); ++v) {
    EXPECT_EQ(loaded.vertices[v].cast<float>(), cube.vertices[v].cast<float>());
  }
}

TEST_F(PlyTest, AsciiWithFurtherPropertiesAndQuads) {
  const TriangleMesh mesh = Load(kAscii);
  ASSERT_EQ(mesh.vertices.size(), 4u);
  EXPECT_EQ(mesh.vertices[3], Eigen::Vector3d(0, 1, -1e-3));
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}));
}

TEST_F(PlyTest, BrokenFilesAreRefused) {
  const auto edited = [](const std::string& from, const std::string& to) {
    std::string text = kAscii;
    return text.replace(text.find(from), from.size(), to);
  };
  EXPECT_THAT(ErrorOf("solid cube\n"), HasSubstr("not a PLY file"));
  EXPECT_THAT(ErrorOf(""), HasSubstr("not a PLY file"));
  EXPECT_THAT(ErrorOf("ply\nformat ascii 1.0\n"), HasSubstr("without an end"));
  EXPECT_THAT(ErrorOf(edited("ascii", "binary_big_endian")),
              HasSubstr("'binary_big_endian' is not supported"));
  EXPECT_THAT(ErrorOf(edited("double x", "quad x")),
              HasSubstr("unknown PLY type 'quad'"));
  EXPECT_THAT(ErrorOf(edited("double x", "double w")),
              HasSubstr("without 'x'"));
  EXPECT_THAT(ErrorOf(edited("4 0 1 2 3", "4 0 1 2 4")),
              HasSubstr("vertex 4 of 4"));
  EXPECT_THAT(ErrorOf(edited("4 0 1 2 3", "4 0 1 2 -1")),
              HasSubstr("bad vertex index"));
  EXPECT_THAT(ErrorOf(edited("4 0 1 2 3", "2 0 1")),
              HasSubstr("fewer than 3 corners"));
  EXPECT_THAT(ErrorOf(edited("4 0 1 2 3", "4 0 1")),
              HasSubstr("ends too early"));
  EXPECT_THAT(ErrorOf(edited("vertex 4", "vertex 4000000000")),
              HasSubstr("ends too early"));
  EXPECT_THAT(ErrorOf(edited("1 0 0 0", "1 0 nan 0")),
              HasSubstr("vertex 1 is not finite"));
  EXPECT_THAT(ErrorOf(edited("1 0 0 0", "1 0 x 0")),
              HasSubstr("'x' is not a number"));
  EXPECT_THAT(ErrorOf("x"), HasSubstr(path_));

  SavePly(Cube(1, {0, 0, 0}), path_);
  const std::string sound = ReadWholeFile(path_);
  EXPECT_THAT(ErrorOf(sound.substr(0, sound.size() - 1)),
              HasSubstr("ends too early"));
  EXPECT_THROW(LoadPly("/no/such/mesh.ply"), InputError);
  EXPECT_THROW(SavePly(TriangleMesh(), "/no/such/folder/mesh.ply"), InputError);
}

}  // namespace
}  // namespace sweepfit
