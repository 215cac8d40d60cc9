// SPDX-License-Identifier: Apache-2.0
#include "model/template.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "apps/runtime.h"
#include "apps/verbs.h"
#include "experiments/output_folder.h"
#include "experiments/portraits.h"
#include "model/body_io.h"
#include "model/file_io.h"
#include "model/gltf.h"
#include "model/input_error.h"
#include "model/template_import.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

// A fit writes a body.json too: it must not be taken for a template.
constexpr char kMarker[] = "template.json";
constexpr int kCloseUpsPerRow = 4;

struct TemplateArguments {
  CommonArguments common;
  TemplateOptions options;
  std::string from;
  std::string names = "auto";
  std::string out;
  int size = 900;
};

void WritePicture(const fs::path& path, const cv::Mat3b& picture) {
  if (!cv::imwrite(path.string(), picture))
    throw InputError(path.string() + ": cannot write the picture");
}

void WriteModel(const Body& body, const fs::path& path) {
  Pose rest;
  for (const Eigen::Vector3d& vertex : RestVertices(body)) {
    rest.root_in_world.y() = std::max(rest.root_in_world.y(), -vertex.y());
  }
  SaveGlb(body,
          FitSkinWeights(body, kSkinPoses, kSkinSeed).weights,
          {{"rest", {0.0}, {rest}}},
          {},
          path.string());
}

Body ReadOrBuild(const TemplateArguments& arguments, Progress* progress) {
  if (arguments.from.empty()) return BuildTemplate(arguments.options);
  return ImportTemplate(arguments.from, arguments.names, progress);
}

// How the body was made.
void WriteMarker(const TemplateArguments& arguments, const fs::path& path) {
  const TemplateOptions& options = arguments.options;
  const nlohmann::ordered_json json =
      arguments.from.empty()
          ? nlohmann::ordered_json({{"sex", options.sex},
                                    {"stature", options.stature},
                                    {"mass", options.mass}})
          : nlohmann::ordered_json(
                {{"from", arguments.from}, {"names", arguments.names}});
  WriteWholeFile(json.dump(1) + "\n", path.string());
}

void RunTemplate(const TemplateArguments& arguments) {
  Runtime runtime(arguments.common);
  if (arguments.size < 64 || arguments.size > 4096)
    throw InputError("template: --size must be 64 to 4096 pixels");
  OutputFolder output(arguments.out, kMarker);
  const fs::path& folder = output.temporary();
  runtime.progress()->Stage("template", "");
  const Body body = ReadOrBuild(arguments, runtime.progress());
  WriteMarker(arguments, folder / kMarker);
  SaveBody(body, (folder / "body.json").string());
  TriangleMesh mesh;
  mesh.vertices = RestVertices(body);
  mesh.triangles = TriangulateQuads(body.topology.quads, mesh.vertices);
  SavePly(mesh, (folder / "template.ply").string());
  runtime.progress()->Stage("pictures", "");
  const auto portraits = DrawPortraits(body, arguments.size);
  fs::create_directories(folder / "renders");
  for (const Portrait& portrait : portraits)
    WritePicture(folder / "renders" / (portrait.name + ".png"),
                 portrait.picture);
  WritePicture(folder / "renders.png",
               DrawPortraitSheet(portraits, kCloseUpsPerRow));
  runtime.progress()->Stage("skin", "");
  WriteModel(body, folder / "template.glb");
  output.Commit();
  runtime.progress()->Clear();
  if (!runtime.quiet()) {
    std::printf("%d vertices, %zu faces, %.2f m, %.1f kg\nbody: %s\n",
                body.num_vertices(),
                body.topology.quads.size(),
                body.stature,
                body.mass,
                arguments.out.c_str());
  }
}

}  // namespace

void AddTemplateVerb(CLI::App* command, std::function<void()>* run) {
  CLI::App* verb = command->add_subcommand(
      "template",
      "Write the generic body that every fit starts from, or look at one of "
      "your own");
  auto arguments = std::make_shared<TemplateArguments>();
  TemplateOptions& options = arguments->options;
  verb->add_option("--out", arguments->out, "Folder to make")->required();
  verb->add_option("--sex", options.sex, "0 female .. 1 male")
      ->capture_default_str();
  verb->add_option("--stature", options.stature, "Metres")
      ->capture_default_str();
  verb->add_option(
          "--mass", options.mass, "Kilograms; 0: the mean for sex and stature")
      ->capture_default_str();
  verb->add_option("--from",
                   arguments->from,
                   "A rigged, skinned person (.glb) to import instead, as "
                   "'fit --template' does; --sex, --stature and --mass do not "
                   "matter then");
  verb->add_option("--names",
                   arguments->names,
                   "Joint names of --from: auto, a preset (" +
                       JointNamePresetList() +
                       ") or a YAML file, a line 'l_elbow: NAME' per joint")
      ->capture_default_str();
  verb->add_option("--size", arguments->size, "Height of the pictures, pixels")
      ->capture_default_str();
  AddCommonArguments(verb, &arguments->common);
  verb->footer(
      "Example: sweepfit template --out woman --sex 0 --stature 1.65\n"

      "Example: sweepfit template --out mine --from person.glb");
  verb->callback(
      [arguments, run] { *run = [arguments] { RunTemplate(*arguments); }; });
}

}  // namespace sweepfit
