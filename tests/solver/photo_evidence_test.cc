// SPDX-License-Identifier: Apache-2.0
#include "solver/photo_evidence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "model/mesh.h"
#include "tests/volume/textured_body.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;
using testing::Capsule;
using testing::CapsuleDistance;

// Two capsules side by side with a valley that no outline shows.
std::vector<Capsule> Valley() {
  return {{{-0.1, 0.4, 0}, {-0.1, 1.1, 0}, 0.11},
          {{0.1, 0.4, 0}, {0.1, 1.1, 0}, 0.11}};
}

// The hull of the views as the body that nearly fits.
struct NearBody {
  PosedBody posed;
  std::vector<Quad> quads;
};
NearBody BodyFromHull(const Volume& hull) {
  NearBody body;
  body.posed.mesh = hull.ExtractMesh();
  body.posed.normals = VertexNormals(body.posed.mesh);
  for (const Triangle& t : body.posed.mesh.triangles) {
    body.quads.push_back({t[0], t[1], t[2], t[2]});
  }
  return body;
}

// What the photographs of a ring of cameras find about their hull.
struct Found {
  Volume hull;
  NearBody body;
  std::vector<PhotoPoint> points;

  double Share() const {  // of the vertices
    return static_cast<double>(points.size()) /
           static_cast<double>(body.posed.mesh.vertices.size());
  }
};
// About that body, given the hull of the same views.
Found MatchAbout(const std::vector<View>& views,
                 Volume hull,
                 NearBody body,
                 double reach,
                 const PhotoEvidenceOptions& options) {
  std::vector<PhotoPoint> points =
      PhotoEvidence(views, hull, options)
          .Match(body.posed, RayScene(body.posed.mesh), body.quads, reach, 0.85)
          .points;
  return {std::move(hull), std::move(body), std::move(points)};
}

Found MatchRing(const std::vector<Capsule>& capsules,
                int num_cameras,
                const testing::Paint& paint,
                double reach,
                const PhotoEvidenceOptions& options) {
  const std::vector<View> views =
      testing::PaintRing(capsules, {0, 0.75, 0}, num_cameras, 480, paint);
  Volume hull = BuildVisualHull(views, {0.008}, nullptr, nullptr);
  NearBody body = BodyFromHull(hull);
  return MatchAbout(views, std::move(hull), std::move(body), reach, options);
}

// Mean distance of the points from the capsules, metres.
struct Errors {
  double before = 0, after = 0;
};
Errors MeanErrors(const Found& found, const std::vector<Capsule>& capsules) {
  Errors errors;
  Vector3d normal;
  const auto count = static_cast<double>(found.points.size());
  for (const PhotoPoint& point : found.points) {
    const Vector3d& start = found.body.posed.mesh.vertices[point.vertex];
    errors.before +=
        std::abs(CapsuleDistance(capsules, start, &normal)) / count;
    errors.after +=
        std::abs(CapsuleDistance(capsules, point.point_in_world, &normal)) /
        count;
  }
  return errors;
}

TEST(PhotoEvidence, FindsTheSurfaceThatNoOutlineShows) {
  const PhotoEvidenceOptions options;
  const Found found = MatchRing(Valley(), 12, {45}, 0.03, options);
  EXPECT_GT(found.Share(), 0.2);
  for (const PhotoPoint& point : found.points) {
    const Vector3d& start = found.body.posed.mesh.vertices[point.vertex];
    EXPECT_LE(found.hull.Sample(point.point_in_world),
              0.51 * found.hull.voxel_size());
    EXPECT_GE(point.sigma, options.sigma);
    EXPECT_LT((point.point_in_world - start).norm(), 0.034);
  }
  const Errors errors = MeanErrors(found, Valley());
  EXPECT_LT(errors.after, 0.5 * errors.before);
}

constexpr PhotoEvidenceOptions kPatternsAlone = {.lightness = 0,
                                                 .lightness_two_views = 0};

TEST(PhotoEvidence, PatternsSayNothingOfPlainSurfaces) {
  EXPECT_LT(MatchRing(Valley(), 12, {}, 0.03, kPatternsAlone).Share(),
            1.0 / 12);
}

const std::vector<Capsule> kTrunk = {{{0, 0.4, 0}, {0, 1.1, 0}, 0.12}};

// What four cameras find about a body with waves of 6 mm along it: as much too
// far in as out, or exposures would explain what light there is.
Found MatchTrunk(const testing::Paint& paint,
                 const PhotoEvidenceOptions& options) {
  const Vector3d middle(0, 0.75, 0);
  const std::vector<View> views =
      testing::PaintRing(kTrunk, middle, 4, 480, paint);
  NearBody body = BodyFromHull(BuildVisualHull(
      testing::RenderRing(kTrunk, middle, 24, 480), {0.008}, nullptr, nullptr));
  for (size_t v = 0; v < body.posed.mesh.vertices.size(); ++v) {
    Vector3d& vertex = body.posed.mesh.vertices[v];
    vertex += 0.006 * std::sin(40 * vertex.y()) * body.posed.normals[v];
  }
  return MatchAbout(views,
                    BuildVisualHull(views, {0.008}, nullptr, nullptr),
                    std::move(body),
                    0.018,
                    options);
}

// Nothing on the trunk but light that falls on it from one side.
TEST(PhotoEvidence, LightnessFindsThePlainSurfaceThatTwoCamerasSee) {
  const testing::Paint plain = {0, 40};
  const Found patterns = MatchTrunk(plain, kPatternsAlone);
  const Found found = MatchTrunk(plain, {});
  const Errors errors = MeanErrors(found, kTrunk);
  EXPECT_LT(patterns.Share(), 0.02);
  EXPECT_GT(found.Share(), 0.15);
  EXPECT_GT(errors.before, 0.003);
  EXPECT_LT(errors.after, 0.6 * errors.before);
}

TEST(PhotoEvidence, LightnessAllowsForExposures) {
  const Found alike = MatchTrunk({45}, {});
  const Found found = MatchTrunk({45, 0, 1.25}, {});
  const Errors errors = MeanErrors(found, kTrunk);
  EXPECT_NEAR(found.Share(), alike.Share(), 0.02);
  EXPECT_NEAR(errors.after, MeanErrors(alike, kTrunk).after, 0.0005);
}

TEST(PhotoEvidence, OptionsAreChecked) {
  EXPECT_FALSE(PhotoEvidenceOptions().Check());
  EXPECT_TRUE((PhotoEvidenceOptions{.sigma = 0}).Check());
  EXPECT_TRUE((PhotoEvidenceOptions{.weight = -1}).Check());
  EXPECT_TRUE((PhotoEvidenceOptions{.lightness = -1}).Check());
  EXPECT_TRUE((PhotoEvidenceOptions{.lightness_two_views = -0.1}).Check());
}

}  // namespace
}  // namespace sweepfit
