// SPDX-License-Identifier: Apache-2.0
#include "experiments/animated_webp.h"

#include <glog/logging.h>
#include <webp/encode.h>
#include <webp/mux.h>

#include <cmath>

namespace sweepfit {

struct AnimatedWebp::Impl {
  WebPAnimEncoder* encoder = nullptr;
  WebPConfig config;
  cv::Size size;
  double seconds_per_frame = 0;
  int num_frames = 0;

  int Milliseconds(int frame) const {
    return static_cast<int>(std::lround(1000 * seconds_per_frame * frame));
  }
};

AnimatedWebp::AnimatedWebp(int width,
                           int height,
                           double seconds_per_frame,
                           float quality)
    : impl_(std::make_unique<Impl>()) {
  CHECK(width > 0 && height > 0 && width < 16384 && height < 16384);
  CHECK_GT(seconds_per_frame, 0);
  WebPAnimEncoderOptions options;
  CHECK(WebPAnimEncoderOptionsInit(&options));
  options.anim_params.loop_count = 0;
  impl_->encoder = WebPAnimEncoderNew(width, height, &options);
  CHECK(impl_->encoder != nullptr);
  CHECK(WebPConfigPreset(&impl_->config, WEBP_PRESET_DRAWING, quality));
  impl_->size = cv::Size(width, height);
  impl_->seconds_per_frame = seconds_per_frame;
}

AnimatedWebp::~AnimatedWebp() { WebPAnimEncoderDelete(impl_->encoder); }

void AnimatedWebp::Add(const cv::Mat3b& bgr) {
  CHECK_EQ(bgr.size(), impl_->size);
  const cv::Mat3b packed = bgr.isContinuous() ? bgr : bgr.clone();
  WebPPicture picture;
  CHECK(WebPPictureInit(&picture));
  picture.use_argb = 1;
  picture.width = packed.cols;
  picture.height = packed.rows;
  CHECK(WebPPictureImportBGR(
      &picture, packed.ptr(), static_cast<int>(packed.step[0])));
  CHECK(WebPAnimEncoderAdd(impl_->encoder,
                           &picture,
                           impl_->Milliseconds(impl_->num_frames),
                           &impl_->config))
      << WebPAnimEncoderGetError(impl_->encoder);
  WebPPictureFree(&picture);
  ++impl_->num_frames;
}

std::string AnimatedWebp::Finish() {
  // The end of the last picture.
  CHECK(WebPAnimEncoderAdd(impl_->encoder,
                           nullptr,
                           impl_->Milliseconds(impl_->num_frames),
                           nullptr));
  WebPData data;
  WebPDataInit(&data);
  CHECK(WebPAnimEncoderAssemble(impl_->encoder, &data))
      << WebPAnimEncoderGetError(impl_->encoder);
  std::string bytes(reinterpret_cast<const char*>(data.bytes), data.size);
  WebPDataClear(&data);
  return bytes;
}

}  // namespace sweepfit
