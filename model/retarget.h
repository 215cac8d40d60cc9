// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "model/body.h"
#include "model/bvh.h"
#include "model/skeleton.h"

namespace sweepfit {

struct RetargetOptions {
  // Names of the source's joints: a preset, a file, or "auto"; see
  // joint_names.h.
  std::string names = "auto";
  // Metres per unit of the source for the way that it goes over the floor; 0:
  // the ratio of the leg lengths, whatever the unit, so that steps fit the
  // body. Heights always follow the legs.
  double scale = 0;
  // The part of the motion, seconds.
  double start = 0;
  double end = std::numeric_limits<double>::infinity();
  // Frames per second of the result; 0: those of the source up to 60.
  double frames_per_second = 0;
  // Keep feet where they stand (inverse kinematics of the legs).
  bool lock_feet = true;
  // Keep joints within the limits of joint_limits.yaml.
  bool limit_joints = true;

  std::optional<std::string> Check() const;
};

struct RetargetResult {
  std::string names;  // the map that was used
  double metres_per_unit = 0;
  std::vector<double> time;  // seconds, from 0, evenly spaced
  std::vector<Pose> poses;   // metres, +Y up, floor at y = 0
  double frame_time = 0;
  // What a person should know: joints that would leave their limits and what
  // was done about it, a vertical axis that is not Y.
  std::vector<std::string> notes;
  // While a heel or the ball of a foot stands: the longest way that it goes,
  // metres, and the share of the time that some foot stands.
  double longest_slide = 0;
  double standing_share = 0;
};

// Transfers a motion to a body. With R_k(t) the rotation of a source joint
// against its rest pose, in the world, and A_j the smallest rotation that takes
// the source's bone at rest onto ours (after both stand alike),
//   G_j(t) = W R_k(t) A_j^-1
// is the orientation of our joint j, where k is the last source joint before
// the bone's end, so that chains of joints are composed, and W the smallest
// rotation that then takes the bone onto the straight line between the source
// joints: our bones point where the source's do. Bones of the axis and feet,
// whose directions differ between skeletons by definition rather than posture,
// are at rest where the source is; feet keep their heading. Elbows and knees
// bend about their hinges, the upper bone's twist gives way; a wrist's twist
// goes into the forearm. Collar bones follow the source joints between chest
// and shoulder.
//
// Throws InputError naming `source` when joints are not found or lie in no
// order that a person has, and when no frame lies between start and end.
RetargetResult Retarget(const BvhMotion& motion,
                        const Body& body,
                        const RetargetOptions& options,
                        const std::string& source);

}  // namespace sweepfit
