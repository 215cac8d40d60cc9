// SPDX-License-Identifier: Apache-2.0
// Time of the volume room over cameras and voxel sizes, on pictures of an
// analytic person (the one of the tests), and of a naive dense grid beside it.
// Prints google-benchmark's lines and then one table with the growth exponent
//   ln(time at 2 mm / time at 8 mm) / ln 4,  i.e. time ~ voxel^-exponent.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "tests/volume/textured_body.h"
#include "volume/silhouette_cones.h"
#include "volume/volume.h"

namespace sweepfit {
namespace {

constexpr int kPictureSize = 800;
constexpr double kContrast = 45;  // grey levels
const Eigen::Vector3d kMiddle(0, 0.85, 0);

const std::vector<View>& Views(int cameras) {
  static std::map<int, std::vector<View>> cache;
  std::vector<View>& views = cache[cameras];
  if (views.empty()) {
    views =
        testing::PaintRing(testing::MakePerson(0.8, 0.3, {0, 0, 0}).capsules,
                           kMiddle,
                           cameras,
                           kPictureSize,
                           {kContrast});
  }
  return views;
}

void Build(benchmark::State& state, const std::string& mode) {
  const std::vector<View>& views = Views(static_cast<int>(state.range(0)));
  VolumeOptions options;
  options.mode = mode;
  options.voxel_size = 1e-3 * static_cast<double>(state.range(1));
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        BuildVolume(views, options, nullptr, nullptr).EnclosedVolume());
  }
}

// Every cone at every voxel of a box, one thread.
void BuildDense(benchmark::State& state) {
  const std::vector<View>& views = Views(static_cast<int>(state.range(0)));
  const double voxel = 1e-3 * static_cast<double>(state.range(1));
  const Eigen::Vector3d low(-0.75, -0.05, -0.45);
  const Eigen::Vector3d high(0.75, 1.8, 0.45);
  const Eigen::Vector3i size = ((high - low) / voxel).cast<int>();
  for (auto _ : state) {
    const auto cones = MakeSilhouetteCones(views);
    std::vector<float> grid(static_cast<size_t>(size.prod()));
    size_t i = 0;
    for (int x = 0; x < size.x(); ++x) {
      for (int y = 0; y < size.y(); ++y) {
        for (int z = 0; z < size.z(); ++z, ++i) {
          const Eigen::Vector3d point = low + voxel * Eigen::Vector3d(x, y, z);
          double most = -1;
          for (const SilhouetteCone& cone : cones) {
            double phi = 0;
            if (cone.Evaluate(point, &phi)) most = std::max(most, phi);
          }
          grid[i] = static_cast<float>(most);
        }
      }
    }
    benchmark::DoNotOptimize(grid.data());
  }
}

// Keeps the times of all runs for the table.
class TableReporter : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration) continue;
      const std::string& args = run.run_name.args;
      const size_t slash = args.find('/');
      const int cameras = std::stoi(args);
      const int voxel = std::stoi(args.substr(slash + 1));
      cpu_[run.run_name.function_name][cameras][voxel] =
          run.cpu_accumulated_time / static_cast<double>(run.iterations);
    }
  }

  void PrintTable() const {
    std::printf(
        "\n| mode | cameras | 8 mm | 4 mm | 2 mm | exponent |\n"
        "|---|---|---|---|---|---|\n");
    for (const auto& [mode, by_cameras] : cpu_) {
      for (const auto& [cameras, by_voxel] : by_cameras) {
        std::printf("| %s | %d |", mode.c_str(), cameras);
        for (const int voxel : {8, 4, 2}) {
          const auto it = by_voxel.find(voxel);
          if (it == by_voxel.end()) {
            std::printf(" |");
          } else {
            std::printf(" %.3f |", it->second);
          }
        }
        const auto fine = by_voxel.find(2), coarse = by_voxel.find(8);
        if (fine != by_voxel.end() && coarse != by_voxel.end()) {
          std::printf(" %.2f |\n",
                      std::log(fine->second / coarse->second) / std::log(4.0));
        } else {
          std::printf(" |\n");
        }
      }
    }
  }

 private:
  std::map<std::string, std::map<int, std::map<int, double>>> cpu_;
};

}  // namespace
}  // namespace sweepfit

int main(int argc, char** argv) {
  using sweepfit::Build;
  for (const std::string mode : {"hull", "photo", "greedy"}) {
    benchmark::RegisterBenchmark(
        mode.c_str(), [mode](benchmark::State& state) { Build(state, mode); })
        ->ArgsProduct({{4, 8, 16, 32}, {8, 4, 2}})
        ->MeasureProcessCPUTime()
        ->UseRealTime()
        ->Iterations(mode == "hull" ? 3 : 1)
        ->Unit(benchmark::kMillisecond);
  }
  benchmark::RegisterBenchmark("dense", sweepfit::BuildDense)
      ->ArgsProduct({{4, 8, 16, 32}, {8, 4, 2}})
      ->MeasureProcessCPUTime()
      ->UseRealTime()
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
  benchmark::Initialize(&argc, argv);
  sweepfit::TableReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  reporter.PrintTable();
  return 0;
}
