// SPDX-License-Identifier: Apache-2.0
#include "experiments/experiment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "experiments/experiment_runner.h"
#include "experiments/version.h"
#include "model/file_io.h"
#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Experiment Parse(const std::string& text) {
  const TemporaryFolder scratch;
  const fs::path file = scratch.path() / "experiment.yaml";
  WriteWholeFile(text, file.string());
  return LoadExperiment(file);
}

constexpr char kSubjects[] =
    "subjects: [{synthetic: {seeds: [4, 5], poses: [A]}}]\n";

TEST(Experiment, ReadsSubjectsAndVariants) {
  const Experiment experiment =
      Parse(std::string("name: weights\nposes: together\n") + kSubjects +
            "settings: {until: joints}\n"
            "variants:\n  default: {}\n"
            "  bare: {joints.weights.anthropometric: 0}\n");
  EXPECT_EQ(experiment.name, "weights");
  EXPECT_TRUE(experiment.poses_together);
  ASSERT_EQ(experiment.subjects.size(), 2u);
  EXPECT_EQ(experiment.subjects[1].name, "synthetic0005");
  EXPECT_EQ(experiment.subjects[1].synthetic->seed, 5u);
  ASSERT_EQ(experiment.variants.size(), 2u);
  EXPECT_EQ(experiment.variants[1].config.options.joints.weights.anthropometric,
            0);
  EXPECT_EQ(experiment.variants[1].config.options.until, "joints");
  EXPECT_THAT(experiment.variants[1].settings,
              ElementsAre("until=joints", "joints.weights.anthropometric=0"));
}

TEST(Experiment, GridIsTheProductInOrder) {
  const Experiment experiment =
      Parse(std::string("name: grid\n") + kSubjects +
            "variants: {a: {}, b: {local.mode: hull}}\n"
            "grid:\n  volume.voxel_size: [0.004, 0.008]\n");
  ASSERT_EQ(experiment.variants.size(), 4u);
  EXPECT_EQ(experiment.variants[0].name, "a,volume.voxel_size=0.004");
  EXPECT_EQ(experiment.variants[3].name, "b,volume.voxel_size=0.008");
  EXPECT_EQ(experiment.variants[3].config.options.volume.voxel_size, 0.008);
  EXPECT_EQ(experiment.variants[3].config.options.local.mode, "hull");
}

TEST(Experiment, ErrorsNameFileAndLine) {
  const struct {
    const char* rest;
    const char* says;
  } cases[] = {
      {"variants: {}\n", "no variant"},
      {"variants: {a: {volume.voxel: 1}}\n", "unknown key 'volume.voxel'"},
      {"variants: {a: {volume.voxel_size: -1}}\n", "voxel_size"},
      {"variants: {a: {until: segment}}\n", "volume or later"},
      {"variants: {a/b: {}}\n", "letters"},
      {"variants: {a: {}, a: {}}\n", "given twice"},
      {"variants: {a: {}}\nposes: some\n", "each or together"},
      {"variants: {a: {}}\ngrid: {until: joints}\n", "list of values"},
      {"variants: {a: {}}\nextra: 1\n", "unknown key 'extra'"},
      {"variants: {a: {}\n", "malformed YAML"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.rest);
    try {
      Parse(std::string("name: x\n") + kSubjects + c.rest);
      ADD_FAILURE() << "accepted";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(c.says));
      EXPECT_THAT(error.what(), HasSubstr("experiment.yaml"));
    }
  }
  EXPECT_THROW(LoadExperiment("no/such.yaml"), InputError);
  EXPECT_THROW(Parse("name: x\nsubjects: [{synthetic: {seeds: [2, 1]}}]\n"
                     "variants: {a: {}}\n"),
               InputError);
}

TEST(Experiment, RunsScoresAndGoesOnWhereItStopped) {
  Experiment experiment = Parse(
      "name: small\n"
      "subjects: [{synthetic: {seeds: [3, 3], poses: [A], cameras: 8,"
      " size: 260, masks: true}}]\n"
      "settings: {until: joints, volume.voxel_size: 0.008}\n"
      "variants:\n  default: {}\n"
      "  template_only: {joints.mode: paper, joints.weights.landmark: 0,"
      " joints.weights.template_ratio: 1, joints.weights.anthropometric: 0}\n"
      "  hull: {until: volume}\n");
  const TemporaryFolder scratch;
  RunExperiment(experiment, scratch.path(), {0, 2}, nullptr);
  const auto count = [&] {
    size_t files = 0;
    for ([[maybe_unused]] const auto& entry :
         fs::directory_iterator(scratch.path() / "runs")) {
      ++files;
    }
    return files;
  };
  EXPECT_EQ(count(), 2u);  // runs 0 and 2 of 3
  RunExperiment(experiment, scratch.path(), {0, 1}, nullptr);
  EXPECT_EQ(count(), 3u);

  ReportExperiment(scratch.path());
  std::ifstream lines(scratch.path() / "results.jsonl");
  double limbs[2] = {-1, -1};
  int rows = 0;
  for (std::string line; std::getline(lines, line); ++rows) {
    const auto row = nlohmann::json::parse(line);
    EXPECT_EQ(row["status"], "ok");
    const auto& score = row["scores"]["A"];
    if (row["variant"] == "hull") {
      EXPECT_FALSE(score.contains("joints"));
      // A hull holds the person, so it is larger.
      EXPECT_GT(score["surface"]["fit_to_truth"]["signed_mean"], 0);
      continue;
    }
    limbs[row["variant"] == "template_only"] = score["joints"]["limb_mpjpe"];
  }
  EXPECT_EQ(rows, 3);
  EXPECT_GT(limbs[0], 0);
  EXPECT_LT(limbs[0], 0.05);
  EXPECT_LT(limbs[0], limbs[1]);  // a scaled template is the weakest guess

  // A report is a function of the runs.
  const std::string report =
      ReadWholeFile((scratch.path() / "report.html").string());
  EXPECT_THAT(report, HasSubstr("template_only"));
  ReportExperiment(scratch.path());
  EXPECT_EQ(report, ReadWholeFile((scratch.path() / "report.html").string()));
}

// Reads the report's lines: one per run.
std::vector<nlohmann::json> ReportedRuns(const fs::path& folder) {
  ReportExperiment(folder);
  std::ifstream lines(folder / "results.jsonl");
  std::vector<nlohmann::json> runs;
  for (std::string line; std::getline(lines, line);) {
    runs.push_back(nlohmann::json::parse(line));
  }
  return runs;
}

// A folder of runs that stop at the hull.
class ExperimentFolderTest : public ::testing::Test {
 protected:
  void Run(int size, const std::string& variants) {
    const fs::path file = scratch_.path() / "experiment.yaml";
    WriteWholeFile(
        "name: small\n"
        "subjects: [{synthetic: {seeds: [3, 3], cameras: 8, masks: true,"
        " size: " +
            std::to_string(size) +
            "}}]\n"
            "settings: {until: volume, volume.voxel_size: 0.008}\n"
            "variants: " +
            variants + "\n",
        file.string());
    RunExperiment(LoadExperiment(file), folder_, {0, 1}, nullptr);
  }

  TemporaryFolder scratch_;
  fs::path folder_ = scratch_.path() / "out";
};

TEST_F(ExperimentFolderTest, VariantsOfEqualSettingsAreTwoRuns) {
  Run(200, "{one: {}, other: {}}");
  const auto runs = ReportedRuns(folder_);
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[0]["variant"], "one");
  EXPECT_EQ(runs[1]["variant"], "other");
  EXPECT_EQ(runs[0]["scores"], runs[1]["scores"]);
}

TEST_F(ExperimentFolderTest, OtherOptionsAreOtherPicturesAndRuns) {
  Run(200, "{default: {}}");
  const auto coarse = ReportedRuns(folder_);
  Run(240, "{default: {}}");
  const auto fine = ReportedRuns(folder_);
  ASSERT_EQ(coarse.size(), 1u);
  ASSERT_EQ(fine.size(), 1u);
  EXPECT_NE(coarse[0]["scores"], fine[0]["scores"]);
  EXPECT_THAT(ReadWholeFile((folder_ / "report.md").string()),
              HasSubstr("1 of 1 runs. 1 runs of another build"));
  // And back: what was done before counts again.
  Run(200, "{default: {}}");
  EXPECT_EQ(ReportedRuns(folder_), coarse);
}

TEST_F(ExperimentFolderTest, RunsOfAnotherBuildAreNotMixedIn) {
  Run(200, "{default: {}}");
  const auto runs = ReportedRuns(folder_);
  ASSERT_EQ(runs.size(), 1u);
  EXPECT_EQ(runs[0]["version"], kVersion);
  nlohmann::json other = runs[0];
  other["version"] = "0.0.9+0123456789";
  other["id"] = "0123456789abcdef";
  WriteWholeFile(other.dump(),
                 (folder_ / "runs" / "0123456789abcdef.json").string());
  EXPECT_EQ(ReportedRuns(folder_), runs);
  EXPECT_THAT(ReadWholeFile((folder_ / "report.md").string()),
              HasSubstr(kVersion));
  EXPECT_THAT(ReadWholeFile((folder_ / "report.md").string()),
              HasSubstr("are left out"));
}

TEST(Experiment, ReportOfNothingIsAnError) {
  const TemporaryFolder scratch;
  EXPECT_THROW(ReportExperiment(scratch.path()), InputError);
}

}  // namespace
}  // namespace sweepfit
