// SPDX-License-Identifier: Apache-2.0
// Reading and writing PLY files.
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "model/file_io.h"
#include "model/input_error.h"
#include "model/mesh.h"

namespace sweepfit {
namespace {

static_assert(std::endian::native == std::endian::little);

enum class Scalar {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kFloat32,
  kFloat64
};

struct Property {
  std::string name;
  Scalar type = Scalar::kFloat32;
  bool is_list = false;
  Scalar count_type = Scalar::kUint8;  // of a list
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  bool ascii = false;
  std::vector<Element> elements;
  std::size_t size = 0;  // bytes
};

[[noreturn]] void Fail(const std::string& path, const std::string& what) {
  throw InputError(path + ": " + what);
}

Scalar ParseScalar(const std::string& word, const std::string& path) {
  static const std::array<std::array<std::string_view, 2>, 8> kNames = {
      {{"char", "int8"},
       {"uchar", "uint8"},
       {"short", "int16"},
       {"ushort", "uint16"},
       {"int", "int32"},
       {"uint", "uint32"},
       {"float", "float32"},
       {"double", "float64"}}};
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (word == kNames[i][0] || word == kNames[i][1]) {
      return static_cast<Scalar>(i);
    }
  }
  Fail(path, "unknown PLY type '" + word + "'");
}

Property ParseProperty(std::istringstream* words, const std::string& path) {
  Property property;
  std::string type;
  *words >> type;
  if (type == "list") {
    property.is_list = true;
    std::string count_type;
    *words >> count_type >> type;
    property.count_type = ParseScalar(count_type, path);
  }
  property.type = ParseScalar(type, path);
  if (!(*words >> property.name)) Fail(path, "PLY property without a name");
  return property;
}

Header ParseHeader(const std::string& bytes, const std::string& path) {
  Header header;
  std::string format;
  std::size_t begin = 0;
  for (bool is_first = true;; is_first = false) {
    const std::size_t end = bytes.find('\n', begin);
    if (end == std::string::npos) {
      Fail(path, is_first ? "not a PLY file" : "PLY header without an end");
    }
    std::string line = bytes.substr(begin, end - begin);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    begin = end + 1;
    if (is_first) {
      if (line != "ply") Fail(path, "not a PLY file");
      continue;
    }
    std::istringstream words(line);
    std::string keyword;
    words >> keyword;
    if (keyword == "end_header") break;
    if (keyword == "format") {
      words >> format;
    } else if (keyword == "element") {
      Element element;
      if (!(words >> element.name >> element.count)) {
        Fail(path, "bad PLY header line '" + line + "'");
      }
      header.elements.push_back(element);
    } else if (keyword == "property") {
      if (header.elements.empty()) Fail(path, "PLY property of no element");
      header.elements.back().properties.push_back(ParseProperty(&words, path));
    } else if (!keyword.empty() && keyword != "comment" &&
               keyword != "obj_info") {
      Fail(path, "bad PLY header line '" + line + "'");
    }
  }
  if (format != "ascii" && format != "binary_little_endian") {
    Fail(path, "PLY format '" + format + "' is not supported");
  }
  header.ascii = format == "ascii";
  header.size = begin;
  return header;
}

// Takes numbers from the body of a PLY file.
class BodyReader {
 public:
  BodyReader(std::string_view bytes, bool ascii, const std::string& path)
      : bytes_(bytes), ascii_(ascii), path_(path) {}

  double Number(Scalar type) {
    if (ascii_) return AsciiNumber();
    switch (type) {
      case Scalar::kInt8:
        return Binary<std::int8_t>();
      case Scalar::kUint8:
        return Binary<std::uint8_t>();
      case Scalar::kInt16:
        return Binary<std::int16_t>();
      case Scalar::kUint16:
        return Binary<std::uint16_t>();
      case Scalar::kInt32:
        return Binary<std::int32_t>();
      case Scalar::kUint32:
        return Binary<std::uint32_t>();
      case Scalar::kFloat32:
        return Binary<float>();
      case Scalar::kFloat64:
        return Binary<double>();
    }
    return 0;
  }

  std::size_t remaining() const { return bytes_.size() - at_; }

 private:
  template <typename T>
  double Binary() {
    if (remaining() < sizeof(T)) Fail(path_, "ends too early");
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return static_cast<double>(value);
  }

  double AsciiNumber() {
    constexpr std::string_view kSpace = " \t\r\n";
    at_ = bytes_.find_first_not_of(kSpace, at_);
    if (at_ == std::string_view::npos) Fail(path_, "ends too early");
    const std::size_t end =
        std::min(bytes_.find_first_of(kSpace, at_), bytes_.size());
    double value = 0;
    const auto [stop, error] =
        std::from_chars(bytes_.data() + at_, bytes_.data() + end, value);
    if (error != std::errc() || stop != bytes_.data() + end) {
      Fail(path_,
           "'" + std::string(bytes_.substr(at_, end - at_)) +
               "' is not a number");
    }
    at_ = end;
    return value;
  }

  std::string_view bytes_;
  bool ascii_;
  const std::string& path_;
  std::size_t at_ = 0;
};

// One element: the scalars, and the last list, by property.
struct Item {
  std::vector<double> scalars;
  std::vector<double> list;
};

void ReadItem(const Element& element,
              const std::string& path,
              BodyReader* reader,
              Item* item) {
  item->scalars.clear();
  for (const Property& property : element.properties) {
    if (!property.is_list) {
      item->scalars.push_back(reader->Number(property.type));
      continue;
    }
    const double count = reader->Number(property.count_type);
    if (!(count >= 0) || count > static_cast<double>(reader->remaining())) {
      Fail(path, "impossible length of PLY list '" + property.name + "'");
    }
    const bool is_indices =
        property.name == "vertex_indices" || property.name == "vertex_index";
    if (is_indices) item->list.clear();
    for (int i = 0; i < static_cast<int>(count); ++i) {
      const double value = reader->Number(property.type);
      if (is_indices) item->list.push_back(value);
    }
    item->scalars.push_back(0);  // keeps the order of the properties
  }
}

int FindProperty(const Element& element,
                 const std::string& name,
                 const std::string& path) {
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const Property& property = element.properties[i];
    if (property.name == name && !property.is_list) return static_cast<int>(i);
  }
  Fail(path, "PLY vertices without '" + name + "'");
}

void ReadVertices(const Element& element,
                  const std::string& path,
                  BodyReader* reader,
                  TriangleMesh* mesh) {
  const std::array<int, 3> at = {FindProperty(element, "x", path),
                                 FindProperty(element, "y", path),
                                 FindProperty(element, "z", path)};
  Item item;
  for (std::size_t i = 0; i < element.count; ++i) {
    ReadItem(element, path, reader, &item);
    const Eigen::Vector3d vertex(
        item.scalars[at[0]], item.scalars[at[1]], item.scalars[at[2]]);
    if (!vertex.allFinite()) {
      Fail(path, "vertex " + std::to_string(i) + " is not finite");
    }
    mesh->vertices.push_back(vertex);
  }
}

// Faces with more than three corners become fans. Indices are checked when
// all vertices are known.
void ReadFaces(const Element& element,
               const std::string& path,
               BodyReader* reader,
               TriangleMesh* mesh) {
  Item item;
  for (std::size_t i = 0; i < element.count; ++i) {
    item.list.clear();
    ReadItem(element, path, reader, &item);
    if (item.list.size() < 3) {
      Fail(path, "face " + std::to_string(i) + " has fewer than 3 corners");
    }
    std::vector<int> corners;
    for (const double value : item.list) {
      if (!(value >= 0 && value <= INT32_MAX) || value != std::floor(value)) {
        Fail(path, "face " + std::to_string(i) + " has a bad vertex index");
      }
      corners.push_back(static_cast<int>(value));
    }
    for (std::size_t k = 1; k + 1 < corners.size(); ++k) {
      mesh->triangles.push_back({corners[0], corners[k], corners[k + 1]});
    }
  }
}

template <typename T>
void Append(T value, std::string* bytes) {
  std::array<char, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof(T));
  bytes->append(raw.data(), raw.size());
}

}  // namespace

void SavePly(const TriangleMesh& mesh, const std::string& path) {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex " +
      std::to_string(mesh.vertices.size()) +
      "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
      std::to_string(mesh.triangles.size()) +
      "\nproperty list uchar int vertex_indices\nend_header\n";
  bytes.reserve(bytes.size() + 12 * mesh.vertices.size() +
                13 * mesh.triangles.size());
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    for (int i = 0; i < 3; ++i) Append(static_cast<float>(vertex[i]), &bytes);
  }
  for (const Triangle& triangle : mesh.triangles) {
    Append(std::uint8_t{3}, &bytes);
    for (const int index : triangle) Append(std::int32_t{index}, &bytes);
  }
  WriteWholeFile(bytes, path);
}

TriangleMesh LoadPly(const std::string& path) {
  const std::string bytes = ReadWholeFile(path);
  const Header header = ParseHeader(bytes, path);
  BodyReader reader(
      std::string_view(bytes).substr(header.size), header.ascii, path);
  TriangleMesh mesh;
  bool has_vertices = false;
  for (const Element& element : header.elements) {
    // Every element takes at least a byte: a larger count is a lie that must
    // not run for hours.
    if (element.count > reader.remaining()) Fail(path, "ends too early");
    if (element.name == "vertex") {
      has_vertices = true;
      ReadVertices(element, path, &reader, &mesh);
    } else if (element.name == "face") {
      ReadFaces(element, path, &reader, &mesh);
    } else {
      Item item;
      for (std::size_t i = 0; i < element.count; ++i) {
        ReadItem(element, path, &reader, &item);
      }
    }
  }
  if (!has_vertices) Fail(path, "PLY file without vertices");
  for (const Triangle& triangle : mesh.triangles) {
    for (const int index : triangle) {
      if (index >= static_cast<int>(mesh.vertices.size())) {
        Fail(path,
             "face refers to vertex " + std::to_string(index) + " of " +
                 std::to_string(mesh.vertices.size()));
      }
    }
  }
  return mesh;
}

}  // namespace sweepfit
