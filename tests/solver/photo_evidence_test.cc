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
Found MatchRing(const std::vector<Capsule>& capsules,
                int num_cameras,
                double contrast,
                double reach,
                const PhotoEvidenceOptions& options) {
  const std::vector<View> views =
      testing::PaintRing(capsules, {0, 0.75, 0}, num_cameras, 480, contrast);
  Found found{BuildVisualHull(views, {0.008}, nullptr, nullptr), {}, {}};
  found.body = BodyFromHull(found.hull);
  const PosedBody& posed = found.body.posed;
  found.points =
      PhotoEvidence(views, found.hull, options)
          .Match(posed, RayScene(posed.mesh), found.body.quads, reach, 0.85);
  return found;
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
  const Found found = MatchRing(Valley(), 12, 45, 0.03, options);
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

TEST(PhotoEvidence, SaysNothingOfPlainSurfaces) {
  // Shading is hardly any texture.
  EXPECT_LT(MatchRing(Valley(), 12, 0, 0.03, {}).Share(), 1.0 / 12);
}

TEST(PhotoEvidence, SlopesOfLightnessFindMoreWhereTwoCamerasSee) {
  const std::vector<Capsule> trunk = {{{0, 0.4, 0}, {0, 1.1, 0}, 0.12}};
  const Found with = MatchRing(trunk, 4, 45, 0.05, {});
  const Found without = MatchRing(trunk, 4, 45, 0.05, {.slope_two_views = 0});
  EXPECT_GT(with.Share(), 1.1 * without.Share());
  const Errors errors = MeanErrors(with, trunk);
  EXPECT_GT(errors.before, 0.02);
  EXPECT_LT(errors.after, 0.002);
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
