// SPDX-License-Identifier: Apache-2.0
#include "experiments/check_capture.h"

#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "capture/plate.h"
#include "capture/up_axis.h"
#include "model/input_error.h"
#include "model/median.h"
#include "volume/person_height.h"
#include "volume/volume.h"

namespace sweepfit {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

// Largest difference of neighbours on a circle of `period` degrees.
double LargestGap(std::vector<double> azimuths, double period) {
  for (double& azimuth : azimuths) {
    azimuth -= period * std::floor(azimuth / period);
  }
  std::sort(azimuths.begin(), azimuths.end());
  azimuths.push_back(azimuths.front() + period);
  double largest = 0;
  for (size_t i = 1; i < azimuths.size(); ++i) {
    largest = std::max(largest, azimuths[i] - azimuths[i - 1]);
  }
  return largest;
}

__attribute__((format(printf, 1, 2))) std::string Format(const char* format,
                                                         ...) {
  char text[400];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof(text), format, arguments);
  va_end(arguments);
  return text;
}

// --- plates ---

// A picture made so small that noise is gone, in grey levels.
cv::Mat3f Thumbnail(const cv::Mat3b& picture) {
  constexpr double kSide = 160;
  const double scale = kSide / std::max(picture.cols, picture.rows);
  cv::Mat3b small;
  cv::resize(picture, small, {}, scale, scale, cv::INTER_AREA);
  cv::Mat3f result;
  small.convertTo(result, CV_32F);
  return result;
}

// Median difference of picture and plate, grey levels, when each channel's
// median ratio is made 1; the mean ratio as well. The person covers less than
// half of the picture.
struct PlateAgreement {
  double difference = 0;
  double gain = 1;
};
PlateAgreement ComparePlate(const cv::Mat3f& picture, const cv::Mat3f& plate) {
  constexpr float kDark = 12;
  PlateAgreement result;
  cv::Vec3d gain(1, 1, 1);
  for (int c = 0; c < 3; ++c) {
    std::vector<double> ratios;
    for (int v = 0; v < plate.rows; ++v) {
      for (int u = 0; u < plate.cols; ++u) {
        if (plate(v, u)[c] < kDark || plate(v, u)[c] > 250) continue;
        ratios.push_back(picture(v, u)[c] / plate(v, u)[c]);
      }
    }
    if (!ratios.empty()) gain[c] = Median(std::move(ratios));
  }
  std::vector<double> differences;
  for (int v = 0; v < plate.rows; ++v) {
    for (int u = 0; u < plate.cols; ++u) {
      double sum = 0;
      for (int c = 0; c < 3; ++c) {
        sum += std::abs(picture(v, u)[c] - gain[c] * plate(v, u)[c]);
      }
      differences.push_back(sum / 3);
    }
  }
  result.difference = Median(std::move(differences));
  result.gain = (gain[0] + gain[1] + gain[2]) / 3;
  return result;
}

// --- one check ---

class Check {
 public:
  Check(const Capture& capture,
        const SegmentOptions& options,
        Progress* progress)
      : capture_(capture), options_(options), progress_(progress) {}

  CaptureCheck Run();

 private:
  void Stage(const char* what) {
    if (progress_ != nullptr) progress_->Stage("check", what);
  }
  CameraCheck& Find(const std::string& id) {
    return *std::find_if(check_.cameras.begin(),
                         check_.cameras.end(),
                         [&](const CameraCheck& c) { return c.id == id; });
  }
  void AddProblem(const std::string& id, const std::string& text) {
    std::vector<std::string>& problems = Find(id).problems;
    if (std::find(problems.begin(), problems.end(), text) == problems.end()) {
      problems.push_back(text);
    }
  }

  void CheckPlates();
  void SegmentPoses();
  void CheckFrames();
  void MeasurePerson();
  void CheckUpright(const Volume& hull);
  void CheckCoherence();
  void PlaceCameras();
  void CheckAround();
  void ExpectAccuracy();

  const Capture& capture_;
  const SegmentOptions& options_;
  Progress* progress_;
  CaptureCheck check_;
  std::vector<std::vector<View>> poses_;
  std::vector<std::string> names_;  // of poses_
  std::optional<Eigen::Vector3d> middle_in_world_;
  double floor_ = 0;
};

void Check::CheckPlates() {
  Stage("plates");
  struct Entry {
    std::string id;
    cv::Mat3f plate;
    std::vector<cv::Mat3f> pictures;
  };
  std::vector<const CaptureCamera*> cameras;
  for (const CaptureCamera& camera : capture_.cameras) {
    if (!camera.background.empty()) cameras.push_back(&camera);
  }
  std::vector<Entry> entries(cameras.size());
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Camera& camera = cameras[i]->camera;
    entries[i].id = camera.id;
    entries[i].plate = Thumbnail(
        LoadPicture(capture_, cameras[i]->background.front(), camera));
    for (const CapturePose& pose : capture_.poses) {
      const auto image = pose.images.find(camera.id);
      if (image == pose.images.end()) continue;
      entries[i].pictures.push_back(
          Thumbnail(LoadPicture(capture_, image->second, camera)));
    }
  }
  // The mean over a camera's pictures of how they differ from a plate.
  const auto compare = [](const Entry& entry, const cv::Mat3f& plate) {
    PlateAgreement sum{0, 0};
    for (const cv::Mat3f& picture : entry.pictures) {
      const PlateAgreement one = ComparePlate(picture, plate);
      sum.difference += one.difference;
      sum.gain += one.gain;
    }
    const auto count =
        static_cast<double>(std::max<size_t>(1, entry.pictures.size()));
    return PlateAgreement{sum.difference / count, sum.gain / count};
  };
  std::vector<double> own;
  for (const Entry& entry : entries) {
    if (entry.pictures.empty()) continue;
    CameraCheck& camera = Find(entry.id);
    const PlateAgreement agreement = compare(entry, entry.plate);
    camera.plate_difference = agreement.difference;
    camera.exposure_gain = agreement.gain;
    own.push_back(agreement.difference);
  }
  const double usual = Median(own);
  for (const Entry& entry : entries) {
    const CameraCheck& camera = Find(entry.id);
    if (entry.pictures.empty()) continue;
    // Against the other cameras of the capture, not against a fixed level:
    // studios differ. A wrong plate fits no better than those of other cameras,
    // which in a studio with a screen is not bad at all.
    if (camera.plate_difference > 2 * usual + 0.3) {
      std::vector<double> others;
      std::string looks_like, same_as;
      double best = 0.6 * camera.plate_difference;
      for (const Entry& other : entries) {
        if (other.plate.size() != entry.plate.size()) continue;
        if (other.id == entry.id) continue;
        if (cv::norm(entry.plate, other.plate, cv::NORM_INF) == 0) {
          same_as = other.id;
        }
        others.push_back(compare(entry, other.plate).difference);
        if (others.back() >= best) continue;
        best = others.back();
        looks_like = other.id;
      }
      const bool is_wrong =
          !looks_like.empty() || !same_as.empty() ||
          camera.plate_difference > 2 * usual + 2.5 ||
          (!others.empty() && camera.plate_difference > 0.75 * Median(others));
      if (is_wrong) {
        AddProblem(
            entry.id,
            "its background does not belong to its picture" +
                (!looks_like.empty()
                     ? ": that of " + looks_like + " fits better"
                 : !same_as.empty()
                     ? ": it is that of " + same_as
                     : std::string(" (the camera or the light moved, or it is "
                                   "another camera's)")));
      }
    }
    constexpr double kMaxGain = 0.25;
    if (std::abs(camera.exposure_gain - 1) > kMaxGain) {
      AddProblem(entry.id,
                 Format("its picture is %.0f %% %s than its background: use "
                        "the same exposure",
                        100 * std::abs(camera.exposure_gain - 1),
                        camera.exposure_gain > 1 ? "brighter" : "darker"));
    }
  }
}

void Check::SegmentPoses() {
  Stage("silhouettes");
  std::vector<std::string> ids;
  for (const CaptureCamera& camera : capture_.cameras) {
    ids.push_back(camera.camera.id);
  }
  for (const CapturePose& pose : capture_.poses) {
    StageSummary summary;
    std::vector<View> views;
    try {
      views = Segment(capture_, pose, ids, options_, nullptr, &summary);
    } catch (const FitError& error) {
      check_.failures.push_back(error.what());
    }
    for (const std::string& warning : summary.warnings) {
      // "pose A, camera cam00 is left out: why"
      for (const std::string& id : ids) {
        if (warning.find("camera " + id + " ") != std::string::npos ||
            warning.find("camera " + id + ":") != std::string::npos) {
          // The camera stands before it in the table already.
          const size_t why = warning.find("camera " + id) + 8 + id.size();
          AddProblem(id, "pose " + pose.name + ": " + warning.substr(why));
        }
      }
    }
    for (const View& view : views) Find(view.camera.id).is_used = true;
    if (views.size() < 2) continue;
    poses_.push_back(std::move(views));
    names_.push_back(pose.name);
  }
}

// Silhouettes that run into the picture's frame are cut.
void Check::CheckFrames() {
  constexpr float kInside = 0.5f;
  constexpr int kMinPixels = 4;
  for (size_t p = 0; p < poses_.size(); ++p) {
    for (const View& view : poses_[p]) {
      const cv::Mat1f& coverage = view.coverage;
      const int w = coverage.cols, h = coverage.rows;
      const auto touches = [&](const cv::Mat& line) {
        return cv::countNonZero(line > kInside) >= kMinPixels;
      };
      std::string sides;
      if (touches(coverage.row(0))) sides += " top";
      if (touches(coverage.row(h - 1))) sides += " bottom";
      if (touches(coverage.col(0))) sides += " left";
      if (touches(coverage.col(w - 1))) sides += " right";
      if (!sides.empty()) {
        AddProblem(view.camera.id,
                   "pose " + names_[p] +
                       ": the picture's frame cuts the person (" +
                       sides.substr(1) + ")");
      }
      CameraCheck& camera = Find(view.camera.id);
      const cv::Rect box = cv::boundingRect(coverage > kInside);
      camera.person_pixels = std::max<double>(camera.person_pixels,
                                              std::max(box.width, box.height));
    }
  }
}

void Check::CheckCoherence() {
  Stage("coherence");
  IncoherenceOptions options;
  options.thorough = true;
  const std::vector<Incoherence> found = FindIncoherence(poses_, options);
  for (const Incoherence& item : found) {
    const std::string pose =
        item.pose < 0 ? "" : "pose " + names_[item.pose] + ": ";
    // The camera stands before it in the table already.
    std::string text = item.Text();
    const std::string start = "camera " + item.camera.camera_id;
    text.erase(0, start.size());
    text.erase(0, text.find_first_not_of(" :"));
    AddProblem(item.camera.camera_id, pose + text);
  }
  RepairIncoherence(found, &poses_);
  for (const CameraCoherence& camera : MeasureCoherence(poses_)) {
    Find(camera.camera_id).coherence = camera;
  }
  // The figures before the repair for those that were wrong.
  for (const Incoherence& item : found) {
    if (item.kind != Incoherence::Kind::kShows) {
      Find(item.camera.camera_id).coherence = item.camera;
    }
  }
}

void Check::CheckUpright(const Volume& hull) {
  const TriangleMesh mesh = hull.ExtractMesh();
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& v : mesh.vertices) mean += v;
  mean /= static_cast<double>(mesh.vertices.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& v : mesh.vertices) {
    scatter += (v - mean) * (v - mean).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  const Eigen::Vector3d axis = eigen.eigenvectors().col(2);
  const double lean = std::acos(std::min(1.0, std::abs(axis.y()))) / kDegree;
  check_.lean = std::max(check_.lean, lean);
  constexpr double kUpright = 25;
  constexpr double kLying = 55;
  if (lean < kUpright) return;
  std::vector<Camera> cameras;
  for (const CaptureCamera& entry : capture_.cameras) {
    cameras.push_back(entry.camera);
  }
  const UpEstimate up = EstimateUp(cameras);
  const double tilt =
      std::acos(std::clamp(up.up_in_world.y(), -1.0, 1.0)) / kDegree;
  constexpr double kTilted = 35;
  if (lean > kLying && up.sound && tilt > kTilted) {
    check_.failures.push_back(
        Format("the person lies on the floor (%.0f degrees from the vertical) "
               "and the cameras are level about another axis: correct 'up' in "
               "capture.yaml",
               lean));
  } else {
    check_.warnings.push_back(
        Format("the body's long axis is %.0f degrees from the vertical: the "
               "person does not stand upright with the arms down or out",
               lean));
  }
}

void Check::MeasurePerson() {
  Stage("person");
  for (const std::vector<View>& views : poses_) {
    try {
      const PersonHeight person = MeasurePersonHeight(views);
      constexpr double kShortest = 0.5, kTallest = 2.5;
      // Who lies is not short.
      if (std::max(person.height, person.width) < kShortest ||
          person.height > kTallest) {
        check_.failures.push_back(
            Format("the person is %.3g m tall, and people are 0.5 to 2.5 m: "
                   "correct 'units' or the scale of the calibration",
                   person.height));
        check_.person_height = person.height;
        return;
      }
      HullOptions options;
      options.voxel_size = 0.008;
      const Volume hull = BuildVisualHull(views, options, nullptr, nullptr);
      check_.person_height = std::max(check_.person_height, person.height);
      if (!middle_in_world_) {
        middle_in_world_ = 0.5 * (hull.BoxMin() + hull.BoxMax());
        floor_ = hull.BoxMin().y();
      }
      CheckUpright(hull);
    } catch (const FitError& error) {
      check_.failures.push_back(std::string(error.what()) +
                                ": check the calibration");
      return;
    }
  }
}

void Check::PlaceCameras() {
  if (!middle_in_world_) return;
  std::vector<double> scales;
  for (const CaptureCamera& entry : capture_.cameras) {
    const Camera& camera = entry.camera;
    CameraCheck& result = Find(camera.id);
    const Eigen::Vector3d offset = camera.CenterInWorld() - *middle_in_world_;
    result.azimuth = std::atan2(offset.x(), offset.z()) / kDegree;
    result.height = camera.CenterInWorld().y() - floor_;
    result.distance = offset.norm();
    result.mm_per_pixel = 1000 * camera.PointInCamera(*middle_in_world_).z() /
                          camera.FocalLength();
    if (result.is_used) scales.push_back(result.mm_per_pixel);
  }
  constexpr double kCoarse = 6;
  if (Median(scales) > kCoarse) {
    check_.warnings.push_back(
        Format("a pixel is %.1f mm at the person: come closer or take larger "
               "pictures for finer results",
               Median(scales)));
  }
}

// The cameras of a fit should stand all around.
void Check::CheckAround() {
  std::vector<double> azimuths;
  for (const CameraCheck& camera : check_.cameras) {
    if (camera.is_holdout || !camera.is_used) continue;
    azimuths.push_back(camera.azimuth);
  }
  check_.num_fit_cameras = static_cast<int>(azimuths.size());
  constexpr int kFewest = 2;
  if (check_.num_fit_cameras < kFewest) {
    check_.failures.push_back(
        Format("only %d of the cameras can be used for a fit, and at least %d "
               "are needed, better 8",
               check_.num_fit_cameras,
               kFewest));
    return;
  }
  if (!middle_in_world_) return;
  check_.largest_gap = LargestGap(azimuths, 360);
  check_.largest_outline_gap = LargestGap(azimuths, 180);
  constexpr double kGap = 75;
  if (check_.largest_gap > kGap) {
    check_.warnings.push_back(Format(
        "the cameras of the fit leave %.0f degrees around the person open: "
        "what faces there stays coarse; add a camera",
        check_.largest_gap));
  }
  constexpr int kUsual = 6;
  if (check_.num_fit_cameras < kUsual) {
    // A third more than even spacing over half a circle.
    const double uneven = 4.0 / 3 * 180 / check_.num_fit_cameras;
    check_.warnings.push_back(
        Format("%d cameras leave the body much too thick between them: 8 to 16 "
               "are usual",
               check_.num_fit_cameras) +
        (check_.largest_outline_gap > uneven
             ? "; cameras that stand opposite each other see the same outline: "
               "with four, stand them at 0, 45, 135 and 270 degrees"
             : ""));
  }
}

// Rules of thumb. The hull of N views evenly around a standing person is about
// 6.2 mm (8 / N)^0.62 too large (synthetic people, N = 8 to 32), where what
// counts is the angle between the outlines; a fit of the outlines takes
// somewhat more than half of it away (rendered people, 8 views); both grow with
// what the outlines are off. What faces a wide gap is seen by nobody.
void Check::ExpectAccuracy() {
  if (!check_.CanWork() || check_.num_fit_cameras < 3) return;
  std::vector<double> scale, miss;
  for (const CameraCheck& camera : check_.cameras) {
    if (camera.is_holdout || !camera.is_used) continue;
    scale.push_back(camera.mm_per_pixel);
    miss.push_back(camera.coherence.miss);
  }
  constexpr double kOutlineNoise = 0.5;  // pixels, of a sound silhouette
  check_.expected_outline =
      Median(scale) * std::hypot(kOutlineNoise, Median(miss));
  const double hull = 6.2 * std::pow(check_.largest_outline_gap / 45, 0.62) *
                      std::max(1.0, check_.largest_gap / 135);
  check_.expected_surface = std::hypot(0.45 * hull, check_.expected_outline);
}

CaptureCheck Check::Run() {
  for (const CaptureCamera& entry : capture_.cameras) {
    CameraCheck& camera = check_.cameras.emplace_back();
    camera.id = entry.camera.id;
    camera.is_holdout = capture_.IsHoldout(camera.id);
  }
  CheckPlates();
  SegmentPoses();
  CheckFrames();
  if (!poses_.empty()) {
    CheckCoherence();
    MeasurePerson();
    PlaceCameras();
  }
  CheckAround();
  int num_wrong = 0;
  for (const CameraCheck& camera : check_.cameras) {
    num_wrong += !camera.problems.empty() && !camera.is_holdout;
  }
  if (2 * num_wrong > static_cast<int>(check_.cameras.size())) {
    check_.warnings.push_back(
        "most cameras have problems: calibrate all of them anew, and "
        "photograph "
        "the person and the empty scene in one go");
  }
  ExpectAccuracy();
  return std::move(check_);
}

}  // namespace

CaptureCheck CheckCapture(const Capture& capture,
                          const SegmentOptions& options,
                          Progress* progress) {
  return Check(capture, options, progress).Run();
}

std::string CheckTable(const CaptureCheck& check) {
  std::string text =
      "camera        use       around  height  distance  mm/px  person  "
      "outline "
      " others  exposure  plate  verdict\n"
      "                           deg       m         m             px       "
      "px      px         %  level\n";
  for (const CameraCheck& camera : check.cameras) {
    const char* use = !camera.is_used     ? "left out"
                      : camera.is_holdout ? "holdout"
                                          : "fit";
    text += Format(
        "%-12s  %-8s  %6.0f  %6.2f  %8.2f  %5.2f  %6.0f  %7.2f  "
        "%6.2f",
        camera.id.c_str(),
        use,
        camera.azimuth,
        camera.height,
        camera.distance,
        camera.mm_per_pixel,
        camera.person_pixels,
        camera.coherence.miss,
        camera.coherence.others_with - camera.coherence.others_without);
    text += camera.exposure_gain > 0 ? Format("  %+8.1f  %5.1f",
                                              100 * (camera.exposure_gain - 1),
                                              camera.plate_difference)
                                     : std::string("         -      -");
    text += camera.problems.empty() ? "  fine\n" : "  CHECK\n";
  }
  text +=
      "outline: how far it lies outside what the other cameras allow; others: "
      "what it takes from theirs\n\n";
  for (const CameraCheck& camera : check.cameras) {
    for (const std::string& problem : camera.problems) {
      text += "camera " + camera.id + ": " + problem + "\n";
    }
  }
  for (const std::string& warning : check.warnings) text += warning + "\n";
  text += Format(
      "person: %.2f m tall, long axis %.0f degrees from the vertical; "
      "%d cameras for the fit, largest gap %.0f degrees\n",
      check.person_height,
      check.lean,
      check.num_fit_cameras,
      check.largest_gap);
  if (check.expected_surface > 0) {
    text += Format(
        "expected: outlines good to %.1f mm, surface to about %.0f mm "
        "on average where the cameras see it\n",
        check.expected_outline,
        std::ceil(check.expected_surface));
  }
  for (const std::string& failure : check.failures) {
    text += "CANNOT WORK: " + failure + "\n";
  }
  if (check.CanWork()) {
    std::string wrong;
    for (const CameraCheck& camera : check.cameras) {
      if (!camera.problems.empty()) wrong += " " + camera.id;
    }
    text += wrong.empty() && check.warnings.empty()
                ? "verdict: fine\n"
                : "verdict: can work, with warnings" +
                      (wrong.empty() ? "" : "; look at" + wrong) + "\n";
  }
  return text;
}

nlohmann::ordered_json CheckToJson(const CaptureCheck& check) {
  nlohmann::ordered_json json;
  json["can_work"] = check.CanWork();
  json["failures"] = check.failures;
  json["warnings"] = check.warnings;
  json["person_height_m"] = check.person_height;
  json["lean_degrees"] = check.lean;
  json["num_fit_cameras"] = check.num_fit_cameras;
  json["largest_gap_degrees"] = check.largest_gap;
  json["expected_outline_mm"] = check.expected_outline;
  json["expected_surface_mm"] = check.expected_surface;
  auto& cameras = json["cameras"] = nlohmann::ordered_json::array();
  for (const CameraCheck& camera : check.cameras) {
    const CameraCoherence& coherence = camera.coherence;
    nlohmann::ordered_json entry = {
        {"id", camera.id},
        {"holdout", camera.is_holdout},
        {"used", camera.is_used},
        {"azimuth_degrees", camera.azimuth},
        {"height_m", camera.height},
        {"distance_m", camera.distance},
        {"mm_per_pixel", camera.mm_per_pixel},
        {"person_px", camera.person_pixels},
        {"outline_px", coherence.miss},
        {"others_with_px", coherence.others_with},
        {"others_without_px", coherence.others_without},
        {"turn_degrees", coherence.turn.norm() / kDegree},
        {"shift_px", coherence.shift},
        {"problems", camera.problems}};
    if (camera.exposure_gain > 0) {
      entry["exposure_gain"] = camera.exposure_gain;
      entry["plate_difference"] = camera.plate_difference;
    }
    cameras.push_back(std::move(entry));
  }
  return json;
}

}  // namespace sweepfit
