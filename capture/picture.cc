// SPDX-License-Identifier: Apache-2.0
// Decoding of pictures and given masks.
#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string_view>
#include <vector>

#include "capture/capture.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

using Bytes = std::vector<std::uint8_t>;

[[noreturn]] void Fail(const std::filesystem::path& path,
                       const Camera& camera,
                       const std::string& what) {
  throw InputError(path.string() + ": camera " + camera.id + ": " + what);
}

bool StartsWith(const Bytes& bytes, std::string_view magic) {
  return bytes.size() >= magic.size() &&
         std::equal(
             magic.begin(), magic.end(), bytes.begin(), [](char a, auto b) {
               return static_cast<std::uint8_t>(a) == b;
             });
}

// The decoder fills what is missing with grey and says nothing, so the end of
// the picture must be looked for: the EOI marker after the start of the scan
// (an embedded preview has an EOI of its own before it).
bool IsWholeJpeg(const Bytes& bytes) {
  std::size_t i = 2;
  while (i + 4 <= bytes.size()) {
    if (bytes[i] != 0xFF) return false;
    const std::uint8_t marker = bytes[i + 1];
    if (marker == 0xFF) {  // fill byte
      ++i;
      continue;
    }
    const std::size_t length = 256u * bytes[i + 2] + bytes[i + 3];
    i += 2 + length;
    constexpr std::uint8_t kStartOfScan = 0xDA;
    if (marker == kStartOfScan) break;
  }
  constexpr std::array<std::uint8_t, 2> kEndOfImage = {0xFF, 0xD9};
  return i < bytes.size() &&
         std::search(bytes.begin() + static_cast<std::ptrdiff_t>(i),
                     bytes.end(),
                     kEndOfImage.begin(),
                     kEndOfImage.end()) != bytes.end();
}

bool IsWholePng(const Bytes& bytes) {
  constexpr std::size_t kChunkFrame = 12;  // length, type and checksum
  std::size_t i = 8;
  while (i + kChunkFrame <= bytes.size()) {
    const std::size_t length = (std::size_t{bytes[i]} << 24) |
                               (std::size_t{bytes[i + 1]} << 16) |
                               (std::size_t{bytes[i + 2]} << 8) | bytes[i + 3];
    if (bytes.size() - i - kChunkFrame < length) return false;
    const std::string_view type(reinterpret_cast<const char*>(&bytes[i + 4]),
                                4);
    if (type == "IEND") return true;
    i += kChunkFrame + length;
  }
  return false;
}

Bytes ReadBytes(const std::filesystem::path& path, const Camera& camera) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) Fail(path, camera, "no such file");
  if (!std::filesystem::is_regular_file(path, error)) {
    Fail(path, camera, "not a file");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) Fail(path, camera, "cannot be opened");
  Bytes bytes((std::istreambuf_iterator<char>(file)),
              std::istreambuf_iterator<char>());
  if (file.bad()) Fail(path, camera, "cannot be read");
  if (bytes.empty()) Fail(path, camera, "the file is empty");
  return bytes;
}

// Pixels as stored (no turning by EXIF: the calibration is of those), 8 or 16
// bits per channel, of the camera's size.
cv::Mat Decode(const std::filesystem::path& path,
               const Camera& camera,
               int flags) {
  const Bytes bytes = ReadBytes(path, camera);
  const bool is_jpeg = StartsWith(bytes, "\xFF\xD8");
  const bool is_png = StartsWith(bytes, "\x89PNG\r\n\x1A\n");
  if ((is_jpeg && !IsWholeJpeg(bytes)) || (is_png && !IsWholePng(bytes))) {
    Fail(path, camera, "the picture is truncated");
  }
  cv::Mat picture;
  try {
    picture = cv::imdecode(bytes, flags);
  } catch (const cv::Exception&) {
    picture.release();
  }
  if (picture.empty()) Fail(path, camera, "cannot be decoded as a picture");
  if (picture.cols != camera.width || picture.rows != camera.height) {
    Fail(path,
         camera,
         "the picture has " + std::to_string(picture.cols) + " x " +
             std::to_string(picture.rows) + " pixels, the camera " +
             std::to_string(camera.width) + " x " +
             std::to_string(camera.height));
  }
  if (picture.depth() != CV_8U && picture.depth() != CV_16U) {
    Fail(path, camera, "only 8 and 16 bits per channel are supported");
  }
  return picture;
}

}  // namespace

cv::Mat3b LoadPicture(const Capture& capture,
                      const std::string& relative_path,
                      const Camera& camera) {
  cv::Mat picture = Decode(
      capture.folder / relative_path,
      camera,
      cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  if (picture.depth() == CV_16U) picture.convertTo(picture, CV_8U, 1.0 / 257);
  return picture;
}

cv::Mat1f LoadMask(const Capture& capture,
                   const std::string& relative_path,
                   const Camera& camera) {
  const cv::Mat picture = Decode(capture.folder / relative_path,
                                 camera,
                                 cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH |
                                     cv::IMREAD_IGNORE_ORIENTATION);
  cv::Mat1f coverage;
  picture.convertTo(
      coverage, CV_32F, picture.depth() == CV_16U ? 1.0 / 65535 : 1.0 / 255);
  return coverage;
}

}  // namespace sweepfit
