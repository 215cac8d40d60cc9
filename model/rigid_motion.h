// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace sweepfit {

// Rotation of an axis-angle vector (Rodrigues).
inline Eigen::Matrix3d RotationOf(const Eigen::Vector3d& axis_angle) {
  return Eigen::AngleAxisd(axis_angle.norm(), axis_angle.normalized())
      .toRotationMatrix();
}

// x -> rotation x + translation.
struct RigidMotion {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return rotation * point + translation;
  }
};

// Blends rigid motions as dual quaternions (Kavan, Collins, Zara, O'Sullivan,
// Geometric skinning with approximate dual quaternion blending, 2008).
class MotionBlend {
 public:
  void Add(double weight, const RigidMotion& motion) {
    const Eigen::Quaterniond real(motion.rotation);
    const Eigen::Vector3d& t = motion.translation;
    const Eigen::Quaterniond dual =
        Eigen::Quaterniond(0, t.x() / 2, t.y() / 2, t.z() / 2) * real;
    // q and -q are the same motion; the first one decides.
    if (real_.dot(real.coeffs()) < 0) weight = -weight;
    real_ += weight * real.coeffs();
    dual_ += weight * dual.coeffs();
  }

  RigidMotion Normalized() const {
    const double norm = real_.norm();
    const Eigen::Quaterniond real(Eigen::Vector4d(real_ / norm));
    const Eigen::Quaterniond dual(Eigen::Vector4d(dual_ / norm));
    return {real.toRotationMatrix(), 2 * (dual * real.conjugate()).vec()};
  }

 private:
  Eigen::Vector4d real_ = Eigen::Vector4d::Zero();
  Eigen::Vector4d dual_ = Eigen::Vector4d::Zero();
};

}  // namespace sweepfit
