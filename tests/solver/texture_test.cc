// SPDX-License-Identifier: Apache-2.0
#include "solver/texture.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "capture/render.h"
#include "tests/support/toy_body.h"
#include "tests/support/toy_uv.h"

namespace sweepfit {
namespace {

constexpr int kRings = 20;
constexpr int kAtlas = 256;
constexpr int kPicture = 260;

// Linear light, BGR, of a point given at rest.
using Paint = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

Eigen::Vector3d Bands(const Eigen::Vector3d& p) {
  return {0.25 + 0.15 * std::sin(9 * p.y()),
          0.3 + 0.15 * std::sin(8 * p.x() + 1),
          0.3 + 0.15 * std::cos(7 * p.z() - p.y())};
}

Eigen::Vector3d Uniform(const Eigen::Vector3d&) { return {0.2, 0.3, 0.5}; }

std::uint8_t Encode(double linear) {
  linear = std::clamp(linear, 0.0, 1.0);
  const double s = linear <= 0.0031308
                       ? 12.92 * linear
                       : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255 * s));
}

// The body at rest before cameras that stand around it.
class TextureTest : public testing::Test {
 protected:
  TextureTest() : body_(ToyBody(kRings)) {
    AssignToyUv(kRings, &body_);
    mesh_.vertices = RestVertices(body_);
    mesh_.triangles = TriangulateQuads(body_.topology.quads, mesh_.vertices);
  }

  static Camera CameraAt(double azimuth_degrees) {
    const double azimuth = azimuth_degrees * std::numbers::pi / 180;
    const Eigen::Vector3d target(0.2, 0.3, 0);
    const Eigen::Vector3d center =
        target +
        Eigen::Vector3d(2 * std::sin(azimuth), 0.2, 2 * std::cos(azimuth));
    Camera camera;
    camera.id = "c" + std::to_string(std::lround(azimuth_degrees));
    camera.width = camera.height = kPicture;
    camera.K << 380, 0, 129, 0, 380, 131, 0, 0, 1;
    camera.distortion = {-0.1, 0.02, 0.001, -0.001, 0};
    const Eigen::Vector3d forward = (target - center).normalized();
    const Eigen::Vector3d right =
        forward.cross(Eigen::Vector3d::UnitY()).normalized();
    camera.camera_from_world.row(0) = right.transpose();
    camera.camera_from_world.row(1) = forward.cross(right).transpose();
    camera.camera_from_world.row(2) = forward.transpose();
    camera.world_in_camera = -camera.camera_from_world * center;
    return camera;
  }

  // Shows `mesh` painted by where its points are at rest.
  View Photograph(const Camera& camera,
                  const TriangleMesh& mesh,
                  const Paint& paint,
                  double exposure = 1) const {
    const RayScene scene(mesh);
    View view;
    view.camera = camera;
    view.image = cv::Mat3b(camera.height, camera.width, cv::Vec3b(0, 255, 0));
    view.coverage = cv::Mat1f::zeros(camera.height, camera.width);
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const Eigen::Vector3d ray =
            camera.RayInWorld(camera.Undistort(Eigen::Vector2d(x, y)));
        const RayScene::Hit hit = scene.Intersect(camera.CenterInWorld(), ray);
        if (hit.triangle < 0) continue;
        const Triangle& t = mesh_.triangles[hit.triangle];
        const Eigen::Vector3d color =
            exposure * paint((1 - hit.b1 - hit.b2) * mesh_.vertices[t[0]] +
                             hit.b1 * mesh_.vertices[t[1]] +
                             hit.b2 * mesh_.vertices[t[2]]);
        view.coverage(y, x) = 1;
        for (int c = 0; c < 3; ++c) view.image(y, x)[c] = Encode(color[c]);
      }
    }
    view.signed_distance = SignedDistance(camera, view.coverage);
    return view;
  }

  View Photograph(double azimuth_degrees,
                  const Paint& paint,
                  double exposure = 1) const {
    return Photograph(CameraAt(azimuth_degrees), mesh_, paint, exposure);
  }

  Texture Solve(const std::vector<View>& views,
                StageSummary* summary = nullptr) const {
    TextureOptions options;
    options.size = kAtlas;
    return SolveTexture(
        body_, {mesh_.vertices}, {views}, options, nullptr, summary);
  }

  // Calls visit(row, column, rest position) for the texels at the corners'
  // mean of every quad.
  void ForEachQuadTexel(
      const std::function<void(int, int, const Eigen::Vector3d&)>& visit)
      const {
    for (std::size_t q = 0; q < body_.topology.quads.size(); ++q) {
      Eigen::Vector2f uv = Eigen::Vector2f::Zero();
      Eigen::Vector3d position = Eigen::Vector3d::Zero();
      for (int c = 0; c < 4; ++c) {
        uv += 0.25f * body_.topology.uv[q][c];
        position += 0.25 * mesh_.vertices[body_.topology.quads[q][c]];
      }
      visit(static_cast<int>((1 - uv.y()) * kAtlas),
            static_cast<int>(uv.x() * kAtlas),
            position);
    }
  }

  // Mean and largest difference in grey levels from the paint, over quads of
  // at least this confidence.
  struct Difference {
    double mean = 0;
    double max = 0;
    int count = 0;
  };
  Difference Compare(const Texture& texture,
                     const Paint& paint,
                     double min_confidence) const {
    Difference difference;
    ForEachQuadTexel([&](int row, int column, const Eigen::Vector3d& p) {
      if (texture.confidence(row, column) < min_confidence) return;
      const Eigen::Vector3d expected = paint(p);
      for (int c = 0; c < 3; ++c) {
        const double off =
            std::abs(1.0 * texture.atlas(row, column)[c] - Encode(expected[c]));
        difference.mean += off;
        difference.max = std::max(difference.max, off);
      }
      ++difference.count;
    });
    difference.mean /= std::max(1, 3 * difference.count);
    return difference;
  }

  Body body_;
  TriangleMesh mesh_;
};

std::vector<double> Ring(int count) {
  std::vector<double> azimuths;
  for (int i = 0; i < count; ++i) azimuths.push_back(360.0 * i / count);
  return azimuths;
}

TEST_F(TextureTest, RecoversColoursWhereSeen) {
  std::vector<View> views;
  for (const double azimuth : Ring(6)) {
    views.push_back(Photograph(azimuth, Bands));
  }
  StageSummary summary;
  const Texture texture = Solve(views, &summary);
  ASSERT_EQ(texture.atlas.size(), cv::Size(kAtlas, kAtlas));
  ASSERT_EQ(texture.confidence.size(), cv::Size(kAtlas, kAtlas));
  const Difference difference = Compare(texture, Bands, 0.2);
  EXPECT_GT(difference.count, 300);
  EXPECT_LT(difference.mean, 3);
  EXPECT_LT(difference.max, 25);
  EXPECT_EQ(summary.status, "ok");
  EXPECT_GT(summary.figures["seen_share"].get<double>(), 0.8);
}

TEST_F(TextureTest, UsesAllPoses) {
  // Each pose has one camera; together they see front and back.
  Pose pose = RandomPose(0.3, 4);
  pose.root_in_world = Eigen::Vector3d(0.05, 0, 0.02);
  pose.rotation[kRoot] = Eigen::Quaterniond::Identity();
  TriangleMesh posed = mesh_;
  posed.vertices = PoseVertices(body_, pose);
  TextureOptions options;
  options.size = kAtlas;
  const Texture both = SolveTexture(
      body_,
      {mesh_.vertices, posed.vertices},
      {{Photograph(0, Bands)}, {Photograph(CameraAt(180), posed, Bands)}},
      options,
      nullptr,
      nullptr);
  const Texture front = Solve({Photograph(0, Bands)});
  const Difference in_both = Compare(both, Bands, 0.2);
  EXPECT_GT(in_both.count, 1.5 * Compare(front, Bands, 0.2).count);
  EXPECT_LT(in_both.mean, 4);
}

TEST_F(TextureTest, FindsExposureDifferences) {
  const std::vector<double> exposure = {1, 1.1, 0.9, 1, 1.1, 1};
  std::vector<View> views;
  double mean_log = 0;
  for (std::size_t i = 0; i < exposure.size(); ++i) {
    views.push_back(Photograph(60.0 * i, Bands, exposure[i]));
    mean_log += std::log(exposure[i]) / exposure.size();
  }
  StageSummary summary;
  const Texture texture = Solve(views, &summary);
  const auto& figures = summary.figures["exposure"];
  ASSERT_EQ(figures.size(), exposure.size());
  for (std::size_t i = 0; i < exposure.size(); ++i) {
    EXPECT_EQ(figures[i]["camera"], views[i].camera.id);
    for (int c = 0; c < 3; ++c) {
      const double gain = figures[i]["gain_bgr"][c].get<double>();
      // The level that all share is free.
      EXPECT_NEAR(gain * exposure[i], std::exp(mean_log), 0.02)
          << "view " << i << " channel " << c;
    }
  }
  EXPECT_LT(Compare(texture, Bands, 0.2).mean, 3.5);
}

// Skin in the light of a green screen, and a blue that it did not reach.
TEST_F(TextureTest, TakesTheLightOfAKeyScreenOff) {
  const auto skin_and_blue = [](const Eigen::Vector3d& p) {
    return p.y() > 0 ? Eigen::Vector3d(0.2, 0.45, 0.4)  // BGR, linear
                     : Eigen::Vector3d(0.5, 0.15, 0.1);
  };
  const auto despilled = [&](const Eigen::Vector3d& p) {
    return p.y() > 0 ? Eigen::Vector3d(0.2, 0.3, 0.4) : skin_and_blue(p);
  };
  std::vector<View> views;
  for (const double azimuth : Ring(4)) {
    views.push_back(Photograph(azimuth, skin_and_blue));
  }
  StageSummary summary;
  EXPECT_LT(Compare(Solve(views, &summary), skin_and_blue, 0.2).mean, 3);
  EXPECT_FALSE(summary.figures.contains("despilled_channel"));
  for (View& view : views) view.key_channel = 1;
  EXPECT_LT(Compare(Solve(views, &summary), despilled, 0.2).mean, 3);
  EXPECT_EQ(summary.figures["despilled_channel"], "green");
}

TEST_F(TextureTest, FillsWhatNobodySees) {
  const Texture texture = Solve({Photograph(0, Uniform)});
  int unseen = 0;
  ForEachQuadTexel([&](int row, int column, const Eigen::Vector3d&) {
    if (texture.confidence(row, column) == 0) ++unseen;
  });
  EXPECT_GT(unseen, 100);
  // Also the gutters: no texel is left black or green.
  for (int row = 0; row < kAtlas; ++row) {
    for (int column = 0; column < kAtlas; ++column) {
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(texture.atlas(row, column)[c], Encode(Uniform({})[c]), 3)
            << row << " " << column;
      }
    }
  }
}

TEST_F(TextureTest, TakesDetailFromTheOtherSide) {
  // Mirror the trunk's rings front to back; the paint does not tell the sides
  // apart, but has detail that the surroundings cannot give.
  constexpr int kRing = 16;
  for (int ring = 0; ring < kRings; ++ring) {
    for (int k = 0; k < kRing; ++k) {
      body_.topology.mirror_vertex[ring * kRing + k] =
          ring * kRing + (kRing - k) % kRing;
    }
  }
  const Paint stripes = [](const Eigen::Vector3d& p) {
    return Eigen::Vector3d::Constant(0.3 + 0.2 * std::sin(60 * p.y()));
  };
  const Texture texture = Solve({Photograph(0, stripes)});
  const int trunk_quads = kRing * (kRings - 1);
  int compared = 0;
  double mean = 0;
  for (int q = 0; q < trunk_quads; ++q) {
    const int other = q / kRing * kRing + (kRing - 1 - q % kRing);
    const auto texel = [&](int quad) {
      const auto& uv = body_.topology.uv[quad];
      const Eigen::Vector2f middle = 0.5f * (uv[0] + uv[2]);
      return cv::Point(static_cast<int>(middle.x() * kAtlas),
                       static_cast<int>((1 - middle.y()) * kAtlas));
    };
    if (texture.confidence(texel(q)) > 0 ||
        texture.confidence(texel(other)) < 0.3) {
      continue;
    }
    ++compared;
    mean += std::abs(1.0 * texture.atlas(texel(q))[1] -
                     texture.atlas(texel(other))[1]);
  }
  ASSERT_GT(compared, 20);
  EXPECT_LT(mean / compared, 4);
}

TEST_F(TextureTest, SaysWhenLittleIsSeen) {
  StageSummary summary;
  Solve({Photograph(0, Uniform)}, &summary);
  EXPECT_LT(summary.figures["seen_share"].get<double>(), 0.5);
  EXPECT_EQ(summary.status, "weak");
  EXPECT_EQ(summary.warnings.size(), 1u);
}

TEST_F(TextureTest, WithoutViewsThereIsAPlainAtlas) {
  StageSummary summary;
  const Texture texture = Solve({}, &summary);
  EXPECT_EQ(cv::countNonZero(texture.confidence), 0);
  EXPECT_EQ(summary.status, "weak");
}

TEST_F(TextureTest, AViewThatDoesNotSeeASideHasNoSayInIt) {
  const Paint magenta = [](const Eigen::Vector3d&) {
    return Eigen::Vector3d(0.9, 0.02, 0.9);
  };
  const Texture front = Solve({Photograph(0, Bands)});
  const Texture both = Solve({Photograph(0, Bands), Photograph(180, magenta)});
  int compared = 0;
  ForEachQuadTexel([&](int row, int column, const Eigen::Vector3d&) {
    if (front.confidence(row, column) < 0.2) return;
    ++compared;
    EXPECT_EQ(front.atlas(row, column), both.atlas(row, column));
    EXPECT_EQ(front.confidence(row, column), both.confidence(row, column));
  });
  EXPECT_GT(compared, 50);
}

TEST_F(TextureTest, TheArmDoesNotPaintTheTrunkBehindIt) {
  // The left arm is red, the trunk is not; a camera at the left sees the arm
  // before the trunk.
  const Paint paint = [](const Eigen::Vector3d& p) {
    const bool arm = p.x() > 0.2;
    return arm ? Eigen::Vector3d(0.05, 0.05, 0.8)
               : Eigen::Vector3d(0.3, 0.3, 0.3);
  };
  const Texture texture = Solve({Photograph(50, paint)});
  int compared = 0;
  ForEachQuadTexel([&](int row, int column, const Eigen::Vector3d& p) {
    if (p.x() > 0.15 || texture.confidence(row, column) < 0.1) return;
    ++compared;
    EXPECT_NEAR(texture.atlas(row, column)[0], Encode(0.3), 6);
    EXPECT_NEAR(texture.atlas(row, column)[2], Encode(0.3), 6);
  });
  EXPECT_GT(compared, 20);
}

TEST_F(TextureTest, SameBytesForAnyNumberOfThreads) {
  const std::vector<View> views = {
      Photograph(0, Bands), Photograph(80, Bands, 1.1), Photograph(200, Bands)};
  const Texture many = Solve(views);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism,
                                1);
  const Texture single = Solve(views);
  EXPECT_EQ(cv::norm(many.atlas, single.atlas, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(many.confidence, single.confidence, cv::NORM_INF), 0);
}

TEST(TextureOptions, RefusesSizesThatMakeNoSense) {
  TextureOptions options;
  EXPECT_FALSE(options.Check().has_value());
  options.size = 0;
  ASSERT_TRUE(options.Check().has_value());
  EXPECT_NE(options.Check()->find("texture.size"), std::string::npos);
}

}  // namespace
}  // namespace sweepfit
