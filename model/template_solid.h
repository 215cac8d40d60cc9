// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <vector>

#include "model/skeleton.h"
#include "model/template_field.h"
#include "model/template_tables.h"

namespace sweepfit {

// The generic body as a solid: smooth unions of section stacks, ellipsoids and
// tubes, in metres, standing on y = 0, facing +Z, symmetric in x. Signed
// distances are negative inside and approximate away from the surface.
class TemplateSolid {
 public:
  // `joints`: rest positions with the floor at y = 0. `girth_factor` multiplies
  // the target girths, in the order of tables.girths.
  TemplateSolid(const TemplateTables& tables,
                double stature,
                const std::array<Eigen::Vector3d, kNumJoints>& joints,
                const std::vector<double>& girth_factor);

  // Parts of the left side (the trunk is whole).
  double Trunk(const Eigen::Vector3d& point) const;  // with neck and head
  double Arm(const Eigen::Vector3d& point) const;    // palm, without fingers
  double ArmAndHand(const Eigen::Vector3d& point) const;  // with fingers
  double Finger(int finger, const Eigen::Vector3d& point) const;
  double Leg(const Eigen::Vector3d& point) const;
  double Foot(const Eigen::Vector3d& point) const;  // without toes
  double Toe(int toe, const Eigen::Vector3d& point) const;
  double LegAndFoot(const Eigen::Vector3d& point) const;  // with toes
  // Everything, both sides.
  double Body(const Eigen::Vector3d& point) const;

  const TemplateTables& tables() const { return tables_; }
  double stature() const { return stature_; }
  const std::array<Eigen::Vector3d, kNumJoints>& joints() const {
    return joints_;
  }

  // Point on the axis of the left arm (leg) at `bones` from the shoulder
  // (hip), without and with the centre offset of the table.
  Eigen::Vector3d ArmAxis(double bones) const;
  Eigen::Vector3d LegAxis(double bones) const;
  Eigen::Vector3d ArmCenter(double bones) const;
  Eigen::Vector3d LegCenter(double bones) const;
  Eigen::Vector3d TrunkCenter(double height) const;
  // Unit axes of the left arm: along, towards the thumb, towards the palm.
  const Eigen::Vector3d& arm_along() const { return arm_along_; }
  const Eigen::Vector3d& arm_thumb() const { return arm_thumb_; }
  const Eigen::Vector3d& arm_palm() const { return arm_palm_; }
  const Eigen::Vector3d& foot_forward() const { return foot_forward_; }
  const Eigen::Vector3d& foot_lateral() const { return foot_lateral_; }
  Eigen::Vector3d FootCenter(double forward) const {
    return foot_.Center(forward);
  }
  const Tube& finger(int index) const { return finger_[index]; }
  const Tube& toe(int index) const { return toe_[index]; }

  // Tape girth at a target's level, metres.
  double MeasureGirth(const GirthTarget& target) const;

 private:
  void Build(const std::vector<double>& girth_scale);
  // Of the sections of a part at a level (height, or bones of the limb).
  double ScaleAt(const std::string& part, double level) const;
  std::vector<StackSection> Scaled(const SectionTable& table,
                                   const std::string& part) const;
  void BuildDigits();
  // The distance of a solid with fingers or toes blended to it.
  double WithDigits(double solid,
                    const std::array<Tube, 5>& digits,
                    const TubeBound& bound,
                    double blend,
                    const Eigen::Vector3d& point) const;
  void BuildFeatures();
  // Places a point of a part's coordinates, scaled like the section there;
  // `scale` and the axes of the coordinates are returned.
  struct Placement {
    Eigen::Vector3d point;
    Eigen::Matrix3d axes;  // in the columns
    double scale = 1;
  };
  Placement Place(const std::string& part, const Eigen::Vector3d& at) const;

  TemplateTables tables_;
  double stature_;
  std::array<Eigen::Vector3d, kNumJoints> joints_;
  std::vector<double> girth_scale_;  // found so that the girths are met
  Eigen::Vector3d arm_along_, arm_thumb_, arm_palm_;
  Eigen::Vector3d foot_forward_, foot_lateral_;
  SectionStack trunk_, neck_, head_, arm_, leg_, foot_;
  double leg_top_ = 0;
  double foot_top_ = 0;
  std::vector<Feature> trunk_features_, head_features_, arm_features_,
      leg_features_, foot_features_;
  std::array<Tube, 5> finger_, toe_;
  TubeBound around_fingers_, around_toes_;
};

// Distance along the unit direction from `origin`, which is inside the solid,
// to where `distance` first becomes positive.
double ExitDistance(
    const std::function<double(const Eigen::Vector3d&)>& distance,
    const Eigen::Vector3d& origin,
    const Eigen::Vector3d& direction,
    double step);

}  // namespace sweepfit
