// SPDX-License-Identifier: Apache-2.0
#include "experiments/result_folder.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "capture/render.h"
#include "experiments/metrics.h"
#include "experiments/overlay.h"
#include "experiments/report_html.h"
#include "experiments/version.h"
#include "model/body_io.h"
#include "model/bvh.h"
#include "model/file_io.h"
#include "model/gltf.h"
#include "model/input_error.h"
#include "model/obj.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kRenderWidth = 420;
constexpr int kRenderHeight = 640;

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
      .count();
}

void WritePicture(const fs::path& path, const cv::Mat& picture) {
  // OpenCV's own parameters (runs only, one filter) take half the time of any
  // compression level that is named, and the files are no larger.
  bool written = false;
  try {
    written = cv::imwrite(path.string(), picture);
  } catch (const cv::Exception&) {
    written = false;
  }
  if (!written) throw InputError(path.string() + ": cannot write the picture");
}

// Readable for people, exact for programs.
std::string Dump(const Json& json) { return json.dump(1) + "\n"; }

template <typename Derived>
Json ToJson(const Eigen::DenseBase<Derived>& values) {
  Json list = Json::array();
  for (Eigen::Index row = 0; row < values.rows(); ++row) {
    for (Eigen::Index column = 0; column < values.cols(); ++column) {
      list.push_back(values(row, column));
    }
  }
  return list;
}

// One picture of one pose with everything that is known of it.
struct ViewJob {
  const PoseResult* pose;
  const View* view;
  std::string name;  // <pose>_<camera>
  SilhouetteError error;
};

class Writer {
 public:
  Writer(const ResultInput& input, const fs::path& folder)
      : input_(input),
        result_(input.result),
        options_(input.config.options),
        folder_(folder),
        has_mesh_(RunsStage(options_, "global")) {
    for (const PoseResult& pose : result_.poses) {
      meshes_.push_back(has_mesh_
                            ? PosedMesh(result_.body, pose.vertices_in_world)
                            : TriangleMesh());
      for (const View& view : pose.seen->views) {
        jobs_.push_back({&pose, &view, pose.name + "_" + view.camera.id, {}});
      }
    }
  }

  Json Write() {
    const auto start = std::chrono::steady_clock::now();
    Save(FitConfigToYaml(input_.config), "fit.yaml");
    if (RunsStage(options_, "landmarks")) {
      Save(Dump(LandmarksToJson(result_.poses)), "landmarks.json");
    }
    Json joints = Json::object();
    if (RunsStage(options_, "joints")) {
      joints = JointsToJson(result_.poses);
      Save(Dump(joints), "joints.json");
      WritePosesBvh();
    }
    tbb::parallel_invoke(
        [this] {
          if (result_.texture) WriteTexture();
          if (result_.skin) WriteModel();
        },
        [this] {
          if (RunsStage(options_, "volume")) WriteVolumes();
        },
        [this] {
          if (!has_mesh_) return;
          WriteBody();
          WriteRenders();
        },
        [this] { WriteViews(); },
        [this] { WriteSilhouetteSheet(); });
    const Json report = Report(SecondsSince(start));
    Save(ReportHtml(report, joints, pictures_), "report.html");
    Save(Dump(report), kReportFile);
    return report;
  }

 private:
  void Save(const std::string& bytes, const char* name) const {
    WriteWholeFile(bytes, (folder_ / name).string());
  }

  const TriangleMesh& MeshOf(const PoseResult& pose) const {
    return meshes_[&pose - result_.poses.data()];
  }

  // Masks, overlays and scores; every picture on its own, so that the order in
  // which threads take them does not matter.
  void WriteViews() {
    fs::create_directories(folder_ / "masks");
    fs::create_directories(folder_ / "overlays");
    tbb::parallel_for(
        size_t{0}, jobs_.size(), [this](size_t i) { WriteView(&jobs_[i]); });
    for (const ViewJob& job : jobs_) {
      pictures_.overlays.push_back({"overlays/" + job.name + ".png", job.name});
    }
  }

  void WriteSilhouetteSheet() {
    std::vector<SheetRow> rows;
    for (const PoseResult& pose : result_.poses) {
      rows.push_back({pose.name, &pose.seen->views});
    }
    const cv::Mat3b sheet = DrawSilhouetteSheet(rows);
    if (sheet.empty()) return;
    WritePicture(folder_ / "silhouettes.png", sheet);
    pictures_.silhouettes = "silhouettes.png";
  }

  void WriteView(ViewJob* job) const {
    cv::Mat1b mask;
    job->view->coverage.convertTo(mask, CV_8U, 255);
    WritePicture(folder_ / "masks" / (job->name + ".png"), mask);
    OverlayContent content;
    content.pose = job->pose->name;
    if (has_mesh_) {
      content.mesh_coverage =
          RenderCoverage(job->view->camera, MeshOf(*job->pose));
      job->error = CompareMasks(content.mesh_coverage, job->view->coverage);
      content.error = job->error;
    }
    if (RunsStage(options_, "joints")) content.frames = &job->pose->frames;
    if (RunsStage(options_, "landmarks")) {
      content.landmarks = &job->pose->seen->landmarks.points;
    }
    WritePicture(folder_ / "overlays" / (job->name + ".png"),
                 DrawOverlay(*job->view, content));
  }

  void WriteVolumes() const {
    for (const PoseResult& pose : result_.poses) {
      if (!pose.seen->volume) continue;
      const fs::path base = folder_ / ("volume_" + pose.name);
      pose.seen->volume->SaveVdb(base.string() + ".vdb");
      SavePly(pose.seen->volume->ExtractMesh(), base.string() + ".ply");
    }
  }

  void WriteBody() const {
    SaveBody(result_.body, (folder_ / "body.json").string());
    for (const PoseResult& pose : result_.poses) {
      SavePly(MeshOf(pose),
              (folder_ / ("mesh_" + pose.name + ".ply")).string());
      if (options_.exported.obj) {
        SaveObj(result_.body.topology,
                pose.vertices_in_world,
                result_.texture ? "texture.png" : "",
                (folder_ / ("mesh_" + pose.name + ".obj")).string());
      }
    }
  }

  // The atlas colour of each vertex: the mean over the corners that meet there.
  std::vector<cv::Vec3b> VertexColors() const {
    if (!result_.texture) return {};
    const cv::Mat3b& atlas = result_.texture->atlas;
    std::vector<cv::Vec3d> sum(result_.body.num_vertices(), cv::Vec3d());
    std::vector<int> count(result_.body.num_vertices(), 0);
    const BodyTopology& topology = result_.body.topology;
    for (size_t q = 0; q < topology.quads.size(); ++q) {
      for (int corner = 0; corner < 4; ++corner) {
        const Eigen::Vector2f& uv = topology.uv[q][corner];
        const int x = static_cast<int>(uv.x() * atlas.cols);
        const int y = static_cast<int>((1 - uv.y()) * atlas.rows);
        const int vertex = topology.quads[q][corner];
        sum[vertex] += cv::Vec3d(atlas(std::clamp(y, 0, atlas.rows - 1),
                                       std::clamp(x, 0, atlas.cols - 1)));
        ++count[vertex];
      }
    }
    std::vector<cv::Vec3b> color(sum.size());
    for (size_t i = 0; i < sum.size(); ++i) {
      color[i] = cv::Vec3b(sum[i] / std::max(count[i], 1));
    }
    return color;
  }

  struct Aspect {
    const char* name;
    double azimuth;  // degrees from the subject's front towards its left
  };

  // Shaded pictures around each pose, plain and in colour.
  void WriteRenders() {
    fs::create_directories(folder_ / "renders");
    const std::vector<cv::Vec3b> colors = VertexColors();
    for (const PoseResult& pose : result_.poses) {
      const Eigen::Vector3d front = pose.frames.world_from_joint[kRoot].col(2);
      const double facing = std::atan2(front.x(), front.z()) * 180 / M_PI;
      for (const Aspect& aspect : {Aspect{"front", 0},
                                   Aspect{"three_quarter", 40},
                                   Aspect{"left", 90},
                                   Aspect{"back", 180}}) {
        const Camera camera = LookAtMesh(MeshOf(pose),
                                         facing + aspect.azimuth,
                                         5,
                                         kRenderWidth,
                                         kRenderHeight);
        const std::string name = pose.name + "_" + aspect.name;
        std::vector<std::vector<cv::Vec3b>> colorings = {{}};
        if (!colors.empty()) colorings.push_back(colors);
        const std::vector<cv::Mat3b> pictures =
            RenderColorings(camera, MeshOf(pose), colorings);
        WriteRender(pictures[0], name);
        if (!colors.empty()) WriteRender(pictures[1], name + "_textured");
      }
    }
  }

  void WriteRender(const cv::Mat3b& picture, const std::string& name) {
    const std::string path = "renders/" + name + ".png";
    WritePicture(folder_ / path, picture);
    pictures_.renders.push_back({path, name});
  }

  // Encoded once, for the model too.
  void WriteTexture() {
    cv::imencode(".png", result_.texture->atlas, texture_png_);
    Save(std::string(texture_png_.begin(), texture_png_.end()), "texture.png");
    pictures_.texture = "texture.png";
  }

  // model.glb: at rest, standing on the floor of its own, first; then every
  // captured posture as a clip of one key.
  void WriteModel() {
    Pose rest;
    double lowest = 0;
    for (const Eigen::Vector3d& vertex : RestVertices(result_.body)) {
      lowest = std::min(lowest, vertex.y());
    }
    rest.root_in_world.y() = -lowest;
    std::vector<Clip> clips = {{"rest", {0.0}, {rest}}};
    for (const PoseResult& pose : result_.poses) {
      clips.push_back({pose.name, {0.0}, {pose.pose}});
    }
    GltfOptions options;
    options.texture_png = texture_png_;
    options.names = options_.exported.names;
    options.correctives = options_.exported.correctives;
    clip_reports_ = SaveGlb(result_.body,
                            result_.skin->weights,
                            clips,
                            options,
                            (folder_ / "model.glb").string());
  }

  // poses.bvh: every captured posture as a frame of one second.
  void WritePosesBvh() const {
    std::vector<Pose> poses;
    for (const PoseResult& pose : result_.poses) poses.push_back(pose.pose);
    SaveBvh(BvhFromPoses(result_.body.skeleton, poses, 1.0),
            (folder_ / "poses.bvh").string());
  }

  Json Report(double write_seconds) const {
    Json report;
    report["program"] = "sweepfit";
    report["version"] = kVersion;
    report["capture"] = CaptureName();
    report["cameras"] = result_.camera_ids;
    report["holdout"] = input_.capture.holdout;
    const auto used = HoldoutCamerasUsed(input_.capture, result_.camera_ids);
    report["holdout_used"] = used;
    report["holdout_scores_void"] = !used.empty();
    if (result_.skin) report["model"] = "model.glb";
    report["poses"] = Poses();
    if (has_mesh_) report["body"] = BodyFigures();
    if (result_.skin) {
      report["skin"] = {{"rms", result_.skin->rms}, {"max", result_.skin->max}};
      for (const ClipReport& clip : clip_reports_) {
        report["skin"]["clips"][clip.name] = {{"targets", clip.num_targets},
                                              {"rms", clip.rms},
                                              {"max", clip.max}};
      }
    }
    report["stages"] = Stages();
    report["options"] = FitOptionsToJson(options_);
    report["times"] = Times(write_seconds);
    return report;
  }

  std::string CaptureName() const {
    return fs::weakly_canonical(fs::absolute(input_.capture.folder))
        .filename()
        .string();
  }

  Json Poses() const {
    Json poses = Json::object();
    for (const PoseResult& pose : result_.poses) {
      Json& figures = poses[pose.name] = Json::object();
      if (RunsStage(options_, "landmarks")) {
        figures["unsafe_limbs"] = pose.seen->landmarks.unsafe_limbs;
        figures["facing_confidence"] = pose.seen->landmarks.facing_confidence;
        figures["upright_height"] = pose.seen->landmarks.stature;
      }
      if (has_mesh_) figures["silhouette"] = SilhouetteFigures(pose);
    }
    return poses;
  }

  Json SilhouetteFigures(const PoseResult& pose) const {
    Json cameras = Json::object();
    double iou = 0, boundary = 0;
    int count = 0;
    for (const ViewJob& job : jobs_) {
      if (job.pose != &pose) continue;
      cameras[job.view->camera.id] = ErrorToJson(job.error);
      iou += job.error.iou;
      boundary += job.error.boundary_mean;
      ++count;
    }
    return {{"mean_iou", iou / std::max(count, 1)},
            {"mean_boundary", boundary / std::max(count, 1)},
            {"cameras", cameras}};
  }

  Json BodyFigures() const {
    const Body& body = result_.body;
    Json lengths = Json::object();
    for (int joint = 1; joint < kNumJoints; ++joint) {
      lengths[std::string(kJointNames[joint])] = body.skeleton.length[joint];
    }
    return {{"stature", body.stature},
            {"sex", body.sex},
            {"mass", body.mass},
            {"vertices", body.num_vertices()},
            {"quads", body.topology.quads.size()},
            {"bone_lengths", lengths}};
  }

  Json Stages() const {
    Json stages = Json::array();
    for (const StageSummary& stage : result_.stages) {
      stages.push_back({{"stage", stage.stage},
                        {"status", stage.status},
                        {"warnings", stage.warnings},
                        {"figures", stage.figures}});
    }
    return stages;
  }

  // Everything that differs from run to run, and nothing else.
  Json Times(double write_seconds) const {
    Json stages = Json::array();
    for (const StageSummary& stage : result_.stages) {
      stages.push_back({{"stage", stage.stage}, {"seconds", stage.seconds}});
    }
    return {{"stages", stages},
            {"fit", input_.fit_seconds},
            {"write", write_seconds},
            {"total", input_.fit_seconds + write_seconds}};
  }

  const ResultInput& input_;
  const FitResult& result_;
  const FitOptions& options_;
  fs::path folder_;
  bool has_mesh_;
  std::vector<ClipReport> clip_reports_;
  std::vector<TriangleMesh> meshes_;  // per pose
  std::vector<ViewJob> jobs_;
  std::vector<unsigned char> texture_png_;
  ReportPictures pictures_;
};

}  // namespace

std::vector<std::string> HoldoutCamerasUsed(
    const Capture& capture, const std::vector<std::string>& camera_ids) {
  std::vector<std::string> used;
  for (const std::string& id : camera_ids) {
    if (capture.IsHoldout(id)) used.push_back(id);
  }
  return used;
}

TriangleMesh PosedMesh(const Body& body,
                       const std::vector<Eigen::Vector3d>& vertices_in_world) {
  return {vertices_in_world,
          TriangulateQuads(body.topology.quads, vertices_in_world)};
}

Json JointsToJson(const std::vector<PoseResult>& poses) {
  Json positions = Json::object();
  Json detail = Json::object();
  for (const PoseResult& pose : poses) {
    for (int joint = 0; joint < kNumJoints; ++joint) {
      const std::string name(kJointNames[joint]);
      const Eigen::Matrix3d& covariance = pose.joints.covariance[joint];
      positions[pose.name][name] = ToJson(pose.frames.joint_in_world[joint]);
      detail[pose.name][name] = {
          {"reliability", pose.joints.reliability[joint]},
          {"sigma", std::sqrt(covariance.trace() / 3)},
          {"covariance", ToJson(covariance)},
          {"evidence", pose.joints.evidence[joint]}};
    }
  }
  return {{"unit", "m"}, {"poses", positions}, {"detail", detail}};
}

Json LandmarksToJson(const std::vector<PoseResult>& poses) {
  Json all = Json::object();
  for (const PoseResult& pose : poses) {
    const LandmarkResult& found = pose.seen->landmarks;
    Json in_world = Json::array();
    for (const auto* list : {&found.landmarks, &found.features}) {
      for (const Landmark3& landmark : *list) {
        in_world.push_back(
            {{"name", landmark.name},
             {"joint",
              landmark.joint < 0 ? Json() : Json(kJointNames[landmark.joint])},
             {"point", ToJson(landmark.point_in_world)},
             {"covariance", ToJson(landmark.covariance)},
             {"views", landmark.num_views},
             {"source", landmark.source}});
      }
    }
    Json in_pictures = Json::array();
    for (const Landmark2& landmark : found.points) {
      in_pictures.push_back({{"camera", landmark.camera_id},
                             {"name", landmark.name},
                             {"pixel", ToJson(landmark.pixel)},
                             {"covariance", ToJson(landmark.covariance)},
                             {"source", landmark.source}});
    }
    all[pose.name] = {{"facing", ToJson(found.facing_in_world)},
                      {"facing_confidence", found.facing_confidence},
                      {"floor_height", found.floor_height},
                      {"upright_height", found.stature},
                      {"upright_height_sigma", found.stature_sigma},
                      {"unsafe_limbs", found.unsafe_limbs},
                      {"landmarks", in_world},
                      {"points", in_pictures}};
  }
  return {{"unit", "m"}, {"poses", all}};
}

Json WriteResult(const ResultInput& input,
                 const fs::path& folder,
                 Progress* progress) {
  if (progress != nullptr) progress->Stage("write", "");
  return Writer(input, folder).Write();
}

}  // namespace sweepfit
