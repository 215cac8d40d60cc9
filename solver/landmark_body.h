// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

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
  // For joints within a free limb: where to look for its edges in pictures.
  struct LimbPlace {
    int joint;
    Eigen::Vector3d direction;  // unit, of the limb
    double max_half_width;      // metres
  };
  std::vector<LimbPlace> limb_places;
  // For tips: a point further inside.
  struct TipPlace {
    int joint;
    Eigen::Vector3d base_in_world;
  };
  std::vector<TipPlace> tip_places;
  std::vector<std::string> unsafe_limbs;
  std::vector<std::string> warnings;
};

BodyTrace TraceBody(const Volume& volume,
                    const BodyEnds& ends,
                    double body_height,
                    double floor);

}  // namespace sweepfit
