// SPDX-License-Identifier: Apache-2.0
#include "experiments/experiment_runner.h"

#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "capture/capture.h"
#include "experiments/evaluate.h"
#include "experiments/fit_to_folder.h"
#include "experiments/result_folder.h"
#include "experiments/version.h"
#include "model/file_io.h"
#include "model/input_error.h"
#include "solver/pipeline.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// FNV-1a, 64 bit: names a run by what goes into it.
std::string Hash(const std::string& text) {
  std::uint64_t hash = 14695981039346656037ull;
  for (const unsigned char c : text) {
    hash ^= c;
    hash *= 1099511628211ull;
  }
  char name[17];
  std::snprintf(
      name, sizeof(name), "%016llx", static_cast<unsigned long long>(hash));
  return name;
}

struct Run {
  const ExperimentSubject* subject;
  const ExperimentVariant* variant;
  std::vector<std::string> poses;
};

// What the pictures show depends on these options only.
std::string ObservationKey(const std::string& pose,
                           const std::vector<std::string>& cameras,
                           const FitOptions& options) {
  const Json json = FitOptionsToJson(options);
  return pose + Json(cameras).dump() + json.value("segment", Json()).dump() +
         json.value("coherence", Json()).dump() +
         json.value("volume", Json()).dump() +
         json.value("landmarks", Json()).dump();
}

// Observations of one subject, kept while its variants are run.
class Observations {
 public:
  explicit Observations(const Capture* capture) : capture_(capture) {}

  std::shared_ptr<const Observation> Get(
      const std::string& pose,
      const std::vector<std::string>& cameras,
      const FitOptions& options,
      Progress* progress) {
    FitOptions whole = options;
    whole.until = "landmarks";
    auto& seen = seen_[ObservationKey(pose, cameras, options)];
    if (seen == nullptr) {
      seen = std::make_shared<Observation>(
          Observe(*capture_, pose, cameras, whole, progress));
    }
    return seen;
  }

 private:
  const Capture* capture_;
  std::map<std::string, std::shared_ptr<const Observation>> seen_;
};

Json StagesToJson(const std::vector<StageSummary>& stages) {
  Json json = Json::array();
  for (const StageSummary& stage : stages) {
    json.push_back({{"stage", stage.stage},
                    {"status", stage.status},
                    {"warnings", stage.warnings},
                    {"figures", stage.figures}});
  }
  return json;
}

// Fits and scores; the row says how it went.
void FitAndScore(const Capture& capture,
                 const FitConfig& config,
                 Observations* observations,
                 Progress* progress,
                 Json* row) {
  const auto start = std::chrono::steady_clock::now();
  std::vector<std::shared_ptr<const Observation>> seen;
  for (const std::string& pose : *config.poses) {
    seen.push_back(
        observations->Get(pose, *config.cameras, config.options, progress));
  }
  const FitResult result =
      FitObserved(seen, *config.cameras, config.options, progress);
  (*row)["stages"] = StagesToJson(result.stages);
  Json times = Json::object();
  double seconds = 0;
  for (const StageSummary& stage : result.stages) {
    times[stage.stage] = stage.seconds;
    seconds += stage.seconds;
  }
  times["fit"] = seconds;
  times["wall"] =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
          .count();
  if (progress != nullptr) progress->Stage("score", "");
  for (const PoseResult& pose : result.poses) {
    FittedPose fitted;
    if (RunsStage(config.options, "joints")) {
      fitted.joints.emplace();
      for (int joint = 0; joint < kNumJoints; ++joint) {
        (*fitted.joints)[joint] = pose.frames.joint_in_world[joint];
      }
    } else {
      fitted.mesh = pose.seen->volume->ExtractMesh();
    }
    if (RunsStage(config.options, "global")) {
      fitted.mesh = PosedMesh(result.body, pose.vertices_in_world);
    }
    (*row)["scores"][pose.name] = PoseScoreToJson(ScoreAgainstTruth(
        capture, pose.name, fitted, *config.cameras, EvaluateOptions()));
  }
  (*row)["times"] = times;
  (*row)["status"] = "ok";
}

std::vector<Run> RunsOf(const Experiment& experiment,
                        const ExperimentSubject& subject,
                        const std::vector<std::string>& poses) {
  std::vector<Run> runs;
  if (experiment.poses_together) {
    for (const ExperimentVariant& variant : experiment.variants) {
      runs.push_back({&subject, &variant, poses});
    }
    return runs;
  }
  for (const std::string& pose : poses) {
    for (const ExperimentVariant& variant : experiment.variants) {
      runs.push_back({&subject, &variant, {pose}});
    }
  }
  return runs;
}

std::vector<std::string> PosesOf(const Capture& capture) {
  std::vector<std::string> poses;
  for (const CapturePose& pose : capture.poses) poses.push_back(pose.name);
  return poses;
}

Json Plan(const Experiment& experiment) {
  Json plan = {{"name", experiment.name},
               {"question", experiment.question},
               {"poses", experiment.poses_together ? "together" : "each"}};
  for (const ExperimentSubject& subject : experiment.subjects) {
    plan["subjects"].push_back(subject.name);
  }
  for (const ExperimentVariant& variant : experiment.variants) {
    plan["variants"].push_back(
        {{"name", variant.name}, {"settings", variant.settings}});
  }
  return plan;
}

// The subject's capture, made first where it is synthetic and not there yet.
Capture OpenSubject(const ExperimentSubject& subject,
                    const fs::path& folder,
                    Progress* progress) {
  if (!subject.synthetic) return LoadCapture(subject.capture.string());
  const fs::path made = folder / "captures" / subject.name;
  if (!fs::exists(made / "capture.yaml")) {
    // Shards may run at the same time: the first to be done counts.
    const fs::path temporary =
        made.string() + ".part" + std::to_string(getpid());
    fs::create_directories(temporary);
    WriteSyntheticCapture(temporary, *subject.synthetic, progress);
    std::error_code taken;
    fs::rename(temporary, made, taken);
    if (taken) fs::remove_all(temporary);
  }
  return LoadCapture(made.string());
}

// Says which run it is before what the run says of itself.
class RunProgress : public Progress {
 public:
  RunProgress(std::string run, Progress* next)
      : run_(std::move(run)), next_(next) {}
  void Stage(const std::string& stage, const std::string& detail) override {
    if (next_ != nullptr) {
      next_->Stage(run_, detail.empty() ? stage : stage + " " + detail);
    }
  }
  // Runs are expected to differ; what was weak is in their files.
  void Warning(const std::string&) override {}

 private:
  std::string run_;
  Progress* next_;
};

}  // namespace

void RunExperiment(const Experiment& experiment,
                   const fs::path& folder,
                   const ExperimentShard& shard,
                   Progress* progress) {
  std::error_code error;
  fs::create_directories(folder / "runs", error);
  if (error) throw InputError(folder.string() + ": cannot create the folder");
  WriteWholeFile(Plan(experiment).dump(1) + "\n",
                 (folder / "experiment.json").string());
  int index = 0;
  for (const ExperimentSubject& subject : experiment.subjects) {
    const Capture capture = OpenSubject(subject, folder, progress);
    Observations observations(&capture);
    for (const Run& run : RunsOf(experiment, subject, PosesOf(capture))) {
      if (index++ % shard.count != shard.index) continue;
      FitConfig config = run.variant->config;
      config.poses = run.poses;
      config = ResolveConfig(capture, config);
      const std::string id =
          Hash(subject.name + "\n" + FitConfigToYaml(config) + kVersion);
      const fs::path file = folder / "runs" / (id + ".json");
      if (fs::exists(file)) continue;
      std::string poses;
      for (const std::string& pose : run.poses) poses += pose;
      RunProgress of_run(subject.name + " " + poses + " " + run.variant->name,
                         progress);
      Json row = {{"id", id},
                  {"subject", subject.name},
                  {"poses", run.poses},
                  {"variant", run.variant->name},
                  {"settings", run.variant->settings},
                  {"cameras", *config.cameras},
                  {"version", kVersion},
                  {"status", "not run"}};
      try {
        FitAndScore(capture, config, &observations, &of_run, &row);
      } catch (const FitError& failure) {
        row["status"] = std::string("failed: ") + failure.what();
      }
      WriteWholeFile(row.dump(1) + "\n", file.string());
    }
  }
}

}  // namespace sweepfit
