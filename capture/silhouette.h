// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "capture/capture.h"
#include "model/progress.h"
#include "model/stage_summary.h"

namespace sweepfit {

struct SegmentOptions {
  // auto chooses for every camera: given masks where there are any; plate and
  // key together where both are there and sound; else the one that is.
  // plate | chroma | both | masks force one.
  std::string mode = "auto";
  // Floor of the noise of picture and plate in CIELAB units; it is measured for
  // every camera, but what a single plate shows may be less than there is.
  double sigma_l = 0.8;
  double sigma_ab = 0.6;
  // Share of the squared lightness difference that counts. Shadows are
  // explained as such; a share below 1 forgives them more and dark clothes
  // less.
  double lightness_weight = 1;
  // How dark shadows are: scale of the exponential prior of -ln(light).
  double shadow_depth = 0.4;
  // Hysteresis on the ln of the likelihood ratio of person to background.
  double seed_ratio = 4;
  double grow_ratio = 0;
  // Cost of an outline where there is no edge, ln units per pixel of length.
  double smoothness = 6;

  std::optional<std::string> Check() const;
};

// What one camera saw of the person in one pose.
struct View {
  Camera camera;
  cv::Mat3b image;     // as taken
  cv::Mat1f coverage;  // as taken: share of each pixel covered, 0..1
  // Signed distance to the silhouette in pixels, negative inside, over the
  // pinhole pixels of K (same size as the picture): sample it at
  // ProjectPinhole. Sub-pixel at the boundary (coverage 0.5).
  cv::Mat1f signed_distance;
  std::string mode;  // how it was segmented
  // BGR channel in which a green or blue screen around the person shines, whose
  // light spills onto them; none where there is no such screen.
  std::optional<int> key_channel;
  double quality = 1;  // 0..1: how far the silhouette can be trusted
};

// Segments the pictures of one pose. The result has one view per camera id, in
// that order, without the cameras that have no picture or whose computed
// silhouette cannot be that of a person (nobody seen, the plate of another
// camera): a warning names each of them, and those that are doubtful. The
// summary says for every camera what was used, why, and how good it is.
// InputError when a picture or a given mask cannot be used, FitError when fewer
// than two silhouettes are left.
std::vector<View> Segment(const Capture& capture,
                          const CapturePose& pose,
                          const std::vector<std::string>& camera_ids,
                          const SegmentOptions& options,
                          Progress* progress,
                          StageSummary* summary);

// The same for the picture of one camera alone, without a least number of
// views: none where Segment would leave the camera out.
std::optional<View> SegmentOne(const Capture& capture,
                               const CapturePose& pose,
                               const std::string& camera_id,
                               const SegmentOptions& options,
                               Progress* progress,
                               StageSummary* summary);

// Signed distance in pinhole pixels of a coverage mask given in the picture as
// taken. Exact to the polyline within 3 px, a few hundredths of a pixel beyond.
// The picture's frame is no boundary: where it cuts the person, the distance is
// to the nearest boundary that is seen. Width + height where there is none.
cv::Mat1f SignedDistance(const Camera& camera, const cv::Mat1f& coverage);

// The box around what is set in a mask, wider by `margin` pixels on each side
// as far as the mask goes; empty where nothing is set.
cv::Rect BoxAround(const cv::Mat1b& mask, int margin);

// Value and gradient of an image by bilinear interpolation; coordinates outside
// are clamped to the border.
struct ImageSample {
  double value;
  Eigen::Vector2d gradient;
};
ImageSample SampleBilinear(const cv::Mat1f& image,
                           const Eigen::Vector2d& pixel);

// Closed polylines of the 0.5 level of a coverage mask by marching squares, in
// pixels of the picture, largest enclosed area first; the inside lies to the
// left when walking along, as seen in the picture: outlines run
// counter-clockwise to the eye (holes the other way). Where the picture's frame
// cuts the person, the contour runs within a pixel outside the outermost pixel
// centres.
std::vector<std::vector<Eigen::Vector2d>> SubpixelContours(
    const cv::Mat1f& coverage);

}  // namespace sweepfit
