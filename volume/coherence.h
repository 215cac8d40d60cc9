// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "capture/silhouette.h"

namespace sweepfit {

// How well the silhouettes of one camera agree with those of the others. A
// point of an outline agrees when its viewing ray has a point that every other
// silhouette holds; else the miss says by how many pixels the best point of the
// ray lies outside. Means over all points, each at most kMaxMiss.
struct CameraCoherence {
  std::string camera_id;
  // Of this camera's outlines, judged by all others.
  double miss = 0;
  // Of the others' outlines, judged with and without this camera. A camera that
  // is wrong spoils them: the first is then much larger than the second. The
  // camera that suffers most does not count: if it alone suffers, it is wrong.
  double others_with = 0;
  double others_without = 0;

  // The turn of the camera (axis-angle in its own frame, radians; positive
  // angles move the picture's content against it) that agrees best with the
  // others, how far it moves the camera's outlines, root mean square, pixels,
  // and the mean miss of all outlines before and after it.
  bool has_turn = false;  // whether it was looked for
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  double shift = 0;
  double miss_before = 0;
  double miss_after = 0;
};

inline constexpr double kMaxMiss = 12;  // pixels

// Silhouette coherence (after Hernandez, Schmitt and Cipolla, "Silhouette
// coherence for camera calibration under circular motion", 2007), leaving the
// camera in question out, over all poses together: poses[p] are the views of
// one pose, in which cameras may be missing; calibration is the same in all.
// Poses with fewer than three views say nothing. The cameras come in the order
// in which they first appear.
std::vector<CameraCoherence> MeasureCoherence(
    const std::vector<std::vector<View>>& poses);

// Looks for the turn of one camera among the result of MeasureCoherence.
void MeasureTurn(const std::vector<std::vector<View>>& poses,
                 CameraCoherence* camera);

// A camera or a silhouette that disagrees with the others.
struct Incoherence {
  enum class Kind {
    kTurned,  // the camera's calibration; `turn` repairs it
    kMoved,   // the camera as a whole; no turn repairs it
    kHides,   // a silhouette lacks parts that the others see
    kShows,   // a silhouette has parts that the others do not hold
  };
  Kind kind = Kind::kTurned;
  CameraCoherence camera;
  int pose = -1;  // of a silhouette: position in poses
  // One line: which camera, how far, what that means.
  std::string Text() const;
  // What RepairIncoherence did about it, to go on with: "; it is left out".
  std::string RepairText(bool repaired) const;
};

struct IncoherenceOptions {
  // repair: turn or leave out what disagrees; warn: only say so; off.
  std::string mode = "repair";
  // Look for the turn of every camera and so find errors of a pixel or two;
  // else only where the silhouettes are plainly spoilt (several pixels).
  bool thorough = false;
  std::optional<std::string> Check() const;
};

// Which cameras disagree, worst first; each is repaired or left out before the
// next is looked for, so that one wrong camera does not blame the others.
std::vector<Incoherence> FindIncoherence(std::vector<std::vector<View>> poses,
                                         const IncoherenceOptions& options);

// Turns cameras of kTurned and removes views of kMoved and kHides as long as
// three are left in the pose. kShows harms nobody else and stays. Says of each
// whether anything was done.
std::vector<bool> RepairIncoherence(const std::vector<Incoherence>& found,
                                    std::vector<std::vector<View>>* poses);

}  // namespace sweepfit
