// SPDX-License-Identifier: Apache-2.0
#include "experiments/experiment_runner.h"

#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "capture/capture.h"
#include "experiments/evaluate.h"
#include "experiments/fit_to_folder.h"
#include "experiments/output_folder.h"
#include "experiments/result_folder.h"
#include "experiments/version.h"
#include "model/file_io.h"
#include "model/hash.h"
#include "model/input_error.h"
#include "solver/pipeline.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// A name by what goes into it; every build has names of its own.
std::string Hash(const std::string& text) {
  char name[17];
  std::snprintf(
      name,
      sizeof(name),
      "%016llx",
      static_cast<unsigned long long>(FnvHash(kVersion + ("\n" + text))));
  return name;
}

struct Run {
  const ExperimentSubject* subject;
  const ExperimentVariant* variant;
  FitConfig config;  // of the variant, with the poses
  std::string id;
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

// What a subject's pictures depend on.
std::string Content(const ExperimentSubject& subject) {
  if (subject.synthetic) {
    return SyntheticOptionsToJson(*subject.synthetic).dump();
  }
  return ReadWholeFile((subject.capture / "capture.yaml").string());
}

std::vector<std::string> PosesOf(const ExperimentSubject& subject) {
  if (subject.synthetic) return subject.synthetic->poses;
  std::vector<std::string> poses;
  for (const CapturePose& pose : LoadCapture(subject.capture.string()).poses) {
    poses.push_back(pose.name);
  }
  return poses;
}

// All runs of the experiment, subject by subject.
std::vector<Run> RunsOf(const Experiment& experiment) {
  std::vector<Run> runs;
  for (const ExperimentSubject& subject : experiment.subjects) {
    std::vector<std::vector<std::string>> fits = {PosesOf(subject)};
    if (!experiment.poses_together) {
      const std::vector<std::string> poses = std::move(fits.front());
      fits.clear();
      for (const std::string& pose : poses) fits.push_back({pose});
    }
    const std::string what = subject.name + "\n" + Content(subject) + "\n";
    for (const std::vector<std::string>& poses : fits) {
      for (const ExperimentVariant& variant : experiment.variants) {
        FitConfig config = variant.config;
        config.poses = poses;
        const std::string id =
            Hash(what + variant.name + "\n" + FitConfigToYaml(config));
        runs.push_back({&subject, &variant, std::move(config), id});
      }
    }
  }
  return runs;
}

// What the report goes by.
Json Plan(const Experiment& experiment, const std::vector<Run>& runs) {
  Json plan = {{"name", experiment.name},
               {"question", experiment.question},
               {"poses", experiment.poses_together ? "together" : "each"},
               {"version", kVersion}};
  for (const ExperimentSubject& subject : experiment.subjects) {
    plan["subjects"].push_back(subject.name);
  }
  for (const ExperimentVariant& variant : experiment.variants) {
    plan["variants"].push_back(
        {{"name", variant.name}, {"settings", variant.settings}});
  }
  for (const Run& run : runs) plan["runs"].push_back(run.id);
  return plan;
}

// Shards that begin at the same moment write it each under a name of its own.
void WritePlan(const Json& plan, const fs::path& path) {
  const fs::path temporary = TemporarySibling(path);
  WriteWholeFile(plan.dump(1) + "\n", temporary.string());
  std::error_code error;
  fs::rename(temporary, path, error);
  if (error) throw InputError(path.string() + ": cannot be written");
}

// The subject's capture, made first where it is synthetic and not there yet.
Capture OpenSubject(const ExperimentSubject& subject,
                    const fs::path& folder,
                    Progress* progress) {
  if (!subject.synthetic) return LoadCapture(subject.capture.string());
  const fs::path made =
      folder / "captures" / (subject.name + "_" + Hash(Content(subject)));
  if (!fs::exists(made / "capture.yaml")) {
    // Shards may run at the same time: the first to be done counts.
    const fs::path temporary = TemporarySibling(made);
    fs::create_directories(temporary);
    WriteSyntheticCapture(temporary, *subject.synthetic, progress);
    std::error_code taken;
    fs::rename(temporary, made, taken);
    if (taken) fs::remove_all(temporary);
  }
  return LoadCapture(made.string());
}

// Runs of another build or of other settings must not pass for these.
void WarnOfOtherRuns(const std::vector<Run>& runs,
                     const fs::path& folder,
                     Progress* progress) {
  std::set<std::string> ids;
  for (const Run& run : runs) ids.insert(run.id);
  int others = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    others += entry.path().extension() == ".json" &&
              !ids.contains(entry.path().stem().string());
  }
  if (others == 0 || progress == nullptr) return;
  progress->Warning(folder.string() + " holds " + std::to_string(others) +
                    " runs of another build or of other settings: they are not "
                    "used");
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
  const std::vector<Run> runs = RunsOf(experiment);
  WarnOfOtherRuns(runs, folder / "runs", progress);
  WritePlan(Plan(experiment, runs), folder / "experiment.json");
  const ExperimentSubject* opened = nullptr;
  Capture capture;
  std::optional<Observations> observations;
  for (size_t k = 0; k < runs.size(); ++k) {
    const Run& run = runs[k];
    const fs::path file = folder / "runs" / (run.id + ".json");
    if (static_cast<int>(k % shard.count) != shard.index || fs::exists(file)) {
      continue;
    }
    if (run.subject != opened) {
      observations.reset();
      capture = OpenSubject(*run.subject, folder, progress);
      observations.emplace(&capture);
      opened = run.subject;
    }
    const FitConfig config = ResolveConfig(capture, run.config);
    std::string poses;
    for (const std::string& pose : *config.poses) poses += pose;
    RunProgress of_run(
        run.subject->name + " " + poses + " " + run.variant->name, progress);
    Json row = {{"id", run.id},
                {"subject", run.subject->name},
                {"poses", *config.poses},
                {"variant", run.variant->name},
                {"settings", run.variant->settings},
                {"cameras", *config.cameras},
                {"version", kVersion},
                {"status", "not run"}};
    try {
      FitAndScore(capture, config, &*observations, &of_run, &row);
    } catch (const FitError& failure) {
      row["status"] = std::string("failed: ") + failure.what();
    }
    WriteWholeFile(row.dump(1) + "\n", file.string());
  }
}

}  // namespace sweepfit
