// SPDX-License-Identifier: Apache-2.0
#include "capture/silhouette.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "capture/chroma.h"
#include "capture/colour.h"
#include "capture/matte.h"
#include "capture/person_mask.h"
#include "capture/plate.h"
#include "capture/plate_shift.h"
#include "capture/view_quality.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

constexpr double kLargestShare = 0.6;   // of the picture that a mask covers
constexpr double kLeastQuality = 0.25;  // below, a view is left out
constexpr double kFairQuality = 0.7;    // below, it is used with a warning

// What a camera's silhouette comes from, and why.
struct Source {
  std::string mode;
  std::string reason;
};

double CoveredShare(const cv::Mat1f& coverage) { return cv::mean(coverage)[0]; }

// Share of the picture's frame that is covered.
double BorderShare(const cv::Mat1f& coverage) {
  const int w = coverage.cols, h = coverage.rows;
  const double sum =
      cv::sum(coverage.row(0))[0] + cv::sum(coverage.row(h - 1))[0] +
      cv::sum(coverage.col(0))[0] + cv::sum(coverage.col(w - 1))[0];
  return sum / (2.0 * (w + h));
}

struct SegmentedView {
  View view;
  std::string reason;  // for the mode
  ViewEvidence evidence;
  ViewQuality quality;
};

// One picture on its way to a silhouette. First the whole picture at low
// resolution: exposure, noise, where the person is; then that part as it is.
class Segmenter {
 public:
  Segmenter(const Capture& capture,
            const CapturePose& pose,
            const CaptureCamera& entry,
            const SegmentOptions& options)
      : capture_(capture), pose_(pose), entry_(entry), options_(options) {}

  SegmentedView Run() {
    SegmentedView result;
    View& view = result.view;
    view.camera = entry_.camera;
    view.image =
        LoadPicture(capture_, pose_.images.at(view.camera.id), view.camera);
    picture_ = view.image;
    const Source source = ChooseSource();
    view.mode = source.mode;
    result.reason = source.reason;
    if (view.mode == "masks") {
      view.coverage = GivenMask();
    } else {
      view.coverage = Find(view.mode);
      evidence_.covered = CoveredShare(view.coverage);
      evidence_.on_frame = BorderShare(view.coverage);
      result.quality = JudgeView(evidence_);
    }
    view.key_channel = KeyChannel(screen_);
    view.quality = result.quality.value;
    result.evidence = evidence_;
    if (view.quality >= kLeastQuality) {
      view.signed_distance = SignedDistance(view.camera, view.coverage);
    }
    return result;
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw InputError("pose " + pose_.name + ", camera " + entry_.camera.id +
                     ": " + what);
  }

  void Need(bool has, const char* what) const {
    if (!has) {
      Fail("segment.mode=" + options_.mode + " needs " + what +
           ", and capture.yaml gives none");
    }
  }

  // Pictures at low resolution.
  cv::Mat3b Small(const cv::Mat3b& picture) const {
    cv::Mat3b small;
    cv::resize(picture,
               small,
               {std::max(1, picture.cols / shrink_),
                std::max(1, picture.rows / shrink_)},
               0,
               0,
               cv::INTER_AREA);
    return small;
  }

  Source ChooseSource() {
    constexpr int kSmallSide = 300;
    shrink_ = std::max(
        1,
        cvRound(std::min(picture_.cols, picture_.rows) / double{kSmallSide}));
    small_ = Small(picture_);
    // Looked for in any mode: its light is on the person all the same.
    if (entry_.chroma_key) screen_ = FindKeyScreen(small_, *entry_.chroma_key);
    const bool has_mask = pose_.masks.count(entry_.camera.id) > 0;
    const std::string& mode = options_.mode;
    if (mode == "masks") Need(has_mask, "a mask");
    if (mode == "masks" || (mode == "auto" && has_mask)) {
      return {"masks", "a mask is given"};
    }
    const bool has_plate = !entry_.background.empty();
    const bool has_key = entry_.chroma_key.has_value();
    if (mode == "plate" || mode == "both") Need(has_plate, "a background");
    if (mode == "chroma" || mode == "both") Need(has_key, "a chroma_key");
    const bool is_auto = mode == "auto";
    if (is_auto && !has_plate && !has_key) {
      Fail(
          "capture.yaml gives no mask, background or chroma_key, so the person "
          "cannot be found in the picture");
    }
    if (has_plate && mode != "chroma") LoadPlate();
    if (screen_.found && mode != "plate") {
      small_screen_ = FillScreen(small_, screen_);
    }
    if (!is_auto) return {mode, "asked for"};
    if (!has_key) return {"plate", "there is a plate"};
    if (!has_plate) return {"chroma", "there is a key and no plate"};
    if (!screen_.found) {
      return {"plate", "no screen of the key's colour is seen"};
    }
    if (evidence_.noise_ratio > kDoubtfulPlate) {
      evidence_.noise_ratio = 1;
      evidence_.gain = {1, 1, 1};
      evidence_.plate_shift = 0;
      return {"chroma", "the plate does not belong to the picture"};
    }
    return {"both", "plate and key agree"};
  }

  // The plate, in the picture's exposure and place, and how well it fits.
  void LoadPlate() {
    std::vector<cv::Mat3b> frames;
    for (const std::string& path : entry_.background) {
      frames.push_back(LoadPicture(capture_, path, entry_.camera));
    }
    plate_ = BuildPlateModel(frames);
    small_plate_ = Small(plate_.picture);
    evidence_.gain = ExposureGain(small_, small_plate_);
    const cv::Point2d shift =
        MeasurePlateShift(picture_, plate_.picture, evidence_.gain);
    evidence_.plate_shift = std::hypot(shift.x, shift.y);
    if (evidence_.plate_shift > 0) {
      plate_.picture = Shift(plate_.picture, shift);
      if (!plate_.variance.empty()) {
        plate_.variance = Shift(plate_.variance, shift);
      }
      small_plate_ = Small(plate_.picture);
      evidence_.gain = ExposureGain(small_, small_plate_);
    }
    const cv::Mat3f change =
        ToSmoothLab(ToLinear(small_)) -
        ToSmoothLab(ToLinear(small_plate_, evidence_.gain));
    const PlateNoise noise =
        MeasurePlateNoise(change, cv::Mat1b(change.size(), 255), options_);
    // Of what a sound plate may show, not of the least that is assumed.
    constexpr double kSoundL = 1, kSoundAb = 0.8;
    evidence_.noise_ratio =
        std::max({1.0, noise.sigma_l / kSoundL, noise.sigma_ab / kSoundAb});
  }

  // Evidence of the part of the picture, at low or full resolution. Where
  // `is_background` is not 0 the background is certain to be seen.
  BackgroundEvidence Evidence(const std::string& mode,
                              const cv::Mat3f& picture_linear,
                              const PlateModel& plate,
                              const cv::Mat3f& screen_linear,
                              const cv::Mat1b& is_background,
                              const std::vector<float>& at_feet) const {
    if (mode == "chroma") {
      return ChromaEvidence(picture_linear, screen_linear, at_feet, options_);
    }
    BackgroundEvidence evidence = PlateEvidence(picture_linear,
                                                plate,
                                                evidence_.gain,
                                                is_background,
                                                at_feet,
                                                options_);
    if (mode == "both" && screen_.found) {
      // The log likelihoods add; half of each, for they judge the same pixels.
      evidence.log_density =
          0.5 *
          (evidence.log_density +
           ChromaEvidence(picture_linear, screen_linear, at_feet, options_)
               .log_density);
    }
    return evidence;
  }

  cv::Mat1f Find(const std::string& mode) {
    cv::Mat1f coverage(picture_.size(), 0.f);
    if (mode == "chroma" && !screen_.found) return coverage;
    const cv::Mat1b everywhere(small_.size(), 255);
    const cv::Mat1b rough =
        RoughPerson(Evidence(mode,
                             ToLinear(small_),
                             {small_plate_, {}},
                             small_screen_,
                             everywhere,
                             std::vector<float>(small_.rows, 0.f)),
                    options_);
    const cv::Rect part = PersonPart(rough);
    if (part.empty()) return coverage;

    const cv::Mat3f linear = ToLinear(picture_(part));
    cv::Mat1b grown;
    constexpr int kClear = 2;  // small px around the rough person
    cv::dilate(rough,
               grown,
               cv::getStructuringElement(cv::MORPH_RECT,
                                         {2 * kClear + 1, 2 * kClear + 1}));
    const cv::Mat1b is_person = Enlarge(grown, part, cv::INTER_NEAREST);
    const BackgroundEvidence evidence = Evidence(
        mode,
        linear,
        mode == "chroma" ? PlateModel() : plate_(part),
        small_screen_.empty()
            ? cv::Mat3f()
            : cv::Mat3f(Enlarge(small_screen_, part, cv::INTER_LINEAR)),
        is_person == 0,
        AtFeet(is_person));
    const cv::Mat1b mask = PersonMask(evidence, options_, &evidence_.stray);
    evidence_.outline_contrast =
        OutlineContrast(mask, evidence.change, evidence.sigma_l);
    BoundaryCoverage(linear, evidence.background_linear, mask)
        .copyTo(coverage(part));
    return coverage;
  }

  // Where the floor around a standing person is seen, per row: 0 above the
  // knees, 1/2 from the middle of the shins, 1 at the feet.
  static std::vector<float> AtFeet(const cv::Mat1b& is_person) {
    constexpr std::array<double, 4> kHeight = {0.45, 0.25, 0.2, 0.1};
    const cv::Rect box = cv::boundingRect(is_person);
    const auto ramp = [](double height, double from, double to) {
      return std::clamp((from - height) / (from - to), 0.0, 1.0);
    };
    std::vector<float> at_feet(is_person.rows);
    for (int y = 0; y < is_person.rows; ++y) {
      const double height = (box.br().y - y) / std::max(1.0, 1.0 * box.height);
      at_feet[y] =
          static_cast<float>(0.5 * ramp(height, kHeight[0], kHeight[1]) +
                             0.5 * ramp(height, kHeight[2], kHeight[3]));
    }
    return at_feet;
  }

  // The part of the picture that holds the person, with a margin.
  cv::Rect PersonPart(const cv::Mat1b& rough) const {
    constexpr double kMargin = 0.06;  // of the person's extent
    constexpr int kLeastMargin = 24;  // px
    const cv::Rect box = cv::boundingRect(rough);
    if (box.empty()) return {};
    const double sx = static_cast<double>(picture_.cols) / rough.cols;
    const double sy = static_cast<double>(picture_.rows) / rough.rows;
    const int margin =
        std::max(kLeastMargin,
                 cvRound(kMargin * std::max(box.width * sx, box.height * sy)));
    const cv::Rect grown(cvFloor(box.x * sx) - margin,
                         cvFloor(box.y * sy) - margin,
                         cvCeil(box.width * sx) + 2 * margin,
                         cvCeil(box.height * sy) + 2 * margin);
    return grown & cv::Rect({0, 0}, picture_.size());
  }

  // A part of the picture from a low resolution version of the whole.
  cv::Mat Enlarge(const cv::Mat& small,
                  const cv::Rect& part,
                  int interpolation) const {
    const double sx = static_cast<double>(small.cols) / picture_.cols;
    const double sy = static_cast<double>(small.rows) / picture_.rows;
    const cv::Matx23d small_from_part(
        sx, 0, (part.x + 0.5) * sx - 0.5, 0, sy, (part.y + 0.5) * sy - 0.5);
    cv::Mat result;
    cv::warpAffine(small,
                   result,
                   small_from_part,
                   part.size(),
                   interpolation | cv::WARP_INVERSE_MAP,
                   cv::BORDER_REPLICATE);
    return result;
  }

  cv::Mat1f GivenMask() const {
    const std::string& path = pose_.masks.at(entry_.camera.id);
    const cv::Mat1f coverage = LoadMask(capture_, path, entry_.camera);
    double strongest = 0;
    cv::minMaxLoc(coverage, nullptr, &strongest);
    const auto fail = [&](const std::string& what) {
      throw InputError((capture_.folder / path).string() + ": pose " +
                       pose_.name + ", camera " + entry_.camera.id + ": " +
                       what);
    };
    if (strongest <= 0.5) {
      fail("the mask is empty (the person must be white, 255)");
    }
    if (CoveredShare(coverage) > kLargestShare) {
      fail("the mask covers most of the picture (the person must be white)");
    }
    return coverage;
  }

  // A key may be better than a plate that fits as badly.
  static constexpr double kDoubtfulPlate = 3;

  const Capture& capture_;
  const CapturePose& pose_;
  const CaptureCamera& entry_;
  const SegmentOptions& options_;
  cv::Mat3b picture_;
  PlateModel plate_;
  KeyScreen screen_;
  int shrink_ = 1;
  cv::Mat3b small_, small_plate_;
  cv::Mat3f small_screen_;
  ViewEvidence evidence_;
};

std::string Join(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) {
    if (!all.empty()) all += "; ";
    all += text;
  }
  return all;
}

// What the report says of a view.
nlohmann::ordered_json Describe(const SegmentedView& segmented, bool is_used) {
  nlohmann::ordered_json figures = {
      {"mode", segmented.view.mode},
      {"why", segmented.reason},
      {"covered", CoveredShare(segmented.view.coverage)},
      {"quality", segmented.quality.value},
      {"used", is_used}};
  if (!segmented.quality.reasons.empty()) {
    figures["reasons"] = segmented.quality.reasons;
  }
  if (segmented.view.mode != "masks") {
    const ViewEvidence& evidence = segmented.evidence;
    figures["noise_ratio"] = evidence.noise_ratio;
    figures["exposure_gain"] = {
        evidence.gain[2], evidence.gain[1], evidence.gain[0]};  // RGB
    figures["plate_shift_px"] = evidence.plate_shift;
    figures["outline_contrast"] = evidence.outline_contrast;
    figures["stray_share"] = evidence.stray;
  }
  return figures;
}

// All views side by side. When several fail, the first in order is reported,
// whatever the number of threads.
std::vector<SegmentedView> SegmentAll(
    const Capture& capture,
    const CapturePose& pose,
    const std::vector<const CaptureCamera*>& cameras,
    const SegmentOptions& options) {
  std::vector<SegmentedView> views(cameras.size());
  std::vector<std::exception_ptr> errors(cameras.size());
  tbb::parallel_for(std::size_t{0}, cameras.size(), [&](std::size_t i) {
    try {
      views[i] = Segmenter(capture, pose, *cameras[i], options).Run();
    } catch (...) {
      errors[i] = std::current_exception();
    }
  });
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
  return views;
}

}  // namespace

std::optional<std::string> SegmentOptions::Check() const {
  static const std::vector<std::string> kModes = {
      "auto", "plate", "chroma", "both", "masks"};
  if (std::find(kModes.begin(), kModes.end(), mode) == kModes.end()) {
    return "segment.mode must be auto, plate, chroma, both or masks, not '" +
           mode + "'";
  }
  if (!(sigma_l > 0)) return "segment.sigma_l must be positive";
  if (!(sigma_ab > 0)) return "segment.sigma_ab must be positive";
  if (!(lightness_weight >= 0)) {
    return "segment.lightness_weight must not be negative";
  }
  if (!(shadow_depth > 0)) return "segment.shadow_depth must be positive";
  if (!(seed_ratio >= grow_ratio)) {
    return "segment.seed_ratio must not be below grow_ratio";
  }
  if (!(smoothness >= 0)) return "segment.smoothness must not be negative";
  return std::nullopt;
}

namespace {

// The views that can be used, however few.
std::vector<View> SegmentUsable(const Capture& capture,
                                const CapturePose& pose,
                                const std::vector<std::string>& camera_ids,
                                const SegmentOptions& options,
                                Progress* progress,
                                StageSummary* summary) {
  if (const auto error = options.Check()) throw InputError(*error);
  const auto warn = [&](const std::string& text) {
    summary->warnings.push_back(text);
    if (progress) progress->Warning(text);
  };

  std::vector<const CaptureCamera*> cameras;
  for (const std::string& id : camera_ids) {
    const CaptureCamera& entry = capture.FindCamera(id);
    if (pose.images.count(id) > 0) {
      cameras.push_back(&entry);
    } else {
      warn("pose " + pose.name + ", camera " + id + ": no picture");
    }
  }

  std::vector<View> views;
  auto& figures = summary->figures["views"] = nlohmann::ordered_json::object();
  for (SegmentedView& segmented : SegmentAll(capture, pose, cameras, options)) {
    const View& view = segmented.view;
    const std::string where =
        "pose " + pose.name + ", camera " + view.camera.id;
    const bool is_used = view.quality >= kLeastQuality;
    figures[view.camera.id] = Describe(segmented, is_used);
    if (is_used && view.quality < kFairQuality) {
      warn(where + " is doubtful: " + Join(segmented.quality.reasons));
    }
    if (is_used) {
      views.push_back(std::move(segmented.view));
    } else {
      warn(where + " is left out: " + Join(segmented.quality.reasons));
    }
  }
  summary->status = summary->warnings.empty() ? "ok" : "weak";
  return views;
}

}  // namespace

std::vector<View> Segment(const Capture& capture,
                          const CapturePose& pose,
                          const std::vector<std::string>& camera_ids,
                          const SegmentOptions& options,
                          Progress* progress,
                          StageSummary* summary) {
  std::vector<View> views =
      SegmentUsable(capture, pose, camera_ids, options, progress, summary);
  if (views.size() < 2) {
    summary->status = "failed";
    std::string text = "pose " + pose.name + ": " +
                       std::to_string(views.size()) +
                       " usable silhouettes, at least 2 are needed";
    if (!summary->warnings.empty()) text += "; " + summary->warnings.front();
    throw FitError(text);
  }
  return views;
}

std::optional<View> SegmentOne(const Capture& capture,
                               const CapturePose& pose,
                               const std::string& camera_id,
                               const SegmentOptions& options,
                               Progress* progress,
                               StageSummary* summary) {
  std::vector<View> views =
      SegmentUsable(capture, pose, {camera_id}, options, progress, summary);
  if (views.empty()) return std::nullopt;
  return std::move(views.front());
}

cv::Rect BoxAround(const cv::Mat1b& mask, int margin) {
  const cv::Rect box = cv::boundingRect(mask);
  if (box.empty()) return {};
  const cv::Rect grown(box.x - margin,
                       box.y - margin,
                       box.width + 2 * margin,
                       box.height + 2 * margin);
  return grown & cv::Rect({0, 0}, mask.size());
}

}  // namespace sweepfit
