// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "capture/capture.h"
#include "capture/silhouette.h"
#include "model/progress.h"
#include "volume/coherence.h"

namespace sweepfit {

// What is known of one camera before any fit.
struct CameraCheck {
  std::string id;
  bool is_holdout = false;
  bool is_used = false;  // a silhouette was found in some pose
  // Seen from the person: around (0 along +z, 90 along +x), above the floor,
  // away; degrees and metres.
  double azimuth = 0, height = 0, distance = 0;
  double mm_per_pixel = 0;      // at the person
  double person_pixels = 0;     // extent of the silhouette, largest
  double exposure_gain = 0;     // picture over plate, mean; 0: no plate
  double plate_difference = 0;  // median, grey levels, after the gain
  // Outlines against the other cameras', after what is wrong was repaired.
  CameraCoherence coherence;
  std::vector<std::string> problems;  // empty: fine
};

struct CaptureCheck {
  std::vector<CameraCheck> cameras;
  double person_height = 0;  // metres, largest of the poses
  double lean = 0;         // of the body's long axis from the vertical, degrees
  double largest_gap = 0;  // between neighbouring fit cameras, degrees
  // The same with cameras that stand opposite each other taken for one: they
  // see the same outline.
  double largest_outline_gap = 0;
  int num_fit_cameras = 0;  // used and not held out
  // What to expect of a fit, mm: 0 when nothing can be said.
  double expected_outline = 0, expected_surface = 0;
  std::vector<std::string> warnings;  // what to know or to do
  std::vector<std::string> failures;  // why it cannot work, and what to do
  bool CanWork() const { return failures.empty(); }
};

// Checks whether a capture can work, over all its poses and cameras, held out
// ones included: units and up axis, the whole person in every picture,
// coherence of the silhouettes (FindIncoherence), cameras around the person,
// resolution, exposure and plates. The silhouettes are found as a fit with
// these options finds them. InputError when pictures cannot be read.
CaptureCheck CheckCapture(const Capture& capture,
                          const SegmentOptions& options,
                          Progress* progress);

// A table for people and its content as JSON.
std::string CheckTable(const CaptureCheck& check);
nlohmann::ordered_json CheckToJson(const CaptureCheck& check);

}  // namespace sweepfit
