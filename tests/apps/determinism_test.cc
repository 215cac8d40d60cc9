// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "experiments/synthetic.h"
#include "tests/apps/command.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::map<std::string, std::string> AllFiles(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    files[fs::relative(entry.path(), folder).string()] =
        ReadBytes(entry.path());
  }
  return files;
}

// One small capture, fitted with one and with two threads, then scored.
TEST(Determinism, SameBytesForAnyNumberOfThreads) {
  TemporaryFolder scratch;
  const fs::path capture = scratch.path() / "capture";
  SyntheticOptions options;
  options.num_cameras = 8;
  options.width = options.height = 260;
  WriteSyntheticCapture(capture, options, nullptr);

  std::vector<std::map<std::string, std::string>> runs;
  for (const char* threads : {"1", "2"}) {
    const fs::path out = scratch.path() / (std::string("result") + threads);
    const CommandOutcome outcome = RunCommand({"fit",
                                               capture.string(),
                                               "--out",
                                               out.string(),
                                               "--set",
                                               "texture.size=256",
                                               "global.rounds=2",
                                               "local.rounds=2",
                                               "--threads",
                                               threads},
                                              scratch.path());
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr((out / "report.html").string()));
    EXPECT_THAT(outcome.out, HasSubstr((out / "model.glb").string()));
    runs.push_back(AllFiles(out));
    auto report = nlohmann::ordered_json::parse(runs.back()["report.json"]);
    EXPECT_EQ(report.erase("times"), 1u);
    runs.back()["report.json"] = report.dump();
    EXPECT_EQ(runs.back().erase("report.html"), 1u);
  }
  EXPECT_GT(runs[0].size(), 15u);
  ASSERT_EQ(runs[0].size(), runs[1].size());
  for (const auto& [name, bytes] : runs[0]) {
    EXPECT_TRUE(runs[1][name] == bytes) << name << " differs";
  }

  const fs::path scores = scratch.path() / "scores.json";
  const CommandOutcome outcome =
      RunCommand({"evaluate",
                  (scratch.path() / "result1").string(),
                  "--capture",
                  capture.string(),
                  "--truth",
                  "--json",
                  scores.string()},
                 scratch.path());
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const auto score = nlohmann::ordered_json::parse(ReadBytes(scores));
  // Small pictures, so bars that only a wrong fit misses.
  EXPECT_LT(score["poses"]["A"]["joints"]["limb_mpjpe"].get<double>(), 0.08);
  EXPECT_GT(score["poses"]["A"]["silhouette"]["fit"]["iou"].get<double>(), 0.8);
}

}  // namespace
}  // namespace sweepfit
