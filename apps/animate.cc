// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "apps/runtime.h"
#include "apps/verbs.h"
#include "experiments/motion_preview.h"
#include "model/body_io.h"
#include "model/bvh.h"
#include "model/export_names.h"
#include "model/file_io.h"
#include "model/gltf.h"
#include "model/input_error.h"
#include "model/lbs.h"
#include "model/retarget.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

struct AnimateArguments {
  CommonArguments common;
  std::string result;
  std::string bvh;
  std::string out;
  std::string bvh_out;
  std::string preview;
  std::string scale = "auto";
  RetargetOptions options;
  PreviewOptions preview_options;
  GltfOptions gltf;
  bool with_helpers = true;
};

// Metres per unit of a BVH file; 0: by the legs.
double ParseScale(const std::string& text) {
  if (text == "auto") return 0;
  if (text == "m") return 1;
  if (text == "cm") return 0.01;
  if (text == "mm") return 0.001;
  if (text == "inch") return 0.0254;
  // The CMU database counts in units of 1/0.45 inch.
  if (text == "cmu") return 0.0254 / 0.45;
  try {
    size_t used = 0;
    const double scale = std::stod(text, &used);
    if (used == text.size() && scale > 0 && std::isfinite(scale)) return scale;
  } catch (const std::logic_error&) {
  }
  throw InputError(
      "--scale must be auto, m, cm, mm, inch, cmu or metres per "
      "unit, not '" +
      text + "'");
}

// The contact sheet lies beside the animated picture.
std::string SheetPath(const std::string& preview) {
  fs::path path = preview;
  if (path.extension() != ".webp") {
    throw InputError(
        "--preview writes animated WebP: name a file *.webp, not '" + preview +
        "'");
  }
  path.replace_extension();
  path += "_sheet.png";
  return path.string();
}

void RunAnimate(const AnimateArguments& arguments) {
  Runtime runtime(arguments.common);
  Progress* progress = runtime.progress();
  RetargetOptions options = arguments.options;
  options.scale = ParseScale(arguments.scale);
  if (const auto error = options.Check()) throw InputError(*error);
  if (const auto error = arguments.preview_options.Check()) {
    throw InputError("--preview, --view: " + *error);
  }
  const std::string sheet =
      arguments.preview.empty() ? "" : SheetPath(arguments.preview);

  ExportNames(arguments.gltf.names);  // a wrong name is told at once
  progress->Stage("load", "");
  const fs::path folder = arguments.result;
  const Body body = LoadBody((folder / "body.json").string());
  const BvhMotion motion = LoadBvh(arguments.bvh);
  GltfOptions gltf = arguments.gltf;
  if (fs::exists(folder / "texture.png")) {
    const std::string png = ReadWholeFile((folder / "texture.png").string());
    gltf.texture_png.assign(png.begin(), png.end());
  }

  progress->Stage("retarget", std::to_string(motion.num_frames()) + " frames");
  const RetargetResult retargeted =
      Retarget(motion, body, options, arguments.bvh);
  for (const std::string& note : retargeted.notes) progress->Warning(note);

  progress->Stage("skin", "");
  const SkinFit skin =
      FitSkinWeights(body, kSkinPoses, kSkinSeed, arguments.with_helpers);

  progress->Stage("write", "");
  const Clip clip = {fs::path(arguments.bvh).stem().string(),
                     retargeted.time,
                     retargeted.poses};
  const std::vector<ClipReport> reports =
      SaveGlb(body, skin.weights, {clip}, gltf, arguments.out);
  if (!arguments.bvh_out.empty()) {
    SaveBvh(
        BvhFromPoses(body.skeleton, retargeted.poses, retargeted.frame_time),
        arguments.bvh_out);
  }
  if (!arguments.preview.empty()) {
    cv::Mat3b texture;
    if (!gltf.texture_png.empty()) {
      texture = cv::imdecode(gltf.texture_png, cv::IMREAD_COLOR);
    }
    const MotionPreview preview(body,
                                texture,
                                retargeted.poses,
                                retargeted.frame_time,
                                arguments.preview_options);
    if (preview.is_cut_short()) {
      progress->Warning("the preview shows the beginning of the motion only");
    }
    WriteMotionPreview(
        preview, arguments.preview_options, arguments.preview, sheet, progress);
  }
  runtime.progress()->Clear();
  if (runtime.quiet()) return;
  std::printf("%zu frames, %.2f s, joint names '%s', %.4g m per unit\n",
              retargeted.poses.size(),
              retargeted.time.back(),
              retargeted.names.c_str(),
              retargeted.metres_per_unit);
  std::printf("feet: stand %.0f %% of the time and slide at most %.1f mm\n",
              100 * retargeted.standing_share,
              1000 * retargeted.longest_slide);
  for (const ClipReport& report : reports) {
    std::printf(
        "clip against the sweeps: rms %.1f, at most %.1f mm (%d morph targets; "
        "%.1f, %.1f mm without)\n",
        1000 * report.rms,
        1000 * report.max,
        report.num_targets,
        1000 * report.rms_without,
        1000 * report.max_without);
  }
  if (reports.empty()) {
    std::printf(
        "skinning against the sweeps over the joint limits: rms %.1f, at most "
        "%.1f mm\n",
        1000 * skin.rms,
        1000 * skin.max);
  }
  std::printf("clip: %s\n", arguments.out.c_str());
  if (!sheet.empty()) {
    std::printf("preview: %s, %s\n", arguments.preview.c_str(), sheet.c_str());
  }
}

}  // namespace

void AddAnimateVerb(CLI::App* command, std::function<void()>* run) {
  CLI::App* verb = command->add_subcommand(
      "animate", "Move a fitted body by a BVH motion and write a GLB clip");
  auto arguments = std::make_shared<AnimateArguments>();
  verb->add_option("RESULT", arguments->result, "Result folder of fit")
      ->required();
  verb->add_option("--bvh", arguments->bvh, "Motion (BVH)")->required();
  verb->add_option("--out", arguments->out, "The GLB to write")->required();
  verb->add_option("--bvh-out",
                   arguments->bvh_out,
                   "Write the motion of the body's own skeleton (BVH, cm)");
  verb->add_option("--preview",
                   arguments->preview,
                   "Write an animated picture (*.webp) and, beside it, a sheet "
                   "of frames (*_sheet.png)");
  verb->add_option("--view",
                   arguments->preview_options.azimuth,
                   "Where the preview looks from: degrees from the front "
                   "towards the person's left (default: 40)");
  verb->add_option("--map",
                   arguments->options.names,
                   "Joint names of the motion: auto, a preset (" +
                       JointNamePresetList() +
                       ") or a YAML file (default: auto)");
  verb->add_option("--scale",
                   arguments->scale,
                   "Length unit of the motion for the way over the floor: m, "
                   "cm, mm, inch, cmu or metres per unit (default: auto, so "
                   "that steps fit the legs)");
  verb->add_option("--fps",
                   arguments->options.frames_per_second,
                   "Frames per second of the clip (default: those of the "
                   "motion up to 60)");
  verb->add_option(
      "--start", arguments->options.start, "Begin here, seconds (default: 0)");
  verb->add_option(
      "--end", arguments->options.end, "Stop here, seconds (default: the end)");
  verb->add_flag("!--no-foot-lock",
                 arguments->options.lock_feet,
                 "Let feet slide as the motion has them");
  verb->add_flag("!--no-joint-limits",
                 arguments->options.limit_joints,
                 "Let joints leave their limits");
  verb->add_option("--names",
                   arguments->gltf.names,
                   "Joint names in the GLB: sweepfit, mixamo, unity, unreal or "
                   "vrm (default: sweepfit)");
  verb->add_flag("!--lbs-only",
                 arguments->gltf.correctives,
                 "No morph targets, for programs that do not know them: bent "
                 "joints then differ from the sweeps by millimetres");
  verb->add_flag("!--no-helpers",
                 arguments->with_helpers,
                 "Skin with the 21 joints alone, for programs that play other "
                 "clips on the body");
  AddCommonArguments(verb, &arguments->common);
  verb->footer(
      "Example: sweepfit animate results/anna --bvh walk.bvh --out walk.glb "
      "--preview walk.webp");
  verb->callback(
      [arguments, run] { *run = [arguments] { RunAnimate(*arguments); }; });
}

}  // namespace sweepfit
