// SPDX-License-Identifier: Apache-2.0
#include "solver/relax_surface.h"

#include <gtest/gtest.h>

#include "model/template.h"
#include "solver/displacement.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

TEST(RelaxSurface, LeavesASoundSurfaceAlone) {
  Body body = BuildTemplate({});
  const std::vector<Vector3d> reference = RestVertices(body);
  // A gentle swelling of everything.
  std::vector<Vector3d> move(reference.size());
  for (size_t v = 0; v < move.size(); ++v) {
    move[v] = 0.002 * std::sin(20 * reference[v].y()) * Vector3d::UnitZ();
  }
  DisplaceAtRest(move, &body);
  const std::vector<Vector3d> before = RestVertices(body);
  const RelaxedSurface relaxed = RelaxSurface(reference, &body);
  EXPECT_EQ(relaxed.moved_vertices, 0);
  EXPECT_EQ(RestVertices(body), before);
}

TEST(RelaxSurface, TakesSpikesBackAndOnlyThem) {
  Body body = BuildTemplate({});
  const std::vector<Vector3d> reference = RestVertices(body);
  std::vector<Vector3d> move(reference.size(), Vector3d::Zero());
  for (const size_t v : {500u, 4000u, 9000u}) {
    move[v] = Vector3d(0.05, -0.03, 0.06);
  }
  DisplaceAtRest(move, &body);
  const std::vector<Vector3d> torn = RestVertices(body);
  for (size_t v = 0; v < torn.size(); ++v) {
    EXPECT_LT((torn[v] - reference[v] - move[v]).norm(), 1e-9);
  }
  const RelaxedSurface relaxed = RelaxSurface(reference, &body);
  EXPECT_EQ(relaxed.turned_faces_left, 0);
  EXPECT_EQ(relaxed.long_edges_left, 0);
  EXPECT_GT(relaxed.moved_vertices, 2);
  EXPECT_LT(relaxed.moved_vertices, body.num_vertices() / 10);
  double worst = 0;
  const std::vector<Vector3d> after = RestVertices(body);
  for (size_t v = 0; v < after.size(); ++v) {
    worst = std::max(worst, (after[v] - reference[v]).norm());
  }
  EXPECT_LT(worst, 0.04);
}

// The hem of a jacket: the trunk stands out, the thighs do not.
TEST(RelaxSurface, AStepStaysAStepBeyondItsEdge) {
  Body body = BuildTemplate({});
  const std::vector<Vector3d> reference = RestVertices(body);
  constexpr double kHem = 0.1;  // metres above the root
  std::vector<Vector3d> move(reference.size(), Vector3d::Zero());
  for (size_t v = 0; v < move.size(); ++v) {
    if (body.topology.part[v] != BodyPart::kTrunk) continue;
    if (reference[v].y() < kHem) continue;
    move[v] =
        0.05 * Vector3d(reference[v].x(), 0, reference[v].z()).normalized();
  }
  DisplaceAtRest(move, &body);
  const std::vector<Vector3d> before = RestVertices(body);
  const RelaxedSurface relaxed = RelaxSurface(reference, &body);
  EXPECT_EQ(relaxed.turned_faces_left, 0);
  EXPECT_EQ(relaxed.long_edges_left, 0);
  EXPECT_GT(relaxed.moved_vertices, 10);
  const std::vector<Vector3d> after = RestVertices(body);
  for (size_t v = 0; v < after.size(); ++v) {
    const double from_edge = std::abs(reference[v].y() - kHem);
    if (from_edge < 0.12 || reference[v].y() > 0.3) continue;
    EXPECT_LT((after[v] - before[v]).norm(), 0.003) << v;
  }
}

}  // namespace
}  // namespace sweepfit
