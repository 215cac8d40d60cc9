// SPDX-License-Identifier: Apache-2.0
// Pictures of a mesh as a camera sees it.
#include "capture/render.h"

#include <glog/logging.h>
#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "capture/colour.h"

namespace sweepfit {
namespace {

// Geometry nearer than this is cut off, metres.
constexpr double kNear = 1e-3;

// The part of a triangle before the camera: up to four corners, camera frame.
struct ClippedTriangle {
  std::array<Eigen::Vector3d, 4> corner;
  int count = 0;
};

ClippedTriangle ClipAtNear(const std::array<Eigen::Vector3d, 3>& triangle) {
  ClippedTriangle result;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d& a = triangle[i];
    const Eigen::Vector3d& b = triangle[(i + 1) % 3];
    if (a.z() >= kNear) result.corner[result.count++] = a;
    if ((a.z() >= kNear) != (b.z() >= kNear)) {
      const double t = (kNear - a.z()) / (b.z() - a.z());
      result.corner[result.count++] = a + t * (b - a);
    }
  }
  return result;
}

// Yes-or-no samples of a picture, several to a pixel along each axis. Sample i
// lies at (i + 0.5) / n - 0.5 pixels.
class SampleGrid {
 public:
  SampleGrid(cv::Size pixels, int per_pixel)
      : per_pixel_(per_pixel),
        samples_(pixels.height * per_pixel,
                 pixels.width * per_pixel,
                 std::uint8_t{0}) {}

  double ToSample(double pixel) const {
    return (pixel + 0.5) * per_pixel_ - 0.5;
  }
  double ToPixel(double sample) const {
    return (sample + 0.5) / per_pixel_ - 0.5;
  }

  // Marks the samples inside a triangle given in pixels.
  void Fill(const std::array<Eigen::Vector2d, 3>& triangle) {
    std::array<Eigen::Vector2d, 3> p;
    for (int i = 0; i < 3; ++i) {
      p[i] = {ToSample(triangle[i].x()), ToSample(triangle[i].y())};
    }
    const auto [low, high] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
    const int first = static_cast<int>(std::max(0.0, std::ceil(low)));
    const int last =
        static_cast<int>(std::min(samples_.rows - 1.0, std::floor(high)));
    for (int y = first; y <= last; ++y) FillRow(p, y);
  }

  cv::Mat1b& samples() { return samples_; }

  cv::Mat1f Average() const {
    const int n = per_pixel_;
    cv::Mat1f mean(samples_.rows / n, samples_.cols / n);
    for (int y = 0; y < mean.rows; ++y) {
      for (int x = 0; x < mean.cols; ++x) {
        int count = 0;
        for (int j = 0; j < n; ++j) {
          const std::uint8_t* row = samples_[y * n + j] + x * n;
          for (int i = 0; i < n; ++i) count += row[i];
        }
        mean(y, x) = static_cast<float>(count) / static_cast<float>(n * n);
      }
    }
    return mean;
  }

 private:
  void FillRow(const std::array<Eigen::Vector2d, 3>& p, int y) {
    double left = std::numeric_limits<double>::infinity();
    double right = -left;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector2d& a = p[i];
      const Eigen::Vector2d& b = p[(i + 1) % 3];
      if (std::min(a.y(), b.y()) > y || std::max(a.y(), b.y()) < y) continue;
      if (a.y() == b.y()) {
        left = std::min({left, a.x(), b.x()});
        right = std::max({right, a.x(), b.x()});
        continue;
      }
      const double x = a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
      left = std::min(left, x);
      right = std::max(right, x);
    }
    const int first = static_cast<int>(std::max(0.0, std::ceil(left)));
    const int last =
        static_cast<int>(std::min(samples_.cols - 1.0, std::floor(right)));
    if (first <= last) {
      std::fill(samples_[y] + first, samples_[y] + last + 1, std::uint8_t{1});
    }
  }

  int per_pixel_;
  cv::Mat1b samples_;
};

// Distorted pictures show straight edges bent. Triangles are small, so their
// corners are distorted and joined by straight lines; longer edges than this
// (pixels) are split first.
constexpr double kLongestEdge = 16;

void FillDistorted(const Camera& camera,
                   const std::array<Eigen::Vector3d, 3>& triangle_in_camera,
                   SampleGrid* grid) {
  std::array<Eigen::Vector2d, 3> pinhole, pixel;
  for (int i = 0; i < 3; ++i) {
    pinhole[i] = (camera.K * triangle_in_camera[i]).hnormalized();
  }
  // Far outside the picture the distortion model means nothing.
  const Eigen::Vector2d size(camera.width, camera.height);
  Eigen::Vector2d low = pinhole[0].cwiseMin(pinhole[1]).cwiseMin(pinhole[2]);
  Eigen::Vector2d high = pinhole[0].cwiseMax(pinhole[1]).cwiseMax(pinhole[2]);
  if ((low.array() > 1.5 * size.array()).any() ||
      (high.array() < -0.5 * size.array()).any()) {
    return;
  }
  if (camera.HasDistortion()) {
    int longest = 0;
    double length = 0;
    for (int i = 0; i < 3; ++i) {
      const double edge = (pinhole[(i + 1) % 3] - pinhole[i]).norm();
      if (edge > length) {
        length = edge;
        longest = i;
      }
    }
    if (length > kLongestEdge) {
      const Eigen::Vector3d& a = triangle_in_camera[longest];
      const Eigen::Vector3d& b = triangle_in_camera[(longest + 1) % 3];
      const Eigen::Vector3d& c = triangle_in_camera[(longest + 2) % 3];
      // The middle of the edge as seen.
      const Eigen::Vector3d middle =
          (a / a.z() + b / b.z()) / (1 / a.z() + 1 / b.z());
      FillDistorted(camera, {a, middle, c}, grid);
      FillDistorted(camera, {middle, b, c}, grid);
      return;
    }
  }
  for (int i = 0; i < 3; ++i) pixel[i] = camera.Distort(pinhole[i]);
  grid->Fill(pixel);
}

// sRGB code of a linear value 0..1.
std::uint8_t Encode(double linear) {
  const double v = linear <= 0.0031308
                       ? 12.92 * linear
                       : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
  return cv::saturate_cast<std::uint8_t>(255 * v);
}

// Linear colours of the vertices.
std::vector<cv::Vec3f> Decoded(const std::vector<cv::Vec3b>& vertex_color,
                               size_t num_vertices) {
  const std::array<float, 256>& table = LinearOfCode();
  constexpr std::uint8_t kPlainGrey = 200;
  if (vertex_color.empty()) {
    const float grey = table[kPlainGrey];
    return std::vector<cv::Vec3f>(num_vertices, {grey, grey, grey});
  }
  std::vector<cv::Vec3f> linear;
  linear.reserve(num_vertices);
  for (const cv::Vec3b& color : vertex_color) {
    linear.emplace_back(table[color[0]], table[color[1]], table[color[2]]);
  }
  return linear;
}

// What the rays of a camera meet, and how bright it is there.
class Shader {
 public:
  explicit Shader(const TriangleMesh& mesh)
      : mesh_(mesh), normals_(VertexNormals(mesh)), scene_(mesh) {}

  struct Spot {
    int triangle = -1;                   // -1: the background
    std::array<float, 3> light_share{};  // light times barycentric weight
  };
  Spot Shade(const Eigen::Vector3d& origin,
             const Eigen::Vector3d& direction) const {
    const RayScene::Hit hit = scene_.Intersect(origin, direction);
    if (hit.triangle < 0) return {};
    const Triangle& t = mesh_.triangles[hit.triangle];
    const std::array<double, 3> b = {1 - hit.b1 - hit.b2, hit.b1, hit.b2};
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    for (int i = 0; i < 3; ++i) normal += b[i] * normals_[t[i]];
    normal.normalize();
    // Soft light from the camera with a little from above.
    const double facing = std::abs(normal.dot(direction));
    const double from_above = 0.5 + 0.5 * normal.y();
    const double light = 0.15 + 0.65 * facing + 0.2 * from_above;
    Spot spot{hit.triangle, {}};
    for (int i = 0; i < 3; ++i) {
      spot.light_share[i] = static_cast<float>(light * b[i]);
    }
    return spot;
  }

  cv::Vec3f Color(const Spot& spot,
                  const std::vector<cv::Vec3f>& linear_color) const {
    if (spot.triangle < 0) return {1, 1, 1};
    const Triangle& t = mesh_.triangles[spot.triangle];
    cv::Vec3f color(0, 0, 0);
    for (int i = 0; i < 3; ++i) {
      color += spot.light_share[i] * linear_color[t[i]];
    }
    return color;
  }

 private:
  const TriangleMesh& mesh_;
  std::vector<Eigen::Vector3d> normals_;
  RayScene scene_;
};

}  // namespace

cv::Rect BoxOfMesh(const Camera& pinhole,
                   const TriangleMesh& mesh,
                   double margin) {
  constexpr double kBeside = 0.1;  // metres
  const cv::Rect frame(0, 0, pinhole.width, pinhole.height);
  Eigen::Array2d low(pinhole.width, pinhole.height), high(0, 0);
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    if (pinhole.PointInCamera(vertex).z() < kBeside) return frame;
    const Eigen::Array2d pixel = pinhole.ProjectPinhole(vertex).array();
    low = low.min(pixel);
    high = high.max(pixel);
  }
  low = (low - margin).floor().max(0);
  high =
      (high + margin).ceil().min(Eigen::Array2d(pinhole.width, pinhole.height));
  if (!((high - low).minCoeff() >= 1)) return frame;
  return cv::Rect(
      cv::Point(static_cast<int>(low.x()), static_cast<int>(low.y())),
      cv::Point(static_cast<int>(high.x()), static_cast<int>(high.y())));
}

cv::Mat1f RenderCoverage(const Camera& camera,
                         const TriangleMesh& mesh,
                         int supersample) {
  CHECK_GE(supersample, 1);
  std::vector<Eigen::Vector3d> in_camera;
  in_camera.reserve(mesh.vertices.size());
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    in_camera.push_back(camera.PointInCamera(vertex));
  }
  SampleGrid grid(cv::Size(camera.width, camera.height), supersample);
  for (const Triangle& t : mesh.triangles) {
    const ClippedTriangle clipped =
        ClipAtNear({in_camera[t[0]], in_camera[t[1]], in_camera[t[2]]});
    for (int i = 1; i + 1 < clipped.count; ++i) {
      FillDistorted(
          camera,
          {clipped.corner[0], clipped.corner[i], clipped.corner[i + 1]},
          &grid);
    }
  }
  return grid.Average();
}

cv::Mat3b RenderShaded(const Camera& camera,
                       const TriangleMesh& mesh,
                       const std::vector<cv::Vec3b>& vertex_color) {
  return RenderColorings(camera, mesh, {vertex_color}).front();
}

std::vector<cv::Mat3b> RenderColorings(
    const Camera& camera,
    const TriangleMesh& mesh,
    const std::vector<std::vector<cv::Vec3b>>& vertex_colors) {
  constexpr int kSamples = 2;  // along each axis of a pixel
  const size_t num = vertex_colors.size();
  std::vector<std::vector<cv::Vec3f>> linear;
  std::vector<cv::Mat3b> pictures;
  for (const std::vector<cv::Vec3b>& color : vertex_colors) {
    CHECK(color.empty() || color.size() == mesh.vertices.size());
    linear.push_back(Decoded(color, mesh.vertices.size()));
    pictures.emplace_back(
        camera.height, camera.width, cv::Vec3b(255, 255, 255));
  }
  const Shader shader(mesh);
  const Eigen::Vector3d origin = camera.CenterInWorld();
  const Eigen::Matrix3d ray_by_pixel =
      camera.camera_from_world.transpose() * camera.K.inverse();
  const cv::Rect box = camera.HasDistortion()
                           ? cv::Rect(0, 0, camera.width, camera.height)
                           : BoxOfMesh(camera, mesh, 1);
  tbb::parallel_for(box.y, box.y + box.height, [&](int y) {
    std::array<Shader::Spot, kSamples * kSamples> spots;
    for (int x = box.x; x < box.x + box.width; ++x) {
      bool is_background = true;
      for (int s = 0; s < kSamples * kSamples; ++s) {
        const Eigen::Vector2d pixel(x + (s % kSamples + 0.5) / kSamples - 0.5,
                                    y + (s / kSamples + 0.5) / kSamples - 0.5);
        const Eigen::Vector3d ray =
            ray_by_pixel * camera.Undistort(pixel).homogeneous();
        spots[s] = shader.Shade(origin, ray.normalized());
        is_background = is_background && spots[s].triangle < 0;
      }
      if (is_background) continue;
      for (size_t i = 0; i < num; ++i) {
        cv::Vec3f sum(0, 0, 0);
        for (const Shader::Spot& spot : spots) {
          sum += shader.Color(spot, linear[i]);
        }
        sum *= 1.0F / (kSamples * kSamples);
        pictures[i](y, x) = {Encode(sum[0]), Encode(sum[1]), Encode(sum[2])};
      }
    }
  });
  return pictures;
}

Camera LookAtMesh(const TriangleMesh& mesh,
                  double azimuth_degrees,
                  double elevation_degrees,
                  int width,
                  int height) {
  constexpr double kDistance = 4;  // in half diagonals of the mesh
  constexpr double kMargin = 1.05;
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& vertex : mesh.vertices) box.extend(vertex);
  CHECK(!box.isEmpty());
  const double radius = std::max(0.5 * box.diagonal().norm(), 1e-6);
  const double azimuth = azimuth_degrees * std::numbers::pi / 180;
  const double elevation = elevation_degrees * std::numbers::pi / 180;
  const Eigen::Vector3d backward(std::sin(azimuth) * std::cos(elevation),
                                 std::sin(elevation),
                                 std::cos(azimuth) * std::cos(elevation));
  const Eigen::Vector3d right(std::cos(azimuth), 0, -std::sin(azimuth));
  Camera camera;
  camera.id = "view";
  camera.width = width;
  camera.height = height;
  camera.camera_from_world.row(0) = right;
  camera.camera_from_world.row(1) = -backward.cross(right);
  camera.camera_from_world.row(2) = -backward;
  const Eigen::Vector3d center = box.center() + kDistance * radius * backward;
  camera.world_in_camera = -camera.camera_from_world * center;
  // The focal length that just fits the mesh into the picture.
  double focal = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    const Eigen::Vector3d p = camera.PointInCamera(vertex);
    focal = std::min({focal,
                      0.5 * width * p.z() / std::max(std::abs(p.x()), 1e-9),
                      0.5 * height * p.z() / std::max(std::abs(p.y()), 1e-9)});
  }
  focal /= kMargin;
  camera.K << focal, 0, 0.5 * (width - 1), 0, focal, 0.5 * (height - 1), 0, 0,
      1;
  return camera;
}

}  // namespace sweepfit
