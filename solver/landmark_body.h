// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "solver/landmark_contours.h"
#include "solver/landmark_graph.h"
#include "solver/landmark_limbs.h"
#include "solver/landmarks.h"
#include "volume/volume.h"

namespace sweepfit {

enum Side { kLeft = 0, kRight = 1 };

// The ends of the body by what they are; sides are not known yet.
struct BodyEnds {
  std::optional<Extremum> head;
  std::vector<Extremum> hands;  // at most two, the more prominent first
  std::vector<Extremum> feet;   // at most two, the lower first
};

// Feet are the two low ends, the head is the thickest of the others, the hands
// are what is left. `floor` is the y of the lowest point.
BodyEnds NameExtrema(const std::vector<Extremum>& extrema,
                     double body_height,
                     double floor);

// One arm or leg as seen in the volume.
struct LimbTrace {
  LimbLine line;  // from the tip
  double s_wrist_or_ankle = 0;
  double s_merge = 0;         // where it joins the trunk or the other leg
  bool merges_early = false;  // nearer to the tip than a limb can be short
  bool is_clear = false;      // the wrist or ankle stands out by its width
};

// What the volume tells about the body: landmarks with honest covariances.
struct BodyTrace {
  std::optional<Extremum> head;
  std::array<std::optional<LimbTrace>, 2> arm;  // by Side
  std::array<std::optional<LimbTrace>, 2> leg;
  Eigen::Vector3d left_in_world = Eigen::Vector3d::UnitX();
  Eigen::Vector3d facing_in_world = Eigen::Vector3d::UnitZ();
  double facing_confidence = 0;
  double crotch_height = 0;  // above the floor, metres; 0: not found
  std::vector<Landmark3> landmarks;
  std::vector<Landmark3> corners;  // armpits, crotch
  // For joints of a limb: where to look for its edges in pictures. What moves
  // this point across the limb moves the joint.
  struct LimbPlace {
    int joint;
    Eigen::Vector3d point_in_world;
    Eigen::Vector3d direction;  // unit, of the limb
    double max_half_width;      // metres
    Eigen::Matrix3d slack;      // what few cameras leave open: a covariance
  };
  std::vector<LimbPlace> limb_places;
  std::vector<TipPlace> tip_places;
  // The narrowest place between head and shoulders, where there is one.
  struct NeckPlace {
    Eigen::Vector3d center_in_world;
    Eigen::Vector3d down;  // unit, towards the pelvis
    Eigen::Vector3d axis;  // unit, of the neck itself, downwards
    double max_half_width;
    bool is_clear;
  };
  std::optional<NeckPlace> neck;
  std::vector<std::string> unsafe_limbs;
  std::vector<std::string> warnings;
};

// Armpits and crotch as features ("l_armpit", "r_armpit", "crotch"), found with
// the help of rough landmarks.
using FindCorners =
    std::function<std::vector<Landmark3>(const std::vector<Landmark3>& rough)>;

// Landmarks from the volume, and shoulders and hips from the corners of the
// outline beside them where these are found. `find_corners` may be empty.
BodyTrace TraceBody(const Volume& volume,
                    const BodyEnds& ends,
                    double body_height,
                    double floor,
                    const FindCorners& find_corners);

}  // namespace sweepfit
