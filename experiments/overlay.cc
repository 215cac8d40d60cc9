// SPDX-License-Identifier: Apache-2.0
#include "experiments/overlay.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

namespace sweepfit {
namespace {

constexpr int kOverlayHeight = 900;
constexpr int kLegendHeight = 56;
constexpr int kThumbnailSize = 260;
constexpr int kSubpixelBits = 4;
const cv::Scalar kSilhouetteColor(255, 220, 0);  // BGR: cyan
const cv::Scalar kMeshColor(60, 60, 255);        // red
const cv::Scalar kLeftColor(80, 220, 80);        // green
const cv::Scalar kRightColor(0, 190, 255);       // orange
const cv::Scalar kAxisColor(255, 255, 255);
const cv::Scalar kLandmarkColor(0, 255, 255);   // yellow
const cv::Scalar kKeypointColor(255, 80, 255);  // magenta
const cv::Scalar kTextColor(235, 235, 235);

// The box of everything covered by at least half, grown by a margin.
cv::Rect PersonBox(const cv::Mat1f& silhouette, const cv::Mat1f& mesh) {
  const cv::Rect frame(0, 0, silhouette.cols, silhouette.rows);
  cv::Rect box;
  for (const cv::Mat1f& mask : {silhouette, mesh}) {
    if (mask.empty()) continue;
    const cv::Rect part = cv::boundingRect(cv::Mat1b(mask > 0.5f));
    if (part.area() > 0) box = box.area() > 0 ? (box | part) : part;
  }
  if (box.area() == 0) return frame;
  const int margin = std::max(8, std::max(box.width, box.height) / 12);
  return cv::Rect(box.x - margin,
                  box.y - margin,
                  box.width + 2 * margin,
                  box.height + 2 * margin) &
         frame;
}

// Maps pixels of the picture to pixels of its enlarged cutting.
struct Cutting {
  cv::Rect box;
  double scale;

  Eigen::Vector2d Map(const Eigen::Vector2d& pixel) const {
    return {(pixel.x() - box.x + 0.5) * scale - 0.5,
            (pixel.y() - box.y + 0.5) * scale - 0.5};
  }
  cv::Point MapFixed(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d mapped = Map(pixel) * (1 << kSubpixelBits);
    return {static_cast<int>(std::lround(mapped.x())),
            static_cast<int>(std::lround(mapped.y()))};
  }
};

void DrawBoundary(const cv::Mat1f& coverage,
                  const Cutting& cutting,
                  const cv::Scalar& color,
                  cv::Mat3b* image) {
  if (coverage.empty()) return;
  for (const auto& contour : SubpixelContours(coverage)) {
    std::vector<cv::Point> points;
    points.reserve(contour.size());
    for (const Eigen::Vector2d& pixel : contour) {
      points.push_back(cutting.MapFixed(pixel));
    }
    cv::polylines(*image, points, true, color, 1, cv::LINE_AA, kSubpixelBits);
  }
}

cv::Scalar JointColor(int joint) {
  const std::string_view name = kJointNames[joint];
  if (name.starts_with("l_")) return kLeftColor;
  if (name.starts_with("r_")) return kRightColor;
  return kAxisColor;
}

void DrawSkeleton(const Camera& camera,
                  const JointFrames& frames,
                  const Cutting& cutting,
                  cv::Mat3b* image) {
  std::array<cv::Point, kNumJoints> point;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    const Eigen::Vector3d& joint_in_world = frames.joint_in_world[joint];
    // A joint behind the camera has no place in the picture.
    if (camera.PointInCamera(joint_in_world).z() <= 1e-3) return;
    point[joint] = cutting.MapFixed(camera.Project(joint_in_world));
  }
  for (int joint = 1; joint < kNumJoints; ++joint) {
    cv::line(*image,
             point[kJointParents[joint]],
             point[joint],
             JointColor(joint),
             1,
             cv::LINE_AA,
             kSubpixelBits);
  }
  for (int joint = 0; joint < kNumJoints; ++joint) {
    cv::circle(*image,
               point[joint],
               3 << kSubpixelBits,
               JointColor(joint),
               cv::FILLED,
               cv::LINE_AA,
               kSubpixelBits);
  }
}

// A cross at every landmark of the view, its arms as long as the landmark is
// uncertain along the picture's axes.
void DrawLandmarks(const std::string& camera_id,
                   const std::vector<Landmark2>& landmarks,
                   const Cutting& cutting,
                   cv::Mat3b* image) {
  for (const Landmark2& landmark : landmarks) {
    if (landmark.camera_id != camera_id) continue;
    const cv::Scalar& color =
        landmark.source == "keypoint" ? kKeypointColor : kLandmarkColor;
    for (int axis = 0; axis < 2; ++axis) {
      const double sigma = std::sqrt(landmark.covariance(axis, axis));
      const Eigen::Vector2d arm =
          std::clamp(sigma, 3 / cutting.scale, 20 / cutting.scale) *
          Eigen::Vector2d::Unit(axis);
      cv::line(*image,
               cutting.MapFixed(landmark.pixel - arm),
               cutting.MapFixed(landmark.pixel + arm),
               color,
               1,
               cv::LINE_AA,
               kSubpixelBits);
    }
  }
}

int PutText(const std::string& text,
            const cv::Point& at,
            double size,
            const cv::Scalar& color,
            cv::Mat3b* image) {
  cv::putText(
      *image, text, at, cv::FONT_HERSHEY_SIMPLEX, size, color, 1, cv::LINE_AA);
  int baseline = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, &baseline)
      .width;
}

std::string Title(const View& view, const OverlayContent& content) {
  std::string title = view.camera.id + "  pose " + content.pose;
  if (content.mesh_coverage.empty()) return title;
  char scores[96];
  std::snprintf(scores,
                sizeof(scores),
                "  IoU %.3f  boundary %.1f px",
                content.error.iou,
                content.error.boundary_mean);
  return title + scores;
}

void DrawLegend(const std::string& title, cv::Mat3b* strip) {
  PutText(title, {8, 20}, 0.5, kTextColor, strip);
  int x = 8;
  for (const auto& [text, color] :
       {std::pair<const char*, cv::Scalar>{"silhouette", kSilhouetteColor},
        {"fitted mesh", kMeshColor},
        {"left", kLeftColor},
        {"right", kRightColor},
        {"landmark", kLandmarkColor},
        {"keypoint", kKeypointColor}}) {
    x += PutText(text, {x, 44}, 0.45, color, strip) + 14;
  }
}

cv::Mat3b Thumbnail(const View& view, const std::string& pose) {
  const double scale = static_cast<double>(kThumbnailSize) /
                       std::max(view.image.cols, view.image.rows);
  cv::Mat3b small;
  cv::Mat1f coverage;
  cv::resize(view.image, small, {}, scale, scale, cv::INTER_AREA);
  cv::resize(view.coverage, coverage, small.size(), 0, 0, cv::INTER_AREA);
  for (int y = 0; y < small.rows; ++y) {
    for (int x = 0; x < small.cols; ++x) {
      const float light = 0.3f + 0.7f * coverage(y, x);
      for (int c = 0; c < 3; ++c) {
        small(y, x)[c] = cv::saturate_cast<uchar>(light * small(y, x)[c]);
      }
    }
  }
  cv::Mat3b framed(kThumbnailSize, kThumbnailSize, cv::Vec3b(24, 24, 24));
  small.copyTo(framed(cv::Rect((kThumbnailSize - small.cols) / 2,
                               (kThumbnailSize - small.rows) / 2,
                               small.cols,
                               small.rows)));
  PutText(pose + " " + view.camera.id, {6, 16}, 0.42, kTextColor, &framed);
  return framed;
}

}  // namespace

cv::Mat3b DrawOverlay(const View& view, const OverlayContent& content) {
  const cv::Rect box = PersonBox(view.coverage, content.mesh_coverage);
  const Cutting cutting{box, static_cast<double>(kOverlayHeight) / box.height};
  cv::Mat3b picture;
  cv::resize(view.image(box),
             picture,
             {static_cast<int>(std::lround(box.width * cutting.scale)),
              kOverlayHeight},
             0,
             0,
             cv::INTER_LINEAR);
  picture *= 0.55;
  DrawBoundary(view.coverage, cutting, kSilhouetteColor, &picture);
  DrawBoundary(content.mesh_coverage, cutting, kMeshColor, &picture);
  if (content.frames != nullptr) {
    DrawSkeleton(view.camera, *content.frames, cutting, &picture);
  }
  if (content.landmarks != nullptr) {
    DrawLandmarks(view.camera.id, *content.landmarks, cutting, &picture);
  }
  // A narrow person still leaves room for the legend.
  cv::Mat3b overlay(kOverlayHeight + kLegendHeight,
                    std::max(picture.cols, 520),
                    cv::Vec3b(24, 24, 24));
  picture.copyTo(overlay(cv::Rect((overlay.cols - picture.cols) / 2,
                                  kLegendHeight,
                                  picture.cols,
                                  picture.rows)));
  DrawLegend(Title(view, content), &overlay);
  return overlay;
}

cv::Mat3b DrawSilhouetteSheet(const std::vector<SheetRow>& rows) {
  size_t columns = 1;
  for (const SheetRow& row : rows) {
    columns = std::max(columns, row.views->size());
  }
  columns = std::min<size_t>(columns, 8);
  std::vector<cv::Mat3b> lines;
  for (const SheetRow& row : rows) {
    for (size_t i = 0; i < row.views->size(); ++i) {
      if (i % columns == 0) {
        lines.emplace_back(kThumbnailSize,
                           static_cast<int>(columns) * kThumbnailSize,
                           cv::Vec3b(24, 24, 24));
      }
      const int x = static_cast<int>(i % columns) * kThumbnailSize;
      Thumbnail((*row.views)[i], row.pose)
          .copyTo(lines.back()(cv::Rect(x, 0, kThumbnailSize, kThumbnailSize)));
    }
  }
  cv::Mat3b sheet;
  if (!lines.empty()) cv::vconcat(lines, sheet);
  return sheet;
}

}  // namespace sweepfit
