// SPDX-License-Identifier: Apache-2.0
#include "model/obj.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>

#include "model/file_io.h"
#include "model/input_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

TEST(SaveObj, HoldsTheMeshAndItsTexture) {
  const TemporaryFolder folder;
  const Body body = ToyBody(8);
  const std::vector<Eigen::Vector3d> vertices = RestVertices(body);
  const std::string path = (folder.path() / "body.obj").string();
  SaveObj(body.topology, vertices, "texture.png", path);
  std::istringstream text(ReadWholeFile(path));
  std::string line;
  std::vector<Eigen::Vector3d> read;
  std::size_t num_uv = 0, num_normals = 0, num_faces = 0;
  while (std::getline(text, line)) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    if (kind == "v") {
      Eigen::Vector3d x;
      words >> x.x() >> x.y() >> x.z();
      read.push_back(x);
    }
    num_uv += kind == "vt";
    num_normals += kind == "vn";
    if (kind != "f") continue;
    const Quad& quad = body.topology.quads[num_faces];
    for (int corner = 0; corner < 4; ++corner) {
      std::size_t v = 0, uv = 0, n = 0;
      char slash = 0;
      words >> v >> slash >> uv >> slash >> n;
      EXPECT_EQ(v, static_cast<std::size_t>(quad[corner]) + 1);
      EXPECT_EQ(uv, 4 * num_faces + corner + 1);
      EXPECT_EQ(n, v);
    }
    ++num_faces;
  }
  ASSERT_EQ(read.size(), vertices.size());
  for (std::size_t v = 0; v < read.size(); ++v) {
    EXPECT_LT((read[v] - vertices[v]).norm(), 1e-8);
  }
  EXPECT_EQ(num_normals, vertices.size());
  EXPECT_EQ(num_uv, 4 * body.topology.quads.size());
  EXPECT_EQ(num_faces, body.topology.quads.size());
  const std::string material =
      ReadWholeFile((folder.path() / "body.mtl").string());
  EXPECT_NE(material.find("map_Kd texture.png"), std::string::npos);
  EXPECT_THROW(SaveObj(body.topology,
                       vertices,
                       "",
                       (folder.path() / "none" / "body.obj").string()),
               InputError);
}

TEST(SaveObj, WritesTrianglesAsTriangles) {
  const TemporaryFolder folder;
  Body body = ToyBody(8);
  body.topology.quads[0][3] = body.topology.quads[0][2];
  const std::string path = (folder.path() / "body.obj").string();
  SaveObj(body.topology, RestVertices(body), "", path);
  const std::string text = ReadWholeFile(path);
  std::istringstream faces(text.substr(text.find("\nf ") + 1));
  std::string first, second;
  std::getline(faces, first);
  std::getline(faces, second);
  const Quad& triangle = body.topology.quads[0];
  std::string expected = "f";
  for (int i = 0; i < 3; ++i) {
    const std::string v = std::to_string(triangle[i] + 1);
    expected += " " + v + "/" + std::to_string(i + 1) + "/" + v;
  }
  EXPECT_EQ(first, expected);
  // Texture coordinates are counted as they are written.
  EXPECT_NE(second.find("/4/"), std::string::npos);
  EXPECT_NE(second.find("/7/"), std::string::npos);
}

}  // namespace
}  // namespace sweepfit
