// SPDX-License-Identifier: Apache-2.0
#include "solver/photo_evidence.h"

#include <gtest/gtest.h>

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

TEST(PhotoEvidence, FindsTheSurfaceThatNoOutlineShows) {
  const std::vector<Capsule> truth = Valley();
  const std::vector<View> views =
      testing::PaintRing(truth, {0, 0.75, 0}, 12, 480, 45);
  const Volume hull = BuildVisualHull(views, {0.008}, nullptr, nullptr);
  const NearBody body = BodyFromHull(hull);
  const PhotoEvidence photo(views, hull, {});
  const std::vector<PhotoPoint> points = photo.Match(
      body.posed, RayScene(body.posed.mesh), body.quads, 0.03, 0.85);
  EXPECT_GT(points.size(), body.posed.mesh.vertices.size() / 5);
  double before = 0, after = 0;
  for (const PhotoPoint& point : points) {
    Vector3d normal;
    const Vector3d& start = body.posed.mesh.vertices[point.vertex];
    before += std::abs(CapsuleDistance(truth, start, &normal));
    after += std::abs(CapsuleDistance(truth, point.point_in_world, &normal));
    EXPECT_LE(hull.Sample(point.point_in_world), 0.51 * hull.voxel_size());
    EXPECT_GE(point.sigma, photo.options().sigma);
    EXPECT_LT((point.point_in_world - start).norm(), 0.034);
  }
  EXPECT_LT(after, 0.5 * before);
}

TEST(PhotoEvidence, SaysNothingOfPlainSurfaces) {
  const std::vector<View> views =
      testing::PaintRing(Valley(), {0, 0.75, 0}, 12, 480, 0);
  const Volume hull = BuildVisualHull(views, {0.008}, nullptr, nullptr);
  const NearBody body = BodyFromHull(hull);
  const std::vector<PhotoPoint> points =
      PhotoEvidence(views, hull, {})
          .Match(body.posed, RayScene(body.posed.mesh), body.quads, 0.03, 0.85);
  // Shading is hardly any texture.
  EXPECT_LT(points.size(), body.posed.mesh.vertices.size() / 12);
}

// Of the points that a ring of four cameras finds about its hull of a capsule.
struct Found {
  double share = 0;              // of the hull's vertices
  double before = 0, after = 0;  // mean distance from the capsule, metres
};
Found MatchRingOfFour(const PhotoEvidenceOptions& options) {
  const std::vector<Capsule> truth = {{{0, 0.4, 0}, {0, 1.1, 0}, 0.12}};
  const std::vector<View> views =
      testing::PaintRing(truth, {0, 0.75, 0}, 4, 480, 45);
  const Volume hull = BuildVisualHull(views, {0.008}, nullptr, nullptr);
  const NearBody body = BodyFromHull(hull);
  const std::vector<PhotoPoint> points =
      PhotoEvidence(views, hull, options)
          .Match(body.posed, RayScene(body.posed.mesh), body.quads, 0.05, 0.85);
  const auto count = static_cast<double>(points.size());
  Found found;
  found.share = count / static_cast<double>(body.posed.mesh.vertices.size());
  Vector3d normal;
  for (const PhotoPoint& point : points) {
    const Vector3d& start = body.posed.mesh.vertices[point.vertex];
    found.before += std::abs(CapsuleDistance(truth, start, &normal)) / count;
    found.after +=
        std::abs(CapsuleDistance(truth, point.point_in_world, &normal)) / count;
  }
  return found;
}

TEST(PhotoEvidence, SlopesOfLightnessFindMoreWhereTwoCamerasSee) {
  const Found with = MatchRingOfFour({});
  const Found without = MatchRingOfFour({.slope_two_views = 0});
  EXPECT_GT(with.share, 1.1 * without.share);
  EXPECT_GT(with.before, 0.02);
  EXPECT_LT(with.after, 0.002);
}

TEST(PhotoEvidence, OptionsAreChecked) {
  EXPECT_FALSE(PhotoEvidenceOptions().Check());
  EXPECT_TRUE((PhotoEvidenceOptions{.sigma = 0}).Check());
  EXPECT_TRUE((PhotoEvidenceOptions{.weight = -1}).Check());
  EXPECT_TRUE((PhotoEvidenceOptions{.slope = 1.5}).Check());
  EXPECT_TRUE((PhotoEvidenceOptions{.slope_two_views = -0.1}).Check());
}

}  // namespace
}  // namespace sweepfit
