// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/support/temporary_folder.h"
#include "tests/volume/textured_body.h"
#include "volume/coverage.h"
#include "volume/surface_labels.h"
#include "volume/volume.h"

namespace sweepfit {
namespace {

using testing::Capsule;
using ::testing::HasSubstr;
using testing::MeanError;
using testing::PaintRing;

constexpr int kSize = 480;
constexpr double kTexture = 45;

// Two capsules side by side with a valley that no outline shows, front or back.
std::vector<Capsule> Valley() {
  return {{{-0.1, 0.4, 0}, {-0.1, 1.1, 0}, 0.11},
          {{0.1, 0.4, 0}, {0.1, 1.1, 0}, 0.11}};
}
const Eigen::Vector3d kMiddle(0, 0.75, 0);

VolumeOptions Options(const std::string& mode) {
  VolumeOptions options;
  options.mode = mode;
  options.voxel_size = 0.006;
  return options;
}

Volume Build(const std::vector<View>& views,
             const std::string& mode,
             StageSummary* summary = nullptr) {
  return BuildVolume(views, Options(mode), nullptr, summary);
}

// The largest distance by which the mesh reaches beyond the hull.
double Beyond(const Volume& hull, const TriangleMesh& mesh) {
  double most = 0;
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    most = std::max(most, hull.Sample(vertex));
  }
  return most;
}

TEST(PhotoTest, LowersTheErrorWhereThereIsTexture) {
  const auto body = Valley();
  for (const int count : {8, 16}) {
    const std::vector<View> views =
        PaintRing(body, kMiddle, count, kSize, {kTexture});
    const Volume hull = Build(views, "hull");
    StageSummary summary;
    const Volume photo = Build(views, "photo", &summary);
    EXPECT_EQ(summary.figures["photo"], "on");
    const double before = MeanError(hull.ExtractMesh(), body);
    const double after = MeanError(photo.ExtractMesh(), body);
    EXPECT_LT(after, 0.8 * before) << count << " cameras";
    EXPECT_TRUE(CheckTopology(photo.ExtractMesh()).IsClosedManifold());
    EXPECT_LT(Beyond(hull, photo.ExtractMesh()), 1e-3);
  }
}

TEST(PhotoTest, KeepsTheHullWithoutTexture) {
  const auto body = Valley();
  const std::vector<View> views = PaintRing(body, kMiddle, 8, kSize, {});
  StageSummary summary;
  const Volume photo = Build(views, "photo", &summary);
  EXPECT_THAT(summary.figures["photo"].get<std::string>(), HasSubstr("off"));
  EXPECT_FALSE(summary.warnings.empty());
  EXPECT_EQ(photo.EnclosedVolume(), Build(views, "hull").EnclosedVolume());
}

// The views that still see what they saw of the hull.
void ExpectCovered(const std::vector<View>& views,
                   const Volume& hull,
                   const Volume& carved) {
  const auto before = SilhouetteCoverage(views, hull);
  const auto after = SilhouetteCoverage(views, carved);
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_GT(after[i], before[i] - 0.02);
  }
}

TEST(GreedyTest, CarvesButKeepsTheSilhouettesCovered) {
  const auto body = Valley();
  const std::vector<View> views =
      PaintRing(body, kMiddle, 8, kSize, {kTexture});
  const Volume hull = Build(views, "hull");
  StageSummary summary;
  const Volume carved = Build(views, "greedy", &summary);
  EXPECT_GT(summary.figures["carved_voxels"].get<int>(), 100);
  // In a valley it does not come closer to the body than the hull (which is why
  // it is no default), but it may not eat into it either.
  EXPECT_LT(carved.EnclosedVolume(), hull.EnclosedVolume());
  EXPECT_LT(MeanError(carved.ExtractMesh(), body),
            1.1 * MeanError(hull.ExtractMesh(), body));
  EXPECT_LT(Beyond(hull, carved.ExtractMesh()), 1e-3);
  ExpectCovered(views, hull, carved);
}

TEST(GreedyTest, ComesCloserToAPerson) {
  const auto body = testing::MakePerson(0.8, 0.3, {0, 0, 0}).capsules;
  const std::vector<View> views =
      PaintRing(body, {0, 0.85, 0}, 8, kSize, {kTexture});
  const Volume hull = Build(views, "hull");
  StageSummary summary;
  const Volume carved = Build(views, "greedy", &summary);
  EXPECT_GT(summary.figures["carved_voxels"].get<int>(), 100);
  EXPECT_LT(MeanError(carved.ExtractMesh(), body),
            MeanError(hull.ExtractMesh(), body));
  // Thin limbs: the surface runs anywhere between two voxels.
  EXPECT_LT(Beyond(hull, carved.ExtractMesh()), 0.0015);
  ExpectCovered(views, hull, carved);
}

TEST(GreedyTest, LeavesOneColourAlone) {
  const auto body = Valley();
  const std::vector<View> views = PaintRing(body, kMiddle, 8, kSize, {});
  StageSummary summary;
  Build(views, "greedy", &summary);
  EXPECT_EQ(summary.figures["carved_voxels"].get<int>(), 0);
}

TEST(RefineTest, SameBytesForAnyNumberOfThreads) {
  const std::vector<View> views =
      PaintRing(Valley(), kMiddle, 6, kSize, {kTexture});
  const TemporaryFolder folder;
  for (const std::string mode : {"photo", "greedy"}) {
    std::string bytes[2];
    for (const int threads : {1, 2}) {
      const tbb::global_control limit(
          tbb::global_control::max_allowed_parallelism, threads);
      const auto file = folder.path() / "volume.vdb";
      Build(views, mode).SaveVdb(file.string());
      std::ifstream in(file, std::ios::binary);
      bytes[threads - 1] = {std::istreambuf_iterator<char>(in),
                            std::istreambuf_iterator<char>()};
    }
    EXPECT_GT(bytes[0].size(), 10000u);
    EXPECT_TRUE(bytes[0] == bytes[1]) << mode;
  }
}

TEST(BeliefsTest, NeighboursOutvoteOneNode) {
  // A chain of five nodes that want label 1, the middle one rather 3.
  constexpr int kLabels = 4;
  std::vector<float> unary(5 * kLabels, 1.f);
  for (int node = 0; node < 5; ++node) {
    unary[node * kLabels + (node == 2 ? 3 : 1)] = 0;
  }
  const std::vector<std::pair<int, int>> chain = {
      {0, 1}, {1, 2}, {2, 3}, {3, 4}};
  const auto best = [&](float smoothness) {
    const auto belief =
        PropagateBeliefs(kLabels, unary, chain, smoothness, 10, 10);
    const auto first = belief.begin() + 2 * kLabels;
    return std::min_element(first, first + kLabels) - first;
  };
  EXPECT_EQ(best(1), 1);
  EXPECT_EQ(best(0.1f), 3);
}

TEST(VolumeOptionsTest, ChecksRanges) {
  VolumeOptions options;
  EXPECT_FALSE(options.Check());
  options.mode = "magic";
  EXPECT_THAT(*options.Check(), HasSubstr("magic"));
  options = {};
  options.photo.patch_side = 4;
  EXPECT_THAT(*options.Check(), HasSubstr("volume.photo.patch_side"));
  options = {};
  options.greedy.threshold = 1;
  EXPECT_THAT(*options.Check(), HasSubstr("volume.greedy.threshold"));
}

}  // namespace
}  // namespace sweepfit
