// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "capture/camera.h"

namespace sweepfit {

// One camera of a capture and the pictures that belong to it for all poses.
// Paths are relative to the capture folder.
struct CaptureCamera {
  Camera camera;
  std::vector<std::string> background;    // frames of the empty scene
  std::optional<std::string> chroma_key;  // "green", "blue" or "auto"
};

struct CapturePose {
  std::string name;
  std::map<std::string, std::string> images;  // camera id -> path
  std::map<std::string, std::string> masks;   // given silhouettes
};

// A capture folder (capture.yaml), already turned to metres and +Y up.
struct Capture {
  std::filesystem::path folder;
  std::vector<CaptureCamera> cameras;
  std::vector<std::string> holdout;
  std::vector<CapturePose> poses;

  const CaptureCamera& FindCamera(const std::string& id) const;  // InputError
  const CapturePose& FindPose(const std::string& name) const;    // InputError
  bool IsHoldout(const std::string& id) const;
};

// Reads and checks capture.yaml: unknown keys, wrong types, NaN, K that is no
// pinhole matrix, R that is no rotation (|R^T R - I| > 1e-3 or det < 0; smaller
// deviations are orthonormalised), duplicate ids, images of unknown cameras,
// files that do not exist, fewer than two cameras. Throws InputError naming
// file, key, camera and line. The keys are specified in README.md.
Capture LoadCapture(const std::filesystem::path& folder);

// Writes capture.yaml (metres, up: y) into capture.folder.
void SaveCapture(const Capture& capture);

// Decodes a picture of the capture as 8-bit BGR (grey pictures become BGR; 16
// bit is scaled to 8) and checks its size against the camera. InputError names
// file and camera; a truncated file is an error, not a grey picture.
cv::Mat3b LoadPicture(const Capture& capture,
                      const std::string& relative_path,
                      const Camera& camera);

// A given mask: coverage 0..1.
cv::Mat1f LoadMask(const Capture& capture,
                   const std::string& relative_path,
                   const Camera& camera);

}  // namespace sweepfit
