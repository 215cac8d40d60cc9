// SPDX-License-Identifier: Apache-2.0
#include "capture/import_format.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <random>
#include <sstream>

#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

// A camera as OpenCV describes it; the writers below put it into each format.
struct Truth {
  std::string name;
  double fx, fy, cx, cy;
  std::array<double, 5> k;  // k1 k2 p1 p2 k3
  cv::Vec3d rotation, translation;
};

std::vector<Truth> RandomCameras(bool has_k3) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Truth> cameras;
  for (const char* name : {"cam_a", "cam_b", "cam_c"}) {
    Truth& c = cameras.emplace_back();
    c.name = name;
    c.fx = 1100 + 50 * uniform(random);
    c.fy = 1100 + 50 * uniform(random);
    c.cx = 640 + 30 * uniform(random);
    c.cy = 480 + 30 * uniform(random);
    c.k = {0.2 * uniform(random),
           0.1 * uniform(random),
           0.002 * uniform(random),
           0.002 * uniform(random),
           has_k3 ? 0.02 * uniform(random) : 0};
    for (int i = 0; i < 3; ++i) c.rotation[i] = 1.5 * uniform(random);
    c.translation = {
        0.3 * uniform(random), 0.3 * uniform(random), 3 + uniform(random)};
  }
  return cameras;
}

cv::Matx33d Matrix(const Truth& c) {
  cv::Matx33d R;
  cv::Rodrigues(c.rotation, R);
  return R;
}

std::string Text(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.17g", value);
  return text;
}

template <typename Range>
std::string Join(const Range& values, const char* between) {
  std::string text;
  for (const double value : values) {
    text += (text.empty() ? "" : between) + Text(value);
  }
  return text;
}

std::vector<double> Values(const cv::Matx33d& m) { return {m.val, m.val + 9}; }

std::vector<double> K(const Truth& c) {
  return {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1};
}

class ImportTest : public ::testing::Test {
 protected:
  fs::path Write(const std::string& name, const std::string& bytes) {
    const fs::path path = folder_.path() / name;
    fs::create_directories(path.parent_path());
    WriteBytes(path, bytes);
    return path;
  }
  fs::path folder() const { return folder_.path(); }

  std::string Error(const std::string& format, const fs::path& source) {
    try {
      ReadCalibration(format, source);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }

  // Points near the origin land where cv::projectPoints puts them.
  void ExpectSameProjection(const std::vector<Truth>& truth,
                            const ImportedCalibration& imported) {
    ASSERT_EQ(imported.cameras.size(), truth.size());
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(-0.8, 0.8);
    std::vector<cv::Point3d> points;
    for (int i = 0; i < 50; ++i) {
      points.emplace_back(uniform(random), uniform(random), uniform(random));
    }
    for (size_t c = 0; c < truth.size(); ++c) {
      const Truth& t = truth[c];
      const Camera& camera = imported.cameras[c].camera;
      EXPECT_EQ(camera.id, t.name);
      const cv::Matx33d k(t.fx, 0, t.cx, 0, t.fy, t.cy, 0, 0, 1);
      std::vector<cv::Point2d> expected;
      cv::projectPoints(points,
                        t.rotation,
                        t.translation,
                        k,
                        std::vector<double>(t.k.begin(), t.k.end()),
                        expected);
      for (size_t i = 0; i < points.size(); ++i) {
        const Eigen::Vector2d pixel =
            camera.Project({points[i].x, points[i].y, points[i].z});
        EXPECT_NEAR(pixel.x(), expected[i].x, 1e-9);
        EXPECT_NEAR(pixel.y(), expected[i].y, 1e-9);
      }
    }
  }

  struct Case {
    std::string from, to, message;
  };
  // Each change of the sound file must give one line that holds the message.
  void ExpectErrors(const std::string& format,
                    const fs::path& source,
                    const fs::path& file,
                    const std::vector<Case>& cases) {
    const std::string good = ReadBytes(file);
    for (const Case& c : cases) {
      const size_t at = good.find(c.from);
      ASSERT_NE(at, std::string::npos) << c.from;
      std::string text = good;
      WriteBytes(file, text.replace(at, c.from.size(), c.to));
      const std::string message = Error(format, source);
      EXPECT_THAT(message, HasSubstr(c.message)) << c.from << " -> " << c.to;
      EXPECT_THAT(message, HasSubstr(folder().string())) << c.to;
      EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    }
    WriteBytes(file, good);
    EXPECT_EQ(Error(format, source), "no error");
  }

  // Files that end early are errors or (cut between two cameras) sound, never
  // anything else.
  void ExpectNoCrashWhenCut(const std::string& format,
                            const fs::path& source,
                            const fs::path& file) {
    const std::string good = ReadBytes(file);
    for (size_t size = 0; size < good.size(); size += 1 + size / 6) {
      WriteBytes(file, good.substr(0, size));
      Error(format, source);
    }
    std::mt19937 random(3);
    for (int i = 0; i < 20; ++i) {
      std::string bad = good;
      bad[random() % bad.size()] = static_cast<char>(random() % 256);
      WriteBytes(file, bad);
      Error(format, source);
    }
    WriteBytes(file, good);
  }

  TemporaryFolder folder_;
};

TEST_F(ImportTest, NamesTheFormats) {
  EXPECT_THAT(Error("alien", folder()), HasSubstr("colmap"));
  EXPECT_THAT(Error("colmap", folder() / "none"),
              HasSubstr("no such file or folder"));
  EXPECT_EQ(CalibrationFormats().size(), 6u);
}

// --- COLMAP ---

constexpr char kColmapCameras[] = R"(# Camera list
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
3 SIMPLE_RADIAL 640 480 500 320 240 0.1
7 PINHOLE 640 480 500 510 320.5 240.5
)";
// A quarter turn about y, no points; half a turn about x; names with a space.
constexpr char kColmapImages[] =
    R"(# Image list with two lines of data per image
2 0.70710678118654752 0 0.70710678118654752 0 1 2 3 7 side view.png

1 0 2 0 0 0 0 4 3 front.jpg
10.5 20.5 -1 11 21 63
)";

TEST_F(ImportTest, ReadsColmapText) {
  Write("cameras.txt", kColmapCameras);
  Write("images.txt", kColmapImages);
  const ImportedCalibration c = ReadCalibration("colmap", folder());
  ASSERT_EQ(c.cameras.size(), 2u);
  EXPECT_FALSE(c.metres_per_unit);
  EXPECT_FALSE(c.axes_are_chosen);
  const Camera& front = c.cameras[0].camera;
  EXPECT_EQ(front.id, "front");
  EXPECT_EQ(c.cameras[0].image, "front.jpg");
  EXPECT_EQ(front.width, 640);
  EXPECT_EQ(front.height, 480);
  Eigen::Matrix3d K;
  K << 500, 0, 319.5, 0, 500, 239.5, 0, 0, 1;
  EXPECT_EQ(front.K, K);
  EXPECT_EQ(front.distortion, (std::array<double, 5>{0.1, 0, 0, 0, 0}));
  const Eigen::Matrix3d half_turn = Eigen::Vector3d(1, -1, -1).asDiagonal();
  EXPECT_LT((front.camera_from_world - half_turn).norm(), 1e-15);
  EXPECT_EQ(front.world_in_camera, Eigen::Vector3d(0, 0, 4));
  const Camera& side = c.cameras[1].camera;
  EXPECT_EQ(side.id, "side view");
  Eigen::Matrix3d quarter_turn;
  quarter_turn << 0, 0, 1, 0, 1, 0, -1, 0, 0;
  EXPECT_LT((side.camera_from_world - quarter_turn).norm(), 1e-15);
  EXPECT_EQ(side.K(1, 1), 510);
  EXPECT_EQ(side.K(0, 2), 320);
}

TEST_F(ImportTest, NamesColmapCamerasByFolderWhereFilesAreAlike) {
  Write("cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n");
  Write("images.txt",
        "1 1 0 0 0 0 0 1 1 right/0001.png\n\n"
        "2 1 0 0 0 0 0 1 1 left/0001.png\n\n");
  const ImportedCalibration c = ReadCalibration("colmap", folder());
  EXPECT_EQ(c.cameras[0].camera.id, "left_0001");
  EXPECT_EQ(c.cameras[1].camera.id, "right_0001");
}

TEST_F(ImportTest, RejectsMalformedColmapText) {
  EXPECT_THAT(Error("colmap", folder()), HasSubstr("both .bin or both .txt"));
  const fs::path cameras = Write("cameras.txt", kColmapCameras);
  const fs::path images = Write("images.txt", kColmapImages);
  ExpectErrors("colmap",
               folder(),
               cameras,
               {{"3 SIMPLE", "3.5 SIMPLE", "cameras.txt:3: CAMERA_ID"},
                {"SIMPLE_RADIAL", "RADIAL", "cameras.txt:3: expected a number"},
                {"SIMPLE_RADIAL", "MAGIC", "unknown camera model MAGIC"},
                {"SIMPLE_RADIAL", "FOV", "cameras.txt:3"},
                {"7 PINHOLE 640 480 500 510 320.5 240.5",
                 "7 OPENCV_FISHEYE 640 480 500 500 320 240 1 0 0 0",
                 "OPENCV_FISHEYE cannot be expressed"},
                {"7 PINHOLE 640 480 500 510 320.5 240.5",
                 "7 FULL_OPENCV 640 480 500 500 320 240 0 0 0 0 0 1 0 0",
                 "beyond k1 k2 p1 p2 k3"},
                {"240.5", "240.5 1", "and here are more"},
                {"240.5", "nan", "cameras.txt:4: expected a number"},
                {"640", "0", "16 to 32768"},
                {"500 510", "-500 510", "must be positive"},
                {"7 PIN", "3 PIN", "cameras.txt:4: camera 3 is given twice"}});
  ExpectErrors(
      "colmap",
      folder(),
      images,
      {{"2 0.7", "2 x", "images.txt:2: expected a number for QW"},
       {"1 0 2 0 0", "1 0 0 0 0", "the quaternion is no rotation"},
       {"3 7 side", "3 8 side", "images.txt:2: there is no camera 8"},
       {" side view.png", "", "the image has no name"},
       {"11 21 63", "11 21", "images.txt:5: expected the points"},
       {"10.5 20.5 -1 11 21 63", "2 1 0 0 0 0 0 0 3 b.png", "expected the"},
       {"side view.png", "front.jpg", "two cameras are named front"}});
  ExpectNoCrashWhenCut("colmap", folder(), cameras);
  ExpectNoCrashWhenCut("colmap", folder(), images);
}

TEST_F(ImportTest, ColmapTextProjectsLikeOpenCv) {
  const std::vector<Truth> truth = RandomCameras(true);
  std::string cameras, images;
  for (size_t i = 0; i < truth.size(); ++i) {
    const Truth& t = truth[i];
    const std::string id = std::to_string(10 - i);
    cameras += id + " FULL_OPENCV 1280 960 " +
               Join(std::vector<double>{t.fx,
                                        t.fy,
                                        t.cx + 0.5,
                                        t.cy + 0.5,
                                        t.k[0],
                                        t.k[1],
                                        t.k[2],
                                        t.k[3],
                                        t.k[4],
                                        0,
                                        0,
                                        0},
                    " ") +
               "\n";
    const double angle = cv::norm(t.rotation);
    const cv::Vec3d axis = t.rotation * (std::sin(angle / 2) / angle);
    images += id + " " +
              Join(std::vector<double>{std::cos(angle / 2),
                                       axis[0],
                                       axis[1],
                                       axis[2],
                                       t.translation[0],
                                       t.translation[1],
                                       t.translation[2]},
                   " ") +
              " " + id + " shots/" + t.name + ".png\n\n";
  }
  Write("cameras.txt", cameras);
  Write("images.txt", images);
  ExpectSameProjection(truth, ReadCalibration("colmap", folder()));
}

template <typename T>
void Put(T value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

// OPENCV cameras in COLMAP's binary form.
void WriteColmapBinary(const std::vector<Truth>& truth,
                       std::string* cameras,
                       std::string* images) {
  Put<std::uint64_t>(truth.size(), cameras);
  Put<std::uint64_t>(truth.size(), images);
  std::uint32_t id = 40;
  for (const Truth& t : truth) {
    Put(++id, cameras);
    Put<std::int32_t>(4, cameras);
    Put<std::uint64_t>(1280, cameras);
    Put<std::uint64_t>(960, cameras);
    for (const double p :
         {t.fx, t.fy, t.cx + 0.5, t.cy + 0.5, t.k[0], t.k[1], t.k[2], t.k[3]}) {
      Put(p, cameras);
    }
    Put<std::uint32_t>(id + 100, images);
    const double angle = cv::norm(t.rotation);
    const cv::Vec3d axis = t.rotation * (std::sin(angle / 2) / angle);
    for (const double x : {std::cos(angle / 2),
                           axis[0],
                           axis[1],
                           axis[2],
                           t.translation[0],
                           t.translation[1],
                           t.translation[2]}) {
      Put(x, images);
    }
    Put(id, images);
    images->append(t.name + ".jpg");
    images->push_back('\0');
    Put<std::uint64_t>(2, images);
    for (int i = 0; i < 2; ++i) {
      Put(1.5, images);
      Put(2.5, images);
      Put<std::uint64_t>(~0ull, images);
    }
  }
}

TEST_F(ImportTest, ColmapBinaryProjectsLikeOpenCv) {
  const std::vector<Truth> truth = RandomCameras(false);
  std::string cameras, images;
  WriteColmapBinary(truth, &cameras, &images);
  Write("cameras.bin", cameras);
  Write("images.bin", images);
  // COLMAP prefers the binary files, so text beside them does not matter.
  Write("cameras.txt", "nonsense");
  Write("images.txt", "nonsense");
  const ImportedCalibration c = ReadCalibration("colmap", folder());
  ExpectSameProjection(truth, c);
  EXPECT_EQ(c.cameras[0].camera.width, 1280);
  EXPECT_EQ(c.cameras[0].image, "cam_a.jpg");
}

TEST_F(ImportTest, RejectsMalformedColmapBinaries) {
  std::string cameras, images;
  WriteColmapBinary(RandomCameras(false), &cameras, &images);
  const auto error = [&](const std::string& c, const std::string& i) {
    Write("cameras.bin", c);
    Write("images.bin", i);
    return Error("colmap", folder());
  };
  EXPECT_EQ(error(cameras, images), "no error");
  for (size_t size = 0; size < cameras.size(); size += 7) {
    EXPECT_THAT(error(cameras.substr(0, size), images),
                HasSubstr("cameras.bin: byte "));
  }
  for (size_t size = 0; size < images.size(); size += 7) {
    EXPECT_THAT(error(cameras, images.substr(0, size)),
                HasSubstr("images.bin: byte "));
  }
  EXPECT_THAT(error(cameras + "x", images), HasSubstr("there is more than"));
  EXPECT_THAT(error(cameras, images + "x"), HasSubstr("there is more than"));
  // Counts that no memory could hold.
  for (std::string* file : {&cameras, &images}) {
    std::string broken = *file;
    broken.replace(0, 8, std::string(8, '\xff'));
    EXPECT_THAT(
        file == &cameras ? error(broken, images) : error(cameras, broken),
        HasSubstr("byte 0: the number of"));
  }
  std::string points = images;
  const size_t count_at = images.find(".jpg") + 5;
  points.replace(count_at, 8, std::string(8, '\x7f'));
  EXPECT_THAT(error(cameras, points),
              HasSubstr("byte " + std::to_string(count_at) +
                        ": the number of an image's points"));
  std::string model = cameras;
  model[12] = 99;
  EXPECT_THAT(error(model, images),
              HasSubstr("byte 8: unknown camera model 99"));
}

// --- EasyMocap and OpenCV ---

std::string StorageMatrix(const std::string& key,
                          int rows,
                          int cols,
                          const std::vector<double>& values) {
  return key + ": !!opencv-matrix\n   rows: " + std::to_string(rows) +
         "\n   cols: " + std::to_string(cols) + "\n   dt: d\n   data: [ " +
         Join(values, ",\n       ") + " ]\n";
}

constexpr char kIntri[] = R"(%YAML:1.0
---
names:
  - "01"
  - "02"
K_01: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 510., 240., 0., 0., 1. ]
dist_01: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0.1, 0.2, 0.01, 0.02, 0.3 ]
H_01: 480
W_01: 640
K_02: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 600., 0., 300., 0., 600., 200., 0., 0., 1. ]
D_02: !!opencv-matrix
   rows: 1
   cols: 4
   dt: d
   data: [ 0.1, 0., 0., 0. ]
)";
constexpr char kExtri[] = R"(%YAML:1.0
---
names:
  - "01"
  - "02"
R_01: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 0., 1.57079632679489662, 0. ]
Rot_01: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 0., 0., 1., 0., 1., 0., -1., 0., 0. ]
T_01: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 1., 2., 3. ]
Rot_02: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 0.99999, 0., 0., 0., 1., 0., 0., 0., 1. ]
T_02: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 0., 0., 4. ]
)";

TEST_F(ImportTest, ReadsEasyMocap) {
  Write("intri.yml", kIntri);
  Write("extri.yml", kExtri);
  const ImportedCalibration c = ReadCalibration("easymocap", folder());
  ASSERT_EQ(c.cameras.size(), 2u);
  const Camera& first = c.cameras[0].camera;
  EXPECT_EQ(first.id, "01");
  EXPECT_EQ(first.width, 640);
  EXPECT_EQ(first.height, 480);
  Eigen::Matrix3d K;
  K << 500, 0, 320, 0, 510, 240, 0, 0, 1;
  EXPECT_EQ(first.K, K);
  EXPECT_EQ(first.distortion,
            (std::array<double, 5>{0.1, 0.2, 0.01, 0.02, 0.3}));
  Eigen::Matrix3d quarter_turn;
  quarter_turn << 0, 0, 1, 0, 1, 0, -1, 0, 0;
  EXPECT_LT((first.camera_from_world - quarter_turn).norm(), 1e-15);
  EXPECT_EQ(first.world_in_camera, Eigen::Vector3d(1, 2, 3));
  const Camera& second = c.cameras[1].camera;
  EXPECT_EQ(second.width, 0);
  EXPECT_EQ(second.distortion[0], 0.1);
  // Rounded text becomes a rotation.
  EXPECT_LT((second.camera_from_world - Eigen::Matrix3d::Identity()).norm(),
            1e-15);
}

TEST_F(ImportTest, RejectsMalformedEasyMocap) {
  const fs::path intri = Write("intri.yml", kIntri);
  EXPECT_THAT(Error("easymocap", folder()), HasSubstr("extri.yml: cannot"));
  const fs::path extri = Write("extri.yml", kExtri);
  ExpectErrors(
      "easymocap",
      folder(),
      intri,
      {{"names:", "title:", "no list 'names'"},
       {"K_01", "K_03", "no 'K_01'"},
       {"\"02\"", "\"03\"", "no 'K_03'"},
       {"\"02\"", "\"01\"", "two cameras are named 01"},
       {"rows: 3", "rows: 2", "intri.yml:6: 'K_01' has not rows times cols"},
       {"rows: 3", "rows: 2000000000", "intri.yml:6"},
       {"500., 0.,", "500., 1.,", "intri.yml:6: camera 01: K has skew"},
       {"500.,", "five,", "intri.yml:6: 'K_01' must hold numbers only"},
       {"500.,", ".Nan,", "intri.yml:6: camera 01: K holds"},
       {"cols: 5", "cols: 4", "intri.yml:11: 'dist_01' has not"},
       {"0.2, 0.01, 0.02, 0.3", "0.2", "intri.yml:11: 'dist_01' has not"},
       {"W_01: 640", "W_01: 5", "intri.yml:17: camera 01: width and height"},
       {"K_02: !!opencv-matrix", "K_02 !!opencv-matrix", "intri.yml:18:"},
       {"%YAML:1.0", "%YAML 1", ""}});
  ExpectErrors("easymocap",
               folder(),
               extri,
               {{"0., 1.570", "0.1, 1.570", "'R_01' and 'Rot_01' disagree"},
                {"Rot_02", "Rot_03", "neither 'R_02' nor 'Rot_02'"},
                {"0.99999,", "0.9,", "extri.yml:21: camera 02: R is no"},
                {"0.99999,", "-1,", "extri.yml:21: camera 02: R is a refl"},
                {"T_02", "T_03", "no 'T_02'"},
                {"4. ]", "4., 5. ]", "extri.yml:26: 'T_02' has not"}});
  ExpectNoCrashWhenCut("easymocap", folder(), intri);
  ExpectNoCrashWhenCut("easymocap", folder(), extri);
}

TEST_F(ImportTest, EasyMocapProjectsLikeOpenCv) {
  const std::vector<Truth> truth = RandomCameras(true);
  std::string intri = "%YAML:1.0\n---\nnames:\n", extri = "%YAML:1.0\n---\n";
  for (const Truth& t : truth) intri += "  - \"" + t.name + "\"\n";
  for (const Truth& t : truth) {
    intri += StorageMatrix("K_" + t.name, 3, 3, K(t));
    intri += StorageMatrix("dist_" + t.name, 1, 5, {t.k.begin(), t.k.end()});
    extri += StorageMatrix(
        "R_" + t.name, 3, 1, {t.rotation.val, t.rotation.val + 3});
    extri += StorageMatrix(
        "T_" + t.name, 3, 1, {t.translation.val, t.translation.val + 3});
  }
  Write("intri.yml", intri);
  Write("extri.yml", extri);
  ExpectSameProjection(truth, ReadCalibration("easymocap", folder()));
}

TEST_F(ImportTest, OpenCvFilesProjectLikeOpenCv) {
  // Written by OpenCV itself, one camera in each of its three notations and
  // with other keys.
  const std::vector<Truth> truth = RandomCameras(true);
  const char* extensions[] = {".yml", ".xml", ".json"};
  for (int i = 0; i < 3; ++i) {
    const Truth& t = truth[i];
    cv::FileStorage file((folder() / (t.name + extensions[i])).string(),
                         cv::FileStorage::WRITE);
    const cv::Mat k = cv::Mat(K(t), true).reshape(1, 3);
    const cv::Mat d =
        cv::Mat(std::vector<double>(t.k.begin(), t.k.end()), true);
    if (i == 0) {
      file << "image_width" << 1280 << "image_height" << 960;
      file << "camera_matrix" << k << "distortion_coefficients" << d;
      file << "R" << cv::Mat(Matrix(t)) << "T" << cv::Mat(t.translation);
    } else {
      file << "image_size" << cv::Size(1280, 960);
      file << "K" << k << "D" << d.t();
      file << "rvec" << cv::Mat(t.rotation) << "tvec"
           << cv::Mat(t.translation).t();
    }
  }
  Write("notes.txt", "not a calibration");
  const ImportedCalibration c = ReadCalibration("opencv", folder());
  ExpectSameProjection(truth, c);
  EXPECT_EQ(c.cameras[0].camera.width, 1280);
  EXPECT_EQ(c.cameras[2].camera.height, 960);
}

TEST_F(ImportTest, RejectsMalformedOpenCvFiles) {
  const std::string good = R"(%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 510., 240., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 0.1, 0.2, 0.01, 0.02, 0.3 ]
R: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 0., 0., 0. ]
T: [ 0., 0., 3. ]
)";
  Write("other.yml", good);
  const fs::path file = Write("cam.yml", good);
  ExpectErrors("opencv",
               folder(),
               file,
               {{"camera_matrix", "matrix", "none of the keys camera_matrix"},
                {"R: ", "Q: ", "none of the keys R"},
                {"T: ", "U: ", "none of the keys T"},
                {"0., 0., 3.", "0., 3.", "cam.yml:20: 'T' must have 3"},
                {"rows: 5", "rows: 3", "cam.yml:10: 'distortion"},
                {"510.", "0.", "cam.yml:5: the focal lengths"},
                {"0.02, 0.3", "0.02, x", "cam.yml:10"},
                {"image_width: 640", "image_width: six", "cam.yml:3"},
                {"%YAML:1.0\n---", "hello", "cam.yml"}});
  EXPECT_THAT(Error("opencv", file), HasSubstr("must be a folder"));
  ExpectNoCrashWhenCut("opencv", folder(), file);
}

// --- Pose2Sim ---

constexpr char kCalib[] = R"([cam_02]
name = "right"
size = [ 640.0, 480.0]
matrix = [ [ 500.0, 0.0, 320.0], [ 0.0, 510.0, 240.0], [ 0.0, 0.0, 1.0]]
distortions = [ -0.1, 0.02, 0.001, 0.002]
rotation = [ 0.0, 1.57079632679489662, 0.0]
translation = [ 1.0, 2.0, 3.0]
fisheye = false

[cam_01]
name = "left"
size = [ 640, 480]
matrix = [ [ 500.0, 0.0, 320.0], [ 0.0, 510.0, 240.0], [ 0.0, 0.0, 1.0]]
distortions = [ 0.0, 0.0, 0.0, 0.0]
rotation = [ 0.0, 0.0, 0.0]
translation = [ 0.0, 0.0, 4]
fisheye = false

[metadata]
adjusted = false
error = 0.0
)";

TEST_F(ImportTest, ReadsPose2Sim) {
  const fs::path file = Write("Calib.toml", kCalib);
  const ImportedCalibration c = ReadCalibration("pose2sim", file);
  ASSERT_EQ(c.cameras.size(), 2u);
  EXPECT_EQ(c.metres_per_unit, 1);
  EXPECT_EQ(c.up, "z");
  const Camera& right = c.cameras[0].camera;
  EXPECT_EQ(right.id, "right");
  EXPECT_EQ(right.width, 640);
  Eigen::Matrix3d K, R;
  K << 500, 0, 320, 0, 510, 240, 0, 0, 1;
  R << 0, 0, 1, 0, 1, 0, -1, 0, 0;
  EXPECT_EQ(right.K, K);
  EXPECT_LT((right.camera_from_world - R).norm(), 1e-15);
  EXPECT_EQ(right.world_in_camera, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(right.distortion,
            (std::array<double, 5>{-0.1, 0.02, 0.001, 0.002, 0}));
  EXPECT_EQ(c.cameras[1].camera.id, "left");
  EXPECT_EQ(c.cameras[1].camera.world_in_camera, Eigen::Vector3d(0, 0, 4));
}

TEST_F(ImportTest, RejectsMalformedPose2Sim) {
  const fs::path file = Write("Calib.toml", kCalib);
  ExpectErrors(
      "pose2sim",
      file,
      file,
      {{"size = [ 640.0, 480.0]", "size = [ 640.0", "Calib.toml:4"},
       {"size = [ 640.0, 480.0]", "", "Calib.toml:1: camera right: no 'size'"},
       {"[ 640.0, 480.0]", "[ 640.0]", "Calib.toml:3: camera right: 'size'"},
       {"[ 640.0, 480.0]", "[ 640.0, 'x']", "must hold numbers only"},
       {"[ 500.0, 0.0, 320.0]", "[ 500.0, 3.0, 320.0]", "Calib.toml:4: camera"},
       {"[ -0.1, 0.02, 0.001, 0.002]", "7", "'distortions' must hold"},
       {"[ -0.1, 0.02, 0.001, 0.002]", "[ 1, 2, 3]", "must have 4, 5"},
       {"fisheye = false", "fisheye = true", "Calib.toml:8: camera right: a"},
       {"\"right\"", "3", "Calib.toml:2: camera cam_02: 'name'"},
       {"\"right\"", "\"left\"", "two cameras are named left"},
       {"[metadata]\nadjusted", "[metadata]\n[x]\nadjusted", "no 'size'"},
       {"[cam_02]", "version = 3\n[cam_02]", "'version' is no table"},
       {"1.57079632679489662", "nan", "is not finite"}});
  ExpectNoCrashWhenCut("pose2sim", file, file);
}

TEST_F(ImportTest, Pose2SimProjectsLikeOpenCv) {
  const std::vector<Truth> truth = RandomCameras(true);
  std::string text;
  for (const Truth& t : truth) {
    text +=
        "[" + t.name + "]\nname = \"" + t.name +
        "\"\nsize = [1280, 960]\nmatrix = [" + Join(K(t), ", ") +
        "]\ndistortions = [" + Join(t.k, ", ") + "]\nrotation = [" +
        Join(std::vector<double>(t.rotation.val, t.rotation.val + 3), ", ") +
        "]\ntranslation = [" +
        Join(std::vector<double>(t.translation.val, t.translation.val + 3),
             ", ") +
        "]\n";
  }
  const fs::path file = Write("Calib.toml", text);
  ExpectSameProjection(truth, ReadCalibration("pose2sim", file));
}

// --- Middlebury ---

constexpr char kPar[] =
    "2\n"
    "a0001.png 500 0 320 0 510 240 0 0 1 0 0 1 0 1 0 -1 0 0 1 2 3\n"
    "a0002.png 500 0 320 0 510 240 0 0 1 1 0 0 0 1 0 0 0 1 0 0 4\n";

TEST_F(ImportTest, ReadsMiddlebury) {
  const fs::path file = Write("a_par.txt", kPar);
  const ImportedCalibration c = ReadCalibration("middlebury", file);
  ASSERT_EQ(c.cameras.size(), 2u);
  EXPECT_EQ(c.folder, folder());
  EXPECT_EQ(c.cameras[0].image, "a0001.png");
  const Camera& first = c.cameras[0].camera;
  EXPECT_EQ(first.id, "a0001");
  EXPECT_EQ(first.width, 0);
  EXPECT_EQ(first.K(0, 2), 320);
  EXPECT_EQ(first.K(1, 1), 510);
  Eigen::Matrix3d R;
  R << 0, 0, 1, 0, 1, 0, -1, 0, 0;
  EXPECT_EQ(first.camera_from_world, R);
  EXPECT_EQ(first.world_in_camera, Eigen::Vector3d(1, 2, 3));
}

TEST_F(ImportTest, RejectsMalformedMiddlebury) {
  const fs::path file = Write("a_par.txt", kPar);
  ExpectErrors("middlebury",
               file,
               file,
               {{"2\n", "", "a_par.txt:1: the first line"},
                {"2\n", "3\n", "a_par.txt:1: announces another number"},
                {"1 2 3\n", "1 2\n", "a_par.txt:2: camera a0001: expected 21"},
                {"0 0 4", "0 0 x", "a_par.txt:3: camera a0002: 'x'"},
                {"0 0 4", "0 0 inf", "a_par.txt:3: camera a0002: 'inf'"},
                {"500 0 320", "500 2 320", "a_par.txt:2: camera a0001: K has"},
                {"0 -1 0 0 1", "0 -1 1 0 1", "a_par.txt:2: camera a0001: R"},
                {"a0002", "a0001", "two cameras are named a0001"}});
  ExpectNoCrashWhenCut("middlebury", file, file);
}

TEST_F(ImportTest, MiddleburyProjectsLikeOpenCv) {
  std::vector<Truth> truth = RandomCameras(false);
  std::string text = "3\n";
  for (Truth& t : truth) {
    t.k.fill(0);
    text += t.name + ".png " + Join(K(t), " ") + " " +
            Join(Values(Matrix(t)), " ") + " " +
            Join(std::vector<double>(t.translation.val, t.translation.val + 3),
                 " ") +
            "\n";
  }
  const fs::path file = Write("x_par.txt", text);
  ExpectSameProjection(truth, ReadCalibration("middlebury", file));
}

// --- nerfstudio ---

constexpr char kTransforms[] = R"({
 "camera_model": "OPENCV", "w": 640, "h": 480,
 "fl_x": 500, "fl_y": 510, "cx": 320, "cy": 240.5, "k1": 0.1, "p2": 0.01,
 "frames": [
  {"file_path": "images/front.png", "mask_path": "masks/front.png",
   "transform_matrix": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]},
  {"file_path": "images/side.png", "fl_x": 600, "fl_y": 600,
   "transform_matrix": [[0,0,1,4],[0,1,0,0],[-1,0,0,0],[0,0,0,1]]}
 ]})";

TEST_F(ImportTest, ReadsNerfstudio) {
  Write("transforms.json", kTransforms);
  const ImportedCalibration c = ReadCalibration("nerfstudio", folder());
  ASSERT_EQ(c.cameras.size(), 2u);
  const Camera& front = c.cameras[0].camera;
  EXPECT_EQ(front.id, "front");
  EXPECT_EQ(c.cameras[0].image, "images/front.png");
  EXPECT_EQ(c.cameras[0].mask, "masks/front.png");
  EXPECT_EQ(front.K(0, 2), 319.5);
  EXPECT_EQ(front.K(1, 2), 240);
  EXPECT_EQ(front.distortion, (std::array<double, 5>{0.1, 0, 0, 0.01, 0}));
  // At (1, 2, 3), looking along -z with y up.
  EXPECT_LT((front.CenterInWorld() - Eigen::Vector3d(1, 2, 3)).norm(), 1e-15);
  EXPECT_LT((front.PointInCamera({1, 3, 1}) - Eigen::Vector3d(0, -1, 2)).norm(),
            1e-15);
  // At (4, 0, 0), looking along -x, its right towards -z.
  const Camera& side = c.cameras[1].camera;
  EXPECT_EQ(side.K(0, 0), 600);
  EXPECT_LT((side.PointInCamera({3, 0, -1}) - Eigen::Vector3d(1, 0, 1)).norm(),
            1e-15);
}

TEST_F(ImportTest, ReadsInstantNgpFieldOfView) {
  const fs::path file = Write("t.json",
                              R"({"camera_angle_x": 1.5707963267948966,
    "w": 800, "h": 600, "frames": [
     {"file_path": "./train/r_0",
      "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]},
     {"file_path": "./train/r_1",
      "transform_matrix": [[1,0,0,1],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})");
  const ImportedCalibration c = ReadCalibration("nerfstudio", file);
  EXPECT_EQ(c.cameras[0].camera.id, "r_0");
  EXPECT_NEAR(c.cameras[0].camera.K(0, 0), 400, 1e-12);
  EXPECT_NEAR(c.cameras[0].camera.K(1, 1), 400, 1e-12);
  EXPECT_EQ(c.cameras[0].camera.K(0, 2), 399.5);
  EXPECT_EQ(c.cameras[0].camera.K(1, 2), 299.5);
}

TEST_F(ImportTest, RejectsMalformedNerfstudio) {
  const fs::path file = Write("transforms.json", kTransforms);
  ExpectErrors("nerfstudio",
               folder(),
               file,
               {{"\"w\": 640,", "\"w\" 640,", "line 2"},
                {"\"frames\"", "\"shots\"", "no list 'frames'"},
                {"OPENCV", "OPENCV_FISHEYE", "'camera_model' OPENCV_FISHEYE"},
                {"\"k1\"", "\"k4\"", "frames[0] (images/front.png)"},
                {"\"w\": 640,", "", "no 'w' and 'h', and no picture"},
                {"640", "\"640\"", "'w' must be a number"},
                {"\"file_path\": \"images/side.png\",", "", "frames[1]: no"},
                {"[0,1,0,2]", "[0,1,0]", "frames[0] (images/front.png): 'tr"},
                {"[0,1,0,2]", "[0,2,0,2]", "R is no rotation"},
                {"[0,1,0,2]", "[0,-1,0,2]", "R is a reflection"},
                {"[0,0,0,1]", "[0,0,0,2]", "the last 0, 0, 0, 1"},
                {"\"fl_x\": 600", "\"from_na\": true", "'from_na'"}});
  ExpectNoCrashWhenCut("nerfstudio", folder(), file);
}

TEST_F(ImportTest, NerfstudioProjectsLikeOpenCv) {
  const std::vector<Truth> truth = RandomCameras(true);
  std::string frames;
  for (const Truth& t : truth) {
    const cv::Matx33d R = Matrix(t);
    const cv::Vec3d center = -(R.t() * t.translation);
    std::string rows;
    for (int r = 0; r < 3; ++r) {
      // Columns of camera to world: x right, y up, z back.
      rows += "[" +
              Join(std::vector<double>{R(0, r), -R(1, r), -R(2, r), center[r]},
                   ",") +
              "],";
    }
    frames += std::string(frames.empty() ? "" : ",") + "{\"file_path\": \"" +
              t.name +
              ".jpg\", \"w\": 1280, \"h\": " + "960, \"fl_x\": " + Text(t.fx) +
              ", \"fl_y\": " + Text(t.fy) + ", \"cx\": " + Text(t.cx + 0.5) +
              ", \"cy\": " + Text(t.cy + 0.5) + ", \"k1\": " + Text(t.k[0]) +
              ", \"k2\": " + Text(t.k[1]) + ", \"p1\": " + Text(t.k[2]) +
              ", \"p2\": " + Text(t.k[3]) + ", \"k3\": " + Text(t.k[4]) +
              ", \"transform_matrix\": [" + rows + "[0,0,0,1]]}";
  }
  Write("transforms.json", "{\"frames\": [" + frames + "]}");
  ExpectSameProjection(truth, ReadCalibration("nerfstudio", folder()));
}

}  // namespace
}  // namespace sweepfit
