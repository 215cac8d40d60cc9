// SPDX-License-Identifier: Apache-2.0
#include "experiments/synthetic.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "experiments/random.h"
#include "experiments/synthetic_cameras.h"
#include "experiments/synthetic_clothes.h"
#include "experiments/synthetic_person.h"
#include "experiments/synthetic_raster.h"
#include "experiments/synthetic_room.h"
#include "experiments/synthetic_surface.h"
#include "model/file_io.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr double kVoxelSize = 0.0032;  // of the level set, statures
constexpr int kJpegQuality = 92;
constexpr double kRoomMargin = 1.6;  // from the cameras to the walls, metres
constexpr int kPlateSamples = 2;     // per pixel and axis

// One posture, ready to be drawn: everything in the world.
struct Subject {
  std::string pose;
  std::array<Vector3d, kNumJoints> joint_in_world;
  TriangleMesh mesh;
  std::vector<Vector3d> normals;
  std::vector<DressedBody::VertexLooks> looks;  // per vertex
  std::vector<ContactShadow> shadows;
};

Subject MakeSubject(const SyntheticOptions& options,
                    const PersonShape& shape,
                    const Outfit& outfit,
                    const std::string& pose) {
  const PosedPerson person = PosePerson(shape, pose, options.seed);
  const DressedBody body(shape, person, outfit);
  Subject subject;
  subject.pose = pose;
  subject.mesh = body.Mesh(kVoxelSize * shape.stature);
  subject.normals = VertexNormals(subject.mesh);
  subject.looks = body.Looks(subject.mesh, subject.normals);

  const Eigen::AngleAxisd turn(options.yaw_degrees * std::numbers::pi / 180,
                               Vector3d::UnitY());
  const Eigen::Matrix3d world_from_canonical = turn.toRotationMatrix();
  const Vector3d shift(options.shift_x, 0, options.shift_z);
  for (int j = 0; j < kNumJoints; ++j) {
    subject.joint_in_world[j] =
        world_from_canonical * person.joint_in_world[j] + shift;
  }
  for (size_t i = 0; i < subject.mesh.vertices.size(); ++i) {
    subject.mesh.vertices[i] =
        world_from_canonical * subject.mesh.vertices[i] + shift;
    subject.normals[i] = world_from_canonical * subject.normals[i];
  }
  const double h = shape.stature;
  const auto add_shadow =
      [&](const Vector3d& at, double radius, double strength) {
        subject.shadows.push_back({at, radius, strength});
      };
  for (const auto& [ankle, toe] :
       {std::pair(kLAnkle, kLFootEnd), std::pair(kRAnkle, kRFootEnd)}) {
    const Vector3d& a = subject.joint_in_world[ankle];
    const Vector3d& b = subject.joint_in_world[toe];
    add_shadow(a, 0.05 * h, 0.35);
    add_shadow(0.3 * a + 0.7 * b, 0.05 * h, 0.35);
  }
  add_shadow(subject.joint_in_world[kRoot], 0.22 * h, 0.25);
  return subject;
}

// ---------------------------------------------------------------- pictures

struct Light {
  Vector3d key, fill;  // unit vectors towards the lights
};

Light DrawLight(unsigned seed) {
  Random random(0x6c6967ull * 1000003 + seed);
  const double azimuth = random.Uniform(0, 2 * std::numbers::pi);
  const auto from = [](double angle, double height) {
    return Vector3d(std::sin(angle), height, std::cos(angle)).normalized();
  };
  return {from(azimuth, 1.4), from(azimuth + 2.2, 0.6)};
}

Vector3d Shade(const Subject& subject,
               const Outfit& outfit,
               const Light& light,
               const SurfaceSample& sample) {
  const Triangle& t = subject.mesh.triangles[sample.triangle];
  Vector3d normal = Vector3d::Zero(), rest = Vector3d::Zero();
  double open = 0;
  for (int i = 0; i < 3; ++i) {
    normal += sample.weights[i] * subject.normals[t[i]];
    rest += sample.weights[i] * subject.looks[t[i]].rest_point;
    open += sample.weights[i] * subject.looks[t[i]].openness;
  }
  normal.normalize();
  const double ambient = 0.45 * open * (0.7 + 0.3 * normal.y());
  const double key =
      0.65 * std::max(0.0, normal.dot(light.key)) * (0.35 + 0.65 * open);
  const double fill =
      0.25 * std::max(0.0, normal.dot(light.fill)) * (0.35 + 0.65 * open);
  return (ambient + key + fill) * outfit.Color(rest);
}

// Linear RGB.
cv::Mat3f DrawRoom(const Camera& camera, const Room& room) {
  cv::Mat3f picture(camera.height, camera.width);
  const Vector3d origin = camera.CenterInWorld();
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      Vector3d sum = Vector3d::Zero();
      for (int j = 0; j < kPlateSamples; ++j) {
        for (int i = 0; i < kPlateSamples; ++i) {
          const Eigen::Vector2d pixel(x + (i + 0.5) / kPlateSamples - 0.5,
                                      y + (j + 0.5) / kPlateSamples - 0.5);
          sum += room.Color(origin, RayForDrawing(camera, pixel));
        }
      }
      sum /= kPlateSamples * kPlateSamples;
      picture(y, x) = cv::Vec3f(sum.x(), sum.y(), sum.z());
    }
  }
  return picture;
}

// Linear RGB to the 8-bit BGR that a camera would save: exposure, sRGB curve,
// noise.
cv::Mat3b Expose(const cv::Mat3f& linear,
                 double gain,
                 double noise,
                 Random* random) {
  cv::Mat3b picture(linear.size());
  for (int y = 0; y < linear.rows; ++y) {
    for (int x = 0; x < linear.cols; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        const double v = std::clamp(gain * linear(y, x)[channel], 0.0, 1.0);
        const double srgb =
            v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
        const double level =
            255 * srgb + (noise > 0 ? noise * random->Normal() : 0.0);
        picture(y, x)[2 - channel] =
            static_cast<unsigned char>(std::clamp(level + 0.5, 0.0, 255.0));
      }
    }
  }
  return picture;
}

// The person before the shadowed room, linear RGB.
cv::Mat3f Compose(const Camera& camera,
                  const Room& room,
                  const cv::Mat3f& empty_room,
                  const std::vector<ContactShadow>& shadows,
                  const Drawing& drawing) {
  cv::Mat3f picture(empty_room.size());
  const Vector3d origin = camera.CenterInWorld();
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const float free = 1 - drawing.coverage(y, x);
      picture(y, x) = drawing.color(y, x);
      if (free <= 0) continue;
      const double shadow =
          room.Shadow(origin, RayForDrawing(camera, {x, y}), shadows);
      picture(y, x) += free * static_cast<float>(shadow) * empty_room(y, x);
    }
  }
  return picture;
}

// ------------------------------------------------------------------- files

void MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw InputError(folder.string() + ": cannot be made: " + error.message());
  }
}

void WritePicture(const fs::path& path, const cv::Mat& picture) {
  bool written = false;
  try {
    written = cv::imwrite(
        path.string(), picture, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  } catch (const cv::Exception&) {
    written = false;
  }
  if (!written) throw InputError(path.string() + ": cannot be written");
}

void WriteJoints(const fs::path& path,
                 const std::array<Vector3d, kNumJoints>& joint_in_world) {
  nlohmann::ordered_json document;
  document["unit"] = "m";
  for (int j = 0; j < kNumJoints; ++j) {
    const Vector3d& p = joint_in_world[j];
    document["joints"][std::string(kJointNames[j])] = {p.x(), p.y(), p.z()};
  }
  WriteWholeFile(document.dump(1) + "\n", path.string());
}

void WriteTruth(const fs::path& folder, const Subject& subject) {
  MakeFolder(folder / "masks");
  WriteJoints(folder / "joints.json", subject.joint_in_world);
  SavePly(subject.mesh, (folder / "surface.ply").string());
}

Capture DescribeCapture(const fs::path& folder,
                        const SyntheticOptions& options,
                        const std::vector<Camera>& cameras) {
  Capture capture;
  capture.folder = folder;
  for (size_t i = 0; i < cameras.size(); ++i) {
    CaptureCamera entry;
    entry.camera = cameras[i];
    if (options.background) {
      entry.background = {"background/" + cameras[i].id + ".jpg"};
    }
    capture.cameras.push_back(entry);
    if (cameras.size() >= 16 && i % 2 == 1) {
      capture.holdout.push_back(cameras[i].id);
    }
  }
  for (const std::string& name : options.poses) {
    CapturePose pose;
    pose.name = name;
    for (const Camera& camera : cameras) {
      pose.images[camera.id] = "images/" + name + "/" + camera.id + ".jpg";
      if (!options.background) {
        pose.masks[camera.id] = "masks/" + name + "/" + camera.id + ".png";
      }
    }
    capture.poses.push_back(pose);
  }
  return capture;
}

// Everything that one camera sees.
void WriteCamera(const Capture& capture,
                 const SyntheticOptions& options,
                 size_t index,
                 const std::vector<Subject>& subjects,
                 const Outfit& outfit,
                 const Room& room,
                 const Light& light) {
  const CaptureCamera& entry = capture.cameras[index];
  const Camera& camera = entry.camera;
  Random random(0x6e6f6973ull * 1000003 + 1009 * options.seed + index);
  const double gain = random.Uniform(0.95, 1.05);
  const cv::Mat3f empty_room = DrawRoom(camera, room);
  if (!entry.background.empty()) {
    WritePicture(capture.folder / entry.background[0],
                 Expose(empty_room, gain, options.noise, &random));
  }
  for (size_t i = 0; i < subjects.size(); ++i) {
    const Subject& subject = subjects[i];
    const CapturePose& pose = capture.poses[i];
    const Drawing drawing =
        DrawMesh(camera, subject.mesh, [&](const SurfaceSample& sample) {
          return Shade(subject, outfit, light, sample);
        });
    const cv::Mat3f picture =
        Compose(camera, room, empty_room, subject.shadows, drawing);
    WritePicture(capture.folder / pose.images.at(camera.id),
                 Expose(picture, gain, options.noise, &random));
    cv::Mat1b mask;
    drawing.coverage.convertTo(mask, CV_8U, 255);
    WritePicture(
        capture.folder / "truth" / pose.name / "masks" / (camera.id + ".png"),
        mask);
    if (!options.background) {
      WritePicture(capture.folder / pose.masks.at(camera.id), mask);
    }
  }
}

}  // namespace

std::optional<std::string> SyntheticOptions::Check() const {
  if (num_cameras < 2 || num_cameras > 64) {
    return "num_cameras must be 2 to 64";
  }
  if (width < 32 || width > 4096 || height < 32 || height > 4096) {
    return "width and height must be 32 to 4096";
  }
  if (poses.empty()) return "poses must name at least one pose";
  std::set<std::string> seen;
  for (const std::string& pose : poses) {
    if (pose != "A" && pose != "T" && pose != "N") {
      return "poses: \"" + pose + "\" is none of A, T, N";
    }
    if (!seen.insert(pose).second) return "poses: " + pose + " is named twice";
  }
  for (double value : {yaw_degrees, shift_x, shift_z}) {
    if (!(std::abs(value) < 1e4)) {
      return "yaw_degrees, shift_x and shift_z must be numbers of sane size";
    }
  }
  if (!(noise >= 0 && noise <= 50)) return "noise must be 0 to 50";
  return std::nullopt;
}

nlohmann::ordered_json SyntheticOptionsToJson(const SyntheticOptions& options) {
  return {{"seed", options.seed},
          {"num_cameras", options.num_cameras},
          {"width", options.width},
          {"height", options.height},
          {"poses", options.poses},
          {"yaw_degrees", options.yaw_degrees},
          {"shift_x", options.shift_x},
          {"shift_z", options.shift_z},
          {"noise", options.noise},
          {"background", options.background}};
}

Capture WriteSyntheticCapture(const fs::path& folder,
                              const SyntheticOptions& options,
                              Progress* progress) {
  if (const auto problem = options.Check()) {
    throw InputError("synthetic capture: " + *problem);
  }
  const Vector3d place(options.shift_x, 0, options.shift_z);
  const PersonShape shape = DrawPersonShape(options.seed);
  CameraRing ring;
  ring.count = options.num_cameras;
  ring.width = options.width;
  ring.height = options.height;
  ring.center_in_world = place;
  ring.stature = shape.stature;
  const Room room(place, ring.Radius() + kRoomMargin, options.seed);
  const Outfit outfit(shape, options.seed, room.MainColors());

  if (progress) progress->Stage("synth", "person");
  std::vector<Subject> subjects;
  ring.reach = 0;
  for (const std::string& pose : options.poses) {
    subjects.push_back(MakeSubject(options, shape, outfit, pose));
    for (const Vector3d& v : subjects.back().mesh.vertices) {
      ring.reach = std::max(ring.reach,
                            std::hypot(v.x() - place.x(), v.z() - place.z()));
    }
  }
  const Capture capture =
      DescribeCapture(folder, options, DrawCameraRing(ring, options.seed));

  if (progress) progress->Stage("synth", "pictures");
  for (const CapturePose& pose : capture.poses) {
    MakeFolder(folder / "images" / pose.name);
    if (!options.background) MakeFolder(folder / "masks" / pose.name);
  }
  if (options.background) MakeFolder(folder / "background");
  for (const Subject& subject : subjects) {
    WriteTruth(folder / "truth" / subject.pose, subject);
  }
  const Light light = DrawLight(options.seed);
  // Every camera has its own files and its own random numbers.
  tbb::parallel_for(size_t{0}, capture.cameras.size(), [&](size_t i) {
    WriteCamera(capture, options, i, subjects, outfit, room, light);
  });
  SaveCapture(capture);
  return capture;
}

}  // namespace sweepfit
