// SPDX-License-Identifier: Apache-2.0
#include "experiments/motion_preview.h"

#include <glog/logging.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/camera.h"
#include "capture/colour.h"
#include "experiments/animated_webp.h"
#include "experiments/synthetic_raster.h"
#include "model/file_io.h"
#include "model/input_error.h"
#include "model/mesh.h"

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Linear RGB.
const Vector3d kSky(0.80, 0.84, 0.88);
const Vector3d kTile(0.60, 0.61, 0.62);
const Vector3d kOtherTile(0.52, 0.53, 0.55);
const Vector3d kPlainSkin(0.55, 0.55, 0.55);
constexpr double kTileSize = 0.5;  // metres
// Towards the lamp.
const Vector3d kLamp = Vector3d(-0.35, 1, 0.45).normalized();

double EncodeSrgb(double linear) {
  const double v = std::clamp(linear, 0.0, 1.0);
  return 255 *
         (v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055);
}

// A texture in linear RGB.
class Texture {
 public:
  explicit Texture(const cv::Mat3b& bgr) {
    const std::array<float, 256>& table = LinearOfCode();
    rgb_.create(bgr.size());
    for (int y = 0; y < bgr.rows; ++y) {
      for (int x = 0; x < bgr.cols; ++x) {
        const cv::Vec3b& code = bgr(y, x);
        rgb_(y, x) = {table[code[2]], table[code[1]], table[code[0]]};
      }
    }
  }

  // Bilinear; v up.
  Vector3d At(const Vector2d& uv) const {
    if (rgb_.empty()) return kPlainSkin;
    const double x = std::clamp(uv.x() * rgb_.cols - 0.5, 0.0, rgb_.cols - 1.0);
    const double y =
        std::clamp((1 - uv.y()) * rgb_.rows - 0.5, 0.0, rgb_.rows - 1.0);
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const int x1 = std::min(x0 + 1, rgb_.cols - 1);
    const int y1 = std::min(y0 + 1, rgb_.rows - 1);
    const float fx = static_cast<float>(x - x0);
    const float fy = static_cast<float>(y - y0);
    const cv::Vec3f color =
        (rgb_(y0, x0) * (1 - fx) + rgb_(y0, x1) * fx) * (1 - fy) +
        (rgb_(y1, x0) * (1 - fx) + rgb_(y1, x1) * fx) * fy;
    return {color[0], color[1], color[2]};
  }

 private:
  cv::Mat3f rgb_;
};

// How dark the floor is: 1 in full shadow.
class FloorShadow {
 public:
  FloorShadow(const TriangleMesh& mesh, const Vector2d& middle)
      : corner_(middle.array() - kHalf) {
    const int size = static_cast<int>(2 * kHalf / kTexel);
    cast_ = cv::Mat1b::zeros(size, size);
    contact_ = cv::Mat1b::zeros(size, size);
    for (const Triangle& triangle : mesh.triangles) {
      Fill(mesh, triangle, kLamp, &cast_);
      // What is close to the floor keeps the sky's light away too.
      constexpr double kClose = 0.12;
      double highest = 0;
      for (const int v : triangle) {
        highest = std::max(highest, mesh.vertices[v].y());
      }
      if (highest < kClose) {
        Fill(mesh, triangle, Vector3d::UnitY(), &contact_);
      }
    }
    cv::GaussianBlur(cast_, cast_, cv::Size(), 0.03 / kTexel);
    cv::GaussianBlur(contact_, contact_, cv::Size(), 0.025 / kTexel);
  }

  double At(const Vector2d& floor) const {
    const Vector2d at = (floor - corner_) / kTexel;
    const int x = static_cast<int>(std::floor(at.x()));
    const int y = static_cast<int>(std::floor(at.y()));
    if (x < 0 || y < 0 || x + 1 >= cast_.cols || y + 1 >= cast_.rows) return 0;
    const double fx = at.x() - x, fy = at.y() - y;
    const auto sample = [&](const cv::Mat1b& map) {
      return ((map(y, x) * (1 - fx) + map(y, x + 1) * fx) * (1 - fy) +
              (map(y + 1, x) * (1 - fx) + map(y + 1, x + 1) * fx) * fy) /
             255;
    };
    return std::min(1.0, 0.55 * sample(cast_) + 0.45 * sample(contact_));
  }

 private:
  static constexpr double kHalf = 2.5;     // metres
  static constexpr double kTexel = 0.008;  // metres

  void Fill(const TriangleMesh& mesh,
            const Triangle& triangle,
            const Vector3d& towards_light,
            cv::Mat1b* map) const {
    constexpr int kShift = 4;
    std::array<cv::Point, 3> points;
    for (int i = 0; i < 3; ++i) {
      const Vector3d& v = mesh.vertices[triangle[i]];
      const Vector3d on_floor = v - v.y() / towards_light.y() * towards_light;
      const Vector2d at = (Vector2d(on_floor.x(), on_floor.z()) - corner_) /
                          kTexel * (1 << kShift);
      if (at.cwiseAbs().maxCoeff() > 1e8) return;
      points[i] = cv::Point(static_cast<int>(std::lround(at.x())),
                            static_cast<int>(std::lround(at.y())));
    }
    cv::fillConvexPoly(*map, points.data(), 3, 255, cv::LINE_8, kShift);
  }

  Vector2d corner_;  // x and z of the first texel
  cv::Mat1b cast_, contact_;
};

// Share of a tile of one colour under a pixel: the checker averaged over a
// footprint of `size` metres.
double CheckerShare(const Vector2d& floor, double size) {
  const auto triangle_wave = [](double t) {
    return std::abs(std::remainder(t, 2.0)) - 0.5;
  };
  const double sharpness = kTileSize / std::max(size, 1e-6);
  double product = 1;
  for (int i = 0; i < 2; ++i) {
    product *= std::clamp(
        2 * triangle_wave(floor[i] / kTileSize) * sharpness, -1.0, 1.0);
  }
  return 0.5 + 0.5 * product;
}

std::vector<Vector2d> SmoothPath(const std::vector<Pose>& poses, double sigma) {
  std::vector<Vector2d> path;
  const int num = static_cast<int>(poses.size());
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  for (int t = 0; t < num; ++t) {
    Vector2d sum = Vector2d::Zero();
    double weights = 0;
    for (int k = t - reach; k <= t + reach; ++k) {
      // Beyond the ends the way goes on as it was.
      const int inside = std::clamp(k, 0, num - 1);
      const int mirrored = std::clamp(2 * inside - k, 0, num - 1);
      const auto at = [&](int i) {
        return Vector2d(poses[i].root_in_world.x(), poses[i].root_in_world.z());
      };
      const double z = sigma > 0 ? (k - t) / sigma : 0;
      const double weight = std::exp(-0.5 * z * z);
      sum += weight * (2 * at(inside) - at(mirrored));
      weights += weight;
    }
    path.push_back(sum / weights);
  }
  return path;
}

// Where the person goes, or faces when it does not go anywhere; radians from +Z
// towards +X.
double Heading(const std::vector<Pose>& poses) {
  const Vector3d way = poses.back().root_in_world - poses.front().root_in_world;
  constexpr double kGoes = 0.5;  // metres
  Vector3d heading(way.x(), 0, way.z());
  if (heading.norm() < kGoes) {
    heading.setZero();
    for (const Pose& pose : poses) {
      heading += pose.rotation[kRoot] * Vector3d::UnitZ();
    }
  }
  return std::atan2(heading.x(), heading.z());
}

void Label(const std::string& text, cv::Mat3b* picture) {
  cv::putText(*picture,
              text,
              cv::Point(8, 20),
              cv::FONT_HERSHEY_SIMPLEX,
              0.5,
              cv::Scalar(60, 60, 60),
              1,
              cv::LINE_AA);
}

}  // namespace

struct MotionPreview::Impl {
  const Body& body;
  BodyDeformer deformer;
  Texture texture;
  std::vector<Pose> poses;
  double pose_time;
  PreviewOptions options;
  std::vector<Vector2d> path;  // of the camera's target, x and z
  double azimuth = 0;          // of the camera
  double floor_height = 0;
  double stature = 0;
  std::vector<Triangle> triangles;
  std::vector<std::array<Vector2d, 3>> triangle_uv;
  int num_frames = 0;

  Impl(const Body& body_in,
       const cv::Mat3b& texture_in,
       std::vector<Pose> poses_in,
       double frame_time,
       const PreviewOptions& options_in)
      : body(body_in),
        deformer(body_in),
        texture(texture_in),
        poses(std::move(poses_in)),
        pose_time(frame_time),
        options(options_in) {
    CHECK(!poses.empty());
    CHECK_GT(pose_time, 0);
    CHECK(!options.Check());
    path = SmoothPath(poses, 0.4 / pose_time);
    azimuth = Heading(poses) + options.azimuth * std::numbers::pi / 180;
    const std::vector<Vector3d>& rest = deformer.rest_vertices();
    double low = 0, high = 0;
    for (const Vector3d& vertex : rest) {
      low = std::min(low, vertex.y());
      high = std::max(high, vertex.y());
    }
    stature = high - low;
    for (std::size_t q = 0; q < body.topology.quads.size(); ++q) {
      const Quad& quad = body.topology.quads[q];
      for (const auto& corner :
           {std::array<int, 3>{0, 1, 2}, std::array<int, 3>{0, 2, 3}}) {
        Triangle triangle;
        std::array<Vector2d, 3> uv;
        for (int i = 0; i < 3; ++i) {
          triangle[i] = quad[corner[i]];
          uv[i] = body.topology.uv[q][corner[i]].cast<double>();
        }
        if (triangle[1] == triangle[2]) continue;  // of IsTriangle
        triangles.push_back(triangle);
        triangle_uv.push_back(uv);
      }
    }
    const double duration =
        std::min(options.longest, pose_time * (poses.size() - 1.0));
    num_frames = 1 + static_cast<int>(std::floor(
                         duration * options.frames_per_second + 1e-3));
  }

  int PoseAt(int frame) const {
    const double pose = frame / (options.frames_per_second * pose_time);
    return std::min(static_cast<int>(std::lround(pose)),
                    static_cast<int>(poses.size()) - 1);
  }

  // Looks at the middle of a body on the path, a little from above.
  Camera CameraAt(const Vector2d& target) const {
    constexpr double kElevation = 10 * std::numbers::pi / 180;
    constexpr double kDistance = 3.2;  // statures
    constexpr double kShown = 1.28;    // statures, in the picture's height
    Camera camera;
    camera.id = "preview";
    camera.width = options.width;
    camera.height = options.height;
    const Vector3d backward(std::sin(azimuth) * std::cos(kElevation),
                            std::sin(kElevation),
                            std::cos(azimuth) * std::cos(kElevation));
    const Vector3d right(std::cos(azimuth), 0, -std::sin(azimuth));
    camera.camera_from_world.row(0) = right;
    camera.camera_from_world.row(1) = -backward.cross(right);
    camera.camera_from_world.row(2) = -backward;
    const Vector3d center = Vector3d(target.x(), 0.5 * stature, target.y()) +
                            kDistance * stature * backward;
    camera.world_in_camera = -camera.camera_from_world * center;
    const double focal = options.height * kDistance / kShown;
    camera.K << focal, 0, 0.5 * (options.width - 1), 0, focal,
        0.5 * (options.height - 1), 0, 0, 1;
    return camera;
  }

  Vector3d Floor(const Camera& camera,
                 const FloorShadow& shadow,
                 double x,
                 double y) const {
    const Vector3d ray = camera.RayInWorld({x, y});
    const Vector3d eye = camera.CenterInWorld();
    if (ray.y() >= -1e-3) return kSky;
    const double distance = -eye.y() / ray.y();
    const Vector3d at = eye + distance * ray;
    const Vector2d floor(at.x(), at.z());
    const double footprint =
        distance / camera.FocalLength() / std::max(-ray.y(), 0.05);
    const double share = CheckerShare(floor, footprint);
    Vector3d color = share * kTile + (1 - share) * kOtherTile;
    color *= 1 - 0.8 * shadow.At(floor);
    // The floor fades into the background.
    const double away = (eye - at).norm() / stature;
    const double fade = std::clamp((away - 4) / 8, 0.0, 1.0);
    return (1 - fade) * color + fade * kSky;
  }

  cv::Mat3b Render(int frame) const {
    const int at = PoseAt(frame);
    TriangleMesh mesh{deformer.Vertices(poses[at]), triangles};
    const std::vector<Vector3d> normals = VertexNormals(mesh);
    const Camera camera = CameraAt(path[at]);
    // Someone may leap at the camera.
    for (Vector3d& vertex : mesh.vertices) {
      constexpr double kNear = 0.1;
      const double depth = camera.PointInCamera(vertex).z();
      if (depth < kNear) {
        vertex += (kNear - depth) * camera.camera_from_world.row(2).transpose();
      }
    }
    const FloorShadow shadow(mesh, path[at]);
    const Drawing drawing =
        DrawMesh(camera, mesh, [&](const SurfaceSample& sample) {
          const Triangle& triangle = triangles[sample.triangle];
          Vector3d normal = Vector3d::Zero();
          Vector2d uv = Vector2d::Zero();
          for (int i = 0; i < 3; ++i) {
            normal += sample.weights[i] * normals[triangle[i]];
            uv += sample.weights[i] * triangle_uv[sample.triangle][i];
          }
          normal.normalize();
          // Sky from above, a little from the floor, a wide lamp.
          const double sky = 0.5 + 0.5 * normal.y();
          const double lamp = std::max(0.0, (normal.dot(kLamp) + 0.3) / 1.3);
          const double light = 0.30 + 0.38 * sky + 0.62 * lamp;
          return Vector3d(light * texture.At(uv));
        });
    cv::Mat3b picture(options.height, options.width);
    for (int y = 0; y < options.height; ++y) {
      for (int x = 0; x < options.width; ++x) {
        const double covered = drawing.coverage(y, x);
        const cv::Vec3f& seen = drawing.color(y, x);
        Vector3d color(seen[0], seen[1], seen[2]);
        if (covered < 1) color += (1 - covered) * Floor(camera, shadow, x, y);
        for (int i = 0; i < 3; ++i) {
          picture(y, x)[2 - i] =
              cv::saturate_cast<std::uint8_t>(EncodeSrgb(color[i]));
        }
      }
    }
    return picture;
  }
};

std::optional<std::string> PreviewOptions::Check() const {
  if (width < 64 || height < 64 || width > 4096 || height > 4096) {
    return "a preview must have 64 to 4096 pixels along each side";
  }
  if (!(frames_per_second > 0) || frames_per_second > 100) {
    return "frames per second of a preview must be within 0 and 100";
  }
  if (!(longest > 0)) return "the longest preview must last";
  if (!std::isfinite(azimuth)) return "azimuth must be finite";
  if (sheet_columns < 1 || sheet_rows < 1 || sheet_columns * sheet_rows > 200) {
    return "a contact sheet must have 1 to 200 pictures";
  }
  return std::nullopt;
}

MotionPreview::MotionPreview(const Body& body,
                             const cv::Mat3b& texture,
                             std::vector<Pose> poses,
                             double frame_time,
                             const PreviewOptions& options)
    : impl_(std::make_unique<Impl>(
          body, texture, std::move(poses), frame_time, options)) {}

MotionPreview::~MotionPreview() = default;

int MotionPreview::num_frames() const { return impl_->num_frames; }

double MotionPreview::frame_time() const {
  return 1 / impl_->options.frames_per_second;
}

bool MotionPreview::is_cut_short() const {
  return impl_->pose_time * (impl_->poses.size() - 1.0) >
         impl_->options.longest;
}

cv::Mat3b MotionPreview::Render(int frame) const {
  CHECK(frame >= 0 && frame < num_frames()) << frame;
  return impl_->Render(frame);
}

void WriteMotionPreview(const MotionPreview& preview,
                        const PreviewOptions& options,
                        const std::string& animation_path,
                        const std::string& sheet_path,
                        Progress* progress) {
  const int num = preview.num_frames();
  constexpr float kQuality = 82;
  AnimatedWebp animation(
      options.width, options.height, preview.frame_time(), kQuality);
  const int num_shown =
      std::min(num, options.sheet_columns * options.sheet_rows);
  const int columns = std::min(num_shown, options.sheet_columns);
  const int rows = (num_shown + columns - 1) / columns;
  const cv::Size small(options.width / 2, options.height / 2);
  cv::Mat3b sheet(
      rows * small.height, columns * small.width, cv::Vec3b(255, 255, 255));
  int shown = 0;
  constexpr int kBatch = 16;
  for (int begin = 0; begin < num; begin += kBatch) {
    const int end = std::min(num, begin + kBatch);
    if (progress != nullptr) {
      progress->Stage(
          "preview",
          std::to_string(begin) + " of " + std::to_string(num) + " frames");
    }
    std::vector<cv::Mat3b> pictures(end - begin);
    tbb::parallel_for(begin, end, [&](int frame) {
      pictures[frame - begin] = preview.Render(frame);
    });
    for (int frame = begin; frame < end; ++frame) {
      animation.Add(pictures[frame - begin]);
      // Picture i of the sheet shows frame i (num - 1) / (shown - 1).
      while (shown < num_shown &&
             frame ==
                 (num_shown == 1 ? 0 : shown * (num - 1) / (num_shown - 1))) {
        cv::Mat3b picture;
        cv::resize(
            pictures[frame - begin], picture, small, 0, 0, cv::INTER_AREA);
        char time[32];
        std::snprintf(
            time, sizeof(time), "%.2f s", frame * preview.frame_time());
        Label(time, &picture);
        picture.copyTo(sheet(cv::Rect(cv::Point(shown % columns * small.width,
                                                shown / columns * small.height),
                                      small)));
        ++shown;
      }
    }
  }
  WriteWholeFile(animation.Finish(), animation_path);
  std::vector<std::uint8_t> png;
  CHECK(cv::imencode(".png", sheet, png));
  WriteWholeFile(std::string(png.begin(), png.end()), sheet_path);
}

}  // namespace sweepfit
