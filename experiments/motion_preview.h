// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "model/body.h"
#include "model/progress.h"

namespace sweepfit {

struct PreviewOptions {
  int width = 480;  // pixels
  int height = 540;
  double frames_per_second = 20;
  // A longer motion is shown up to here, seconds.
  double longest = 20;
  // Where the camera stands: degrees from the direction in which the person
  // goes (or faces) towards its left.
  double azimuth = 40;
  // Pictures on the sheet.
  int sheet_columns = 6;
  int sheet_rows = 2;

  std::optional<std::string> Check() const;
};

// Pictures of a body in motion: textured (grey without a texture), in soft
// light on a floor of tiles of half a metre with a shadow; the camera goes
// along. Deformed by the sweeps.
class MotionPreview {
 public:
  // `texture` is BGR as in texture.png, or empty. The poses are `frame_time`
  // seconds apart; at least one. CHECKs the options.
  MotionPreview(const Body& body,
                const cv::Mat3b& texture,
                std::vector<Pose> poses,
                double frame_time,
                const PreviewOptions& options);
  ~MotionPreview();

  // Frames of the animated picture.
  int num_frames() const;
  double frame_time() const;
  bool is_cut_short() const;
  cv::Mat3b Render(int frame) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Writes the animated picture (WebP, plays for ever) and a contact sheet of
// frames evenly spaced in time, as PNG. InputError when a file cannot be
// written. Bytes do not depend on the number of threads.
void WriteMotionPreview(const MotionPreview& preview,
                        const PreviewOptions& options,
                        const std::string& animation_path,
                        const std::string& sheet_path,
                        Progress* progress);

}  // namespace sweepfit
