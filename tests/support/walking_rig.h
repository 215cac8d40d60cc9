// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "model/bvh.h"

namespace sweepfit {

// A skeleton like those of the CMU database: joints of length 0, three joints
// in the spine, arms held out at rest. Units are centimetres. Thighs are
// shorter and shanks longer than people's, so that the rig's steps do not fit
// anybody exactly.
class WalkingRig {
 public:
  static constexpr double kThigh = 36, kShank = 46, kAnkleHeight = 8;
  static constexpr double kHipHalf = 9;

  WalkingRig() {
    motion_.frame_time = 1.0 / 60;
    Add("Hips", -1, {0, 0, 0});
    for (const double side : {1.0, -1.0}) {
      const std::string s = side > 0 ? "L" : "R";
      const std::string name = side > 0 ? "Left" : "Right";
      const int none = Add(s + "HipJoint", 0, {0, 0, 0});
      const int hip = Add(name + "UpLeg", none, {side * kHipHalf, 0, 0});
      const int knee = Add(name + "Leg", hip, {0, -kThigh, 0});
      const int ankle = Add(name + "Foot", knee, {0, -kShank, 0});
      End(Add(name + "ToeBase", ankle, {0, -5, 14}), {0, 0, 0});
    }
    const int low = Add("LowerBack", 0, {0, 0, 0});
    const int spine = Add("Spine", low, {0, 12, 0});
    const int chest = Add("Spine1", spine, {0, 20, 0});
    const int neck = Add("Neck", chest, {0, 0, 0});
    const int neck1 = Add("Neck1", neck, {0, 20, 0});
    End(Add("Head", neck1, {0, 10, 0}), {0, 0, 0});
    for (const double side : {1.0, -1.0}) {
      const std::string name = side > 0 ? "Left" : "Right";
      const int collar = Add(name + "Shoulder", chest, {0, 0, 0});
      const int shoulder = Add(name + "Arm", collar, {side * 17, 14, 0});
      const int elbow = Add(name + "ForeArm", shoulder, {side * 28, 0, 0});
      const int wrist = Add(name + "Hand", elbow, {side * 25, 0, 0});
      const int base = Add(name + "FingerBase", wrist, {0, 0, 0});
      End(Add(name + "HandIndex1", base, {side * 8, 0, 0}), {0, 0, 0});
    }
    AddFrame();
  }

  BvhMotion& motion() { return motion_; }

  // Another frame, all rotations zero, hips at standing height.
  void AddFrame() {
    motion_.values.conservativeResize(motion_.values.rows() + 1, num_channels_);
    motion_.values.row(motion_.values.rows() - 1).setZero();
    Value("Hips", 1) = kThigh + kShank + kAnkleHeight;
  }

  // Channel of a joint in the last frame: 0..2 position (of the hips), else Z,
  // Y, X rotation in degrees.
  double& Value(const std::string& joint, int channel) {
    const BvhJoint& found = motion_.joints[motion_.Find(joint)];
    return motion_.values(motion_.num_frames() - 1,
                          found.first_channel + channel);
  }
  double& RotationX(const std::string& joint) {
    return Value(joint, joint == "Hips" ? 5 : 2);
  }

  // Puts an ankle at (height, z) relative to its hip by bending hip and knee
  // about X; the foot stays level.
  void Reach(const std::string& side, double drop, double z) {
    const double distance =
        std::min(std::hypot(drop, z), 0.9999 * (kThigh + kShank));
    const auto corner = [](double a, double b, double c) {
      return std::acos(
          std::clamp((a * a + b * b - c * c) / (2 * a * b), -1.0, 1.0));
    };
    const double knee = std::numbers::pi - corner(kThigh, kShank, distance);
    const double at_hip = corner(kThigh, distance, kShank);
    // A positive turn about X takes what points down backwards.
    const double hip = -std::atan2(z, drop) - at_hip;
    constexpr double kDegree = std::numbers::pi / 180;
    RotationX(side + "UpLeg") = hip / kDegree;
    RotationX(side + "Leg") = knee / kDegree;
    RotationX(side + "Foot") = -(hip + knee) / kDegree;
  }

  // Walks along +Z: two steps a second, feet planted for .6 s and swung for .4.
  void Walk(double seconds) {
    motion_.values.resize(0, num_channels_);
    constexpr double kPeriod = 1, kStance = 0.6, kSpeed = 110;  // cm/s
    const int num = static_cast<int>(seconds / motion_.frame_time);
    for (int frame = 0; frame < num; ++frame) {
      const double time = frame * motion_.frame_time;
      AddFrame();
      const double hip_height = 0.95 * (kThigh + kShank) + kAnkleHeight;
      const double hip_z = kSpeed * time;
      Value("Hips", 1) = hip_height;
      Value("Hips", 2) = hip_z;
      for (const bool left : {true, false}) {
        const double phase_time = time + (left ? 0 : kPeriod / 2);
        const double step = std::floor(phase_time / kPeriod);
        const double in_step = phase_time - step * kPeriod;
        // Planted where the hip passes in the middle of the stance.
        const double origin = (left ? 0 : kPeriod / 2);
        const double plant = kSpeed * (step * kPeriod - origin + kStance / 2);
        double foot_z = plant, lift = 0;
        if (in_step > kStance) {
          const double s = (in_step - kStance) / (kPeriod - kStance);
          foot_z += kSpeed * kPeriod * s * s * (3 - 2 * s);
          lift = 8 * std::sin(std::numbers::pi * s);
        }
        Reach(left ? "Left" : "Right",
              hip_height - kAnkleHeight - lift,
              foot_z - hip_z);
      }
      const double swing = 25 * std::sin(2 * std::numbers::pi * time / kPeriod);
      // Arms hang and swing.
      Value("LeftArm", 0) = -70;
      Value("RightArm", 0) = 70;
      Value("LeftArm", 1) = -swing;
      Value("RightArm", 1) = -swing;
    }
  }

 private:
  int Add(const std::string& name, int parent, const Eigen::Vector3d& offset) {
    BvhJoint joint;
    joint.name = name;
    joint.parent = parent;
    joint.offset = offset;
    joint.first_channel = num_channels_;
    if (parent < 0) {
      joint.channels = {BvhChannel::kXPosition,
                        BvhChannel::kYPosition,
                        BvhChannel::kZPosition};
    }
    joint.channels.insert(joint.channels.end(),
                          {BvhChannel::kZRotation,
                           BvhChannel::kYRotation,
                           BvhChannel::kXRotation});
    num_channels_ += static_cast<int>(joint.channels.size());
    motion_.joints.push_back(joint);
    return static_cast<int>(motion_.joints.size()) - 1;
  }

  void End(int parent, const Eigen::Vector3d& offset) {
    BvhJoint joint;
    joint.parent = parent;
    joint.offset = offset;
    joint.first_channel = num_channels_;
    motion_.joints.push_back(joint);
  }

  BvhMotion motion_;
  int num_channels_ = 0;
};

}  // namespace sweepfit
