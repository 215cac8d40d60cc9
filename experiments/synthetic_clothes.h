// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "experiments/synthetic_person.h"

namespace sweepfit {

// Smooth noise in -1..1 with features about one unit apart.
double ValueNoise(const Eigen::Vector3d& point, std::uint32_t seed);

// Clothes, hair and skin of one person, as functions of the point in the rest
// pose (PersonShape::RestJoints), so that they stick to the body in all poses.
// Colours are linear RGB, 0..1.
class Outfit {
 public:
  // Garment colours keep away from `avoided`, the colours of the room.
  Outfit(const PersonShape& shape,
         unsigned seed,
         const std::array<Eigen::Vector3d, 3>& avoided);

  // How far cloth, hair, shoes and small seeded bumps of the body lie above
  // the smooth body, metres; may be negative (a dent).
  double Thickness(const Eigen::Vector3d& rest_point) const;
  Eigen::Vector3d Color(const Eigen::Vector3d& rest_point) const;

 private:
  enum Material { kSkin, kShirt, kTrousers, kShoe, kHair };
  Material MaterialAt(const Eigen::Vector3d& rest_point) const;
  // Signed depth (metres, positive inside) of a point in the region of a
  // garment.
  double InsideShirt(const Eigen::Vector3d& p) const;
  double InsideTrousers(const Eigen::Vector3d& p) const;
  double InsideShoe(const Eigen::Vector3d& p) const;
  double InsideHair(const Eigen::Vector3d& p) const;
  Eigen::Vector3d SkinColor(const Eigen::Vector3d& p) const;
  Eigen::Vector3d ShirtColor(const Eigen::Vector3d& p) const;

  PersonShape shape_;
  std::array<Eigen::Vector3d, kNumJoints> rest_;
  std::uint32_t noise_seed_;
  double head_unit_;  // one "stature" of the head's own scale, metres
  double sleeve_x_, neckline_y_, hem_y_, trousers_y_, shoe_y_;
  double shirt_thickness_, trousers_thickness_, hair_thickness_;
  double fold_height_, bump_height_;
  int pattern_;  // 0 plain with a print, 1 stripes, 2 checks
  double stripe_width_;
  Eigen::Vector3d skin_, shirt_, shirt_second_, trousers_, shoe_, hair_;
};

}  // namespace sweepfit
