// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "model/body.h"
#include "model/skeleton.h"

namespace sweepfit {

// The points of a foot that stand on the floor, in the frame of its ankle at
// rest, metres.
struct FootShape {
  Eigen::Vector3d heel;
  Eigen::Vector3d ball;  // where it rolls over when the heel has left
  // Those on which it can stand, however it is held: edge of the heel, ball,
  // tip of the toes, sides.
  std::vector<Eigen::Vector3d> sole;
};
// Of the left and the right foot: from the sole of the mesh at rest.
std::array<FootShape, 2> MeasureFeet(const Body& body);

// For every frame what of a foot stands.
struct FootContact {
  std::vector<bool> heel;
  std::vector<bool> ball;
  // The foot stands, on anything; it may still come down or already lift. Holds
  // the frames of heel and ball.
  std::vector<bool> stance;
};

// A point stands while it is low and slow: within 4 % of a leg's length above
// the lowest it is within .6 s (floors of motion capture slope, and there are
// stairs), slower than `most_speed` leg lengths per second and at some time
// slower than .25, for at least 80 ms. Breaks of less
// than 50 ms do not count.
std::vector<bool> FindStanding(const std::vector<Eigen::Vector3d>& point,
                               double frame_time,
                               double leg_length,
                               double most_speed = 0.5);

// Moves a body so that standing feet stay where they are. Every stance gets one
// place flat on the floor; before and after it the foot rolls over its sole
// without sliding, from the edge of the heel or to the tip of the toes, as the
// motion turns it. In between the correction passes smoothly from one stance to
// the next. No part of a sole goes below the floor. A stance ends where it
// would keep the foot further from the motion than a tenth of a leg. Legs
// follow by two-bone inverse kinematics in the plane in which the knee bends;
// the root sinks where a leg would be too short.
//
// `contact` is that of the left and the right foot. The floor is y = 0.
void LockFeet(const Skeleton& skeleton,
              const std::array<FootShape, 2>& feet,
              const std::array<FootContact, 2>& contact,
              double frame_time,
              std::vector<Pose>* poses);

// Points of the feet in a posture, world.
struct FootPoints {
  Eigen::Vector3d heel, ball;
};
std::array<FootPoints, 2> FootPointsOf(const JointFrames& frames,
                                       const std::array<FootShape, 2>& feet);

// The longest way, metres over the floor, between any two places of a point
// while it stands.
double LongestSlide(const std::vector<Eigen::Vector3d>& point,
                    const std::vector<bool>& stands);

}  // namespace sweepfit
