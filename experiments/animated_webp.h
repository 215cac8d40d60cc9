// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>

namespace sweepfit {

// An animated picture in the WebP format, which browsers show. Lossy, plays for
// ever.
class AnimatedWebp {
 public:
  // `quality` 0 .. 100. CHECKs the size.
  AnimatedWebp(int width, int height, double seconds_per_frame, float quality);
  ~AnimatedWebp();

  void Add(const cv::Mat3b& bgr);
  // The bytes of the file; call once, after the last picture.
  std::string Finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sweepfit
