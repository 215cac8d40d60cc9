// SPDX-License-Identifier: Apache-2.0
#include "model/obj.h"

#include <glog/logging.h>

#include <cstdio>
#include <filesystem>

#include "model/file_io.h"
#include "model/mesh.h"

namespace sweepfit {
namespace {

template <typename... Values>
void Line(std::string* text, const char* format, Values... values) {
  char line[160];
  std::snprintf(line, sizeof(line), format, values...);
  *text += line;
}

}  // namespace

void SaveObj(const BodyTopology& topology,
             const std::vector<Eigen::Vector3d>& vertices,
             const std::string& texture,
             const std::string& path) {
  CHECK_EQ(topology.uv.size(), topology.quads.size());
  const std::vector<Eigen::Vector3d> normals =
      VertexNormals({vertices, TriangulateQuads(topology.quads, vertices)});
  std::string text = "# metres, y up\n";
  if (!texture.empty()) {
    std::filesystem::path material = path;
    material.replace_extension(".mtl");
    WriteWholeFile("newmtl body\nKd 1 1 1\nKs 0 0 0\nmap_Kd " + texture + "\n",
                   material.string());
    text += "mtllib " + material.filename().string() + "\nusemtl body\n";
  }
  for (const Eigen::Vector3d& x : vertices) {
    Line(&text, "v %.9g %.9g %.9g\n", x.x(), x.y(), x.z());
  }
  for (const Eigen::Vector3d& n : normals) {
    Line(&text, "vn %.6f %.6f %.6f\n", n.x(), n.y(), n.z());
  }
  for (std::size_t q = 0; q < topology.quads.size(); ++q) {
    for (int corner = 0; corner < NumCorners(topology.quads[q]); ++corner) {
      const Eigen::Vector2f& uv = topology.uv[q][corner];
      Line(&text,
           "vt %.7f %.7f\n",
           static_cast<double>(uv.x()),
           static_cast<double>(uv.y()));
    }
  }
  // Every corner has a texture coordinate of its own, numbered from 1.
  int uv = 0;
  for (const Quad& quad : topology.quads) {
    text += "f";
    for (int corner = 0; corner < NumCorners(quad); ++corner) {
      const int v = quad[corner] + 1;
      Line(&text, " %d/%d/%d", v, ++uv, v);
    }
    text += "\n";
  }
  WriteWholeFile(text, path);
}

}  // namespace sweepfit
