// SPDX-License-Identifier: Apache-2.0
#include "apps/synth.h"

#include <cstdio>
#include <memory>
#include <string>

#include "apps/runtime.h"
#include "apps/verbs.h"
#include "experiments/output_folder.h"
#include "model/file_io.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

constexpr char kMarker[] = "synthetic.json";

struct SynthArguments {
  CommonArguments common;
  std::string folder;
  SyntheticOptions options;
  int size = 0;  // set from the options' default
  bool masks = false;
};

void RunSynth(const SynthArguments& arguments) {
  Runtime runtime(arguments.common);
  SyntheticOptions options = arguments.options;
  options.width = options.height = arguments.size;
  options.background = !arguments.masks;
  MakeSyntheticCapture(arguments.folder, options, runtime.progress());
  runtime.progress()->Clear();
  if (!runtime.quiet()) {
    std::printf("capture: %s\n", arguments.folder.c_str());
  }
}

}  // namespace

Capture MakeSyntheticCapture(const std::filesystem::path& folder,
                             const SyntheticOptions& options,
                             Progress* progress) {
  if (const auto error = options.Check()) throw InputError("synth: " + *error);
  OutputFolder output(folder, kMarker);
  WriteSyntheticCapture(output.temporary(), options, progress);
  WriteWholeFile(SyntheticOptionsToJson(options).dump(1) + "\n",
                 (output.temporary() / kMarker).string());
  output.Commit();
  return LoadCapture(folder);
}

void AddSynthVerb(CLI::App* command, std::function<void()>* run) {
  CLI::App* verb = command->add_subcommand(
      "synth", "Make a synthetic capture with ground truth");
  auto arguments = std::make_shared<SynthArguments>();
  SyntheticOptions& options = arguments->options;
  arguments->size = options.width;
  verb->add_option("DIR", arguments->folder, "Capture folder to make")
      ->required();
  verb->add_option("--seed,--subject",
                   options.seed,
                   "Number of the person: shape, colours, exact posture")
      ->capture_default_str();
  verb->add_option("--cameras",
                   options.num_cameras,
                   "Cameras on a ring; of 16 or more every odd one is held out")
      ->capture_default_str();
  verb->add_option("--poses", options.poses, "Poses: A, T, N")
      ->delimiter(',')
      ->capture_default_str();
  verb->add_option("--size", arguments->size, "Pictures: pixels along a side")
      ->capture_default_str();
  verb->add_option("--yaw",
                   options.yaw_degrees,
                   "Turn of the person about the vertical, degrees")
      ->capture_default_str();
  verb->add_option("--shift-x", options.shift_x, "Place on the floor, metres")
      ->capture_default_str();
  verb->add_option("--shift-z", options.shift_z, "Place on the floor, metres")
      ->capture_default_str();
  verb->add_option("--noise", options.noise, "Sensor noise, grey levels")
      ->capture_default_str();
  verb->add_flag(
      "--masks", arguments->masks, "Give silhouettes instead of plates");
  AddCommonArguments(verb, &arguments->common);
  verb->footer(
      "Example: sweepfit synth captures/synthetic7 --seed 7 --poses A,T");
  verb->callback(
      [arguments, run] { *run = [arguments] { RunSynth(*arguments); }; });
}

}  // namespace sweepfit
