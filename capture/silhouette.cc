// SPDX-License-Identifier: Apache-2.0
#include "capture/silhouette.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "capture/chroma.h"
#include "capture/clean_mask.h"
#include "capture/matte.h"
#include "capture/plate.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

constexpr double kSmallestShare = 1e-4;  // of the picture that a person covers
constexpr double kLargestShare = 0.6;
// A plate of another camera differs everywhere, by 4 and more in a furnished
// room; sound ones stay near 1, with strong sensor noise near 3.
constexpr double kMaxNoiseRatio = 3.5;
constexpr double kMaxBorderShare = 0.5;

// Which of the pictures a camera's silhouette comes from.
std::string ChooseMode(const CaptureCamera& entry,
                       const CapturePose& pose,
                       const SegmentOptions& options) {
  const std::string& id = entry.camera.id;
  const bool has_mask = pose.masks.count(id) > 0;
  const auto need = [&](bool has, const char* what) {
    if (has) return;
    throw InputError("pose " + pose.name + ", camera " + id +
                     ": segment.mode=" + options.mode + " needs " + what +
                     ", and capture.yaml gives none");
  };
  if (options.mode == "auto") {
    if (has_mask) return "masks";
    if (entry.background) return "plate";
    if (entry.chroma_key) return "chroma";
    throw InputError("pose " + pose.name + ", camera " + id +
                     ": capture.yaml gives no mask, background or chroma_key, "
                     "so the person cannot be found in the picture");
  }
  if (options.mode == "masks") need(has_mask, "a mask");
  if (options.mode == "plate" || options.mode == "both") {
    need(entry.background.has_value(), "a background");
  }
  if (options.mode == "chroma" || options.mode == "both") {
    need(entry.chroma_key.has_value(), "a chroma_key");
  }
  return options.mode;
}

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
  std::string problem;  // why the view must be left out; empty: it is sound
};

// Why a computed silhouette cannot be that of a person; empty if it can.
std::string FindProblem(const cv::Mat1f& coverage,
                        double noise_ratio,
                        const std::string& mode) {
  const std::string check =
      mode == "chroma"
          ? "check chroma_key"
          : "check that the background picture belongs to this camera";
  if (noise_ratio > kMaxNoiseRatio) {
    return "the picture differs from its background nearly everywhere; " +
           check;
  }
  const double share = CoveredShare(coverage);
  if (share < kSmallestShare) return "nobody is seen in the picture";
  if (share > kLargestShare) {
    return "the silhouette covers most of the picture; " + check;
  }
  if (BorderShare(coverage) > kMaxBorderShare) {
    return "the silhouette runs along most of the picture's frame; " + check;
  }
  return "";
}

// The mean of the squared distances adds the log likelihoods of both.
BackgroundDifference Combine(BackgroundDifference plate,
                             const BackgroundDifference& chroma,
                             const SegmentOptions& options) {
  const double cap = 4 * options.threshold_high;
  for (cv::Mat1f* squared : {&plate.squared, &plate.squared_at_feet}) {
    *squared =
        0.5 * cv::min(*squared, cap) + 0.5 * cv::min(chroma.squared, cap);
  }
  return plate;
}

BackgroundDifference Difference(const Capture& capture,
                                const CaptureCamera& entry,
                                const cv::Mat3b& picture,
                                const std::string& mode,
                                const SegmentOptions& options) {
  if (mode == "chroma") {
    return ChromaDifference(picture, *entry.chroma_key, options);
  }
  const cv::Mat3b plate = LoadPicture(capture, *entry.background, entry.camera);
  BackgroundDifference difference = PlateDifference(picture, plate, options);
  if (mode == "both") {
    difference = Combine(std::move(difference),
                         ChromaDifference(picture, *entry.chroma_key, options),
                         options);
  }
  return difference;
}

void UseMask(const Capture& capture,
             const CapturePose& pose,
             SegmentedView* result) {
  View& view = result->view;
  const std::string& path = pose.masks.at(view.camera.id);
  view.coverage = LoadMask(capture, path, view.camera);
  const double share = CoveredShare(view.coverage);
  double strongest = 0;
  cv::minMaxLoc(view.coverage, nullptr, &strongest);
  const auto fail = [&](const std::string& what) {
    throw InputError((capture.folder / path).string() + ": pose " + pose.name +
                     ", camera " + view.camera.id + ": " + what);
  };
  if (strongest <= 0.5) {
    fail("the mask is empty (the person must be white, 255)");
  }
  if (share > kLargestShare) {
    fail("the mask covers most of the picture (the person must be white)");
  }
}

SegmentedView SegmentView(const Capture& capture,
                          const CapturePose& pose,
                          const CaptureCamera& entry,
                          const SegmentOptions& options) {
  SegmentedView result;
  View& view = result.view;
  view.camera = entry.camera;
  view.mode = ChooseMode(entry, pose, options);
  view.image =
      LoadPicture(capture, pose.images.at(entry.camera.id), entry.camera);
  if (view.mode == "masks") {
    UseMask(capture, pose, &result);
  } else {
    const BackgroundDifference difference =
        Difference(capture, entry, view.image, view.mode, options);
    view.coverage = BoundaryCoverage(ToLinear(view.image),
                                     difference.background_linear,
                                     PersonMask(difference, options));
    result.problem =
        FindProblem(view.coverage, difference.noise_ratio, view.mode);
  }
  if (result.problem.empty()) {
    view.signed_distance = SignedDistance(view.camera, view.coverage);
  }
  return result;
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
      views[i] = SegmentView(capture, pose, *cameras[i], options);
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
  if (!(threshold_low > 0) || !(threshold_high >= threshold_low)) {
    return "segment.threshold_low and threshold_high must be positive and "
           "ascend";
  }
  return std::nullopt;
}

std::vector<View> Segment(const Capture& capture,
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
    const std::string& id = segmented.view.camera.id;
    figures[id] = {{"mode", segmented.view.mode},
                   {"covered", CoveredShare(segmented.view.coverage)},
                   {"used", segmented.problem.empty()}};
    if (segmented.problem.empty()) {
      views.push_back(std::move(segmented.view));
    } else {
      warn("pose " + pose.name + ", camera " + id +
           " is left out: " + segmented.problem);
    }
  }
  summary->status = summary->warnings.empty() ? "ok" : "weak";
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

}  // namespace sweepfit
