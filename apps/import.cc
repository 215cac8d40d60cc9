// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <string>

#include "apps/runtime.h"
#include "apps/verbs.h"
#include "capture/import_format.h"
#include "experiments/import_to_folder.h"

namespace sweepfit {
namespace {

struct ImportArguments {
  CommonArguments common;
  std::string folder;
  std::string source;
  ImportOptions options;
};

void RunImport(ImportArguments arguments) {
  Runtime runtime(arguments.common);
  arguments.options.source = arguments.source;
  const ImportReport report =
      ImportToFolder(arguments.options, arguments.folder, runtime.progress());
  runtime.progress()->Clear();
  if (runtime.quiet()) return;
  std::printf("capture: %s\n", arguments.folder.c_str());
  std::printf("cameras: %zu, poses:", report.capture.cameras.size());
  for (const CapturePose& pose : report.capture.poses) {
    std::printf(" %s", pose.name.c_str());
  }
  std::printf("\nnext: sweepfit check %s\n", arguments.folder.c_str());
}

std::string Footer() {
  std::string text = "Formats and their SOURCE:\n";
  for (const CalibrationFormat& format : CalibrationFormats()) {
    std::string line = "  " + std::string(format.name);
    line.resize(16, ' ');
    text += line + std::string(format.meaning) + "\n";
  }
  return text +
         "\nIn a PATTERN {camera} stands for a camera's name, {pose} for a "
         "pose, * and ? for anything.\n"
         "Example: sweepfit import easymocap calibration captures/anna "
         "--images 'shots/{pose}/{camera}.jpg' --background "
         "'empty/{camera}.jpg'";
}

}  // namespace

void AddImportVerb(CLI::App* command, std::function<void()>* run) {
  CLI::App* verb = command->add_subcommand(
      "import", "Make a capture folder of another program's calibration");
  auto arguments = std::make_shared<ImportArguments>();
  ImportOptions& options = arguments->options;
  verb->add_option("FORMAT", options.format, "Format of the calibration")
      ->required();
  verb->add_option("SOURCE", arguments->source, "The calibration")->required();
  verb->add_option("DIR", arguments->folder, "Capture folder to make")
      ->required();
  verb->add_option("--images",
                   options.images,
                   "PATTERN of the pictures (default: those that the "
                   "calibration names)");
  verb->add_option(
      "--background", options.background, "PATTERN of the empty plates");
  verb->add_option("--masks",
                   options.masks,
                   "PATTERN of given silhouettes, or alpha: the pictures' "
                   "alpha channel");
  verb->add_option("--chroma-key",
                   options.chroma_key,
                   "green or blue: the screen behind the person");
  verb->add_option("--pose",
                   options.poses,
                   "Name of the pose (default: A); with {pose} in --images the "
                   "poses to take (default: all)")
      ->delimiter(',');
  verb->add_option("--holdout", options.holdout, "Cameras to hold out")
      ->delimiter(',');
  verb->add_option(
      "--scale", options.scale, "Metres per length unit of the calibration");
  verb->add_option("--stature",
                   options.stature,
                   "How tall the person stands, metres: sets the scale");
  verb->add_option("--up",
                   options.up,
                   "Axis that points away from the floor: y, -z, ..., three "
                   "numbers 0,-1,0, or cameras: as they are level (default: "
                   "what the format says, else cameras)");
  verb->add_flag(
      "--link", options.link, "Link to the pictures instead of copying them");
  AddCommonArguments(verb, &arguments->common);
  verb->footer(Footer());
  verb->callback(
      [arguments, run] { *run = [arguments] { RunImport(*arguments); }; });
}

}  // namespace sweepfit
