// SPDX-License-Identifier: Apache-2.0
#include "experiments/synthetic_clothes.h"

#include <algorithm>
#include <cmath>

#include "experiments/random.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// A value in -1..1 for every lattice point (finaliser of MurmurHash3).
double LatticeValue(int x, int y, int z, std::uint32_t seed) {
  std::uint32_t h = seed * 0x9e3779b9u +
                    static_cast<std::uint32_t>(x) * 0x8da6b343u +
                    static_cast<std::uint32_t>(y) * 0xd8163841u +
                    static_cast<std::uint32_t>(z) * 0xcb1ab31fu;
  h ^= h >> 16;
  h *= 0x85ebca6bu;
  h ^= h >> 13;
  h *= 0xc2b2ae35u;
  h ^= h >> 16;
  return h * (2.0 / 4294967295.0) - 1;
}

double SmoothStep(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

Vector3d FromHsv(double hue, double saturation, double value) {
  const auto channel = [&](double n) {
    const double k = std::fmod(n + hue * 6, 6.0);
    const double m = std::clamp(std::min(k, 4 - k), 0.0, 1.0);
    return value * (1 - saturation * m);
  };
  return {channel(5), channel(3), channel(1)};
}

// Distance of two linear colours as an eye would have it, roughly.
double ColorDistance(const Vector3d& a, const Vector3d& b) {
  return (a.cwiseMax(0).cwiseSqrt() - b.cwiseMax(0).cwiseSqrt()).norm();
}

Vector3d DrawGarmentColor(Random* random,
                          double low_value,
                          double high_value,
                          const std::vector<Vector3d>& avoided) {
  Vector3d best = Vector3d::Zero();
  double best_distance = -1;
  for (int attempt = 0; attempt < 40; ++attempt) {
    const double hue = random->Uniform();
    const double saturation = random->Uniform(0.25, 0.75);
    const Vector3d color =
        FromHsv(hue, saturation, random->Uniform(low_value, high_value));
    double distance = 1;
    for (const Vector3d& other : avoided) {
      distance = std::min(distance, ColorDistance(color, other));
    }
    if (distance > 0.3) return color;
    if (distance > best_distance) {
      best_distance = distance;
      best = color;
    }
  }
  return best;
}

}  // namespace

double ValueNoise(const Vector3d& point, std::uint32_t seed) {
  const Vector3d floor = point.array().floor();
  const Vector3d f = point - floor;
  const Vector3d w = f.array().square() * (3 - 2 * f.array());
  const int x = static_cast<int>(floor.x()), y = static_cast<int>(floor.y()),
            z = static_cast<int>(floor.z());
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int i = corner & 1, j = corner >> 1 & 1, k = corner >> 2;
    sum += (i ? w.x() : 1 - w.x()) * (j ? w.y() : 1 - w.y()) *
           (k ? w.z() : 1 - w.z()) * LatticeValue(x + i, y + j, z + k, seed);
  }
  return sum;
}

Outfit::Outfit(const PersonShape& shape,
               unsigned seed,
               const std::array<Vector3d, 3>& avoided)
    : shape_(shape), rest_(shape.RestJoints()) {
  Random random(0x636c6f74ull * 1000003 + seed);
  noise_seed_ = seed * 2654435761u + 17;
  const double h = shape.stature;
  head_unit_ = h * shape.head_scale;
  const double shoulder = rest_[kLShoulder].x(), elbow = rest_[kLElbow].x(),
               wrist = rest_[kLWrist].x();
  sleeve_x_ = random.Chance(0.35)
                  ? wrist - random.Uniform(0.005, 0.02) * h
                  : shoulder + random.Uniform(0.45, 0.8) * (elbow - shoulder);
  neckline_y_ = rest_[kNeck].y() + random.Uniform(-0.012, 0.004) * h;
  hem_y_ = rest_[kRoot].y() + random.Uniform(-0.025, 0.035) * h;
  const bool shorts = random.Chance(0.25);
  trousers_y_ = shorts ? rest_[kLKnee].y() + random.Uniform(-0.01, 0.07) * h
                       : rest_[kLAnkle].y() + random.Uniform(-0.005, 0.02) * h;
  shoe_y_ = rest_[kLAnkle].y() + random.Uniform(-0.004, 0.022) * h;
  const bool loose = random.Chance(0.4);
  shirt_thickness_ =
      loose ? random.Uniform(0.006, 0.012) : random.Uniform(0.002, 0.005);
  trousers_thickness_ =
      loose ? random.Uniform(0.004, 0.009) : random.Uniform(0.002, 0.005);
  hair_thickness_ = random.Uniform(0.006, 0.014);
  fold_height_ = loose ? 0.005 : 0.002;
  bump_height_ = random.Uniform(0.002, 0.005);
  pattern_ = static_cast<int>(random.Uniform(0, 3));
  stripe_width_ = random.Uniform(0.025, 0.06);

  const double tan = random.Uniform();
  skin_ = (1 - tan) * Vector3d(0.66, 0.42, 0.32) +
          tan * Vector3d(0.20, 0.095, 0.055);
  std::vector<Vector3d> taken(avoided.begin(), avoided.end());
  taken.push_back(skin_);
  shirt_ = DrawGarmentColor(&random, 0.25, 0.75, taken);
  taken.push_back(shirt_);
  shirt_second_ = DrawGarmentColor(&random, 0.2, 0.9, taken);
  trousers_ = DrawGarmentColor(&random, 0.06, 0.3, taken);
  shoe_ = DrawGarmentColor(&random, 0.05, 0.8, taken);
  const double fair = random.Uniform();
  hair_ = (1 - fair) * Vector3d(0.020, 0.013, 0.010) +
          fair * fair * Vector3d(0.40, 0.22, 0.08);
}

double Outfit::InsideShirt(const Vector3d& p) const {
  // A little wave keeps hems from being perfect circles.
  const double wave = 0.006 * ValueNoise(p * 9, noise_seed_ + 1);
  const double above_hem = p.y() - hem_y_ - wave;
  const double in_sleeve = sleeve_x_ - std::abs(p.x()) + wave;
  // The neckline dips in front.
  const double neckline =
      neckline_y_ - 0.45 * std::max(0.0, p.z() - rest_[kNeck].z());
  const double shoulder = rest_[kLShoulder].x();
  const double below_neckline = std::abs(p.x()) > 0.7 * shoulder
                                    ? 1.0
                                    : neckline + 0.2 * std::abs(p.x()) - p.y();
  return std::min({above_hem, in_sleeve, below_neckline});
}

double Outfit::InsideTrousers(const Vector3d& p) const {
  const double wave = 0.005 * ValueNoise(p * 9, noise_seed_ + 2);
  const double waist = rest_[kRoot].y() + 0.07 * shape_.stature;
  return std::min(waist - p.y(), p.y() - trousers_y_ - wave);
}

double Outfit::InsideShoe(const Vector3d& p) const {
  return shoe_y_ + 0.1 * (p.z() - rest_[kLAnkle].z()) - p.y();
}

double Outfit::InsideHair(const Vector3d& p) const {
  const Vector3d q = (p - rest_[kHead]) / head_unit_;
  if (q.y() < -0.08 || std::abs(q.x()) > 0.08) return -1;
  const double wave = 0.003 * ValueNoise(p * 60, noise_seed_ + 3);
  const double cap = (q.y() - 0.9 * q.z() - 0.018 + wave) / 1.35;
  if (!shape_.long_hair) return cap * head_unit_;
  const double back = (q.y() - 2 * q.z() - 0.006 + wave) / 2.24;
  return std::max(cap, back) * head_unit_;
}

Outfit::Material Outfit::MaterialAt(const Vector3d& p) const {
  if (InsideHair(p) > 0) return kHair;
  if (InsideShoe(p) > 0) return kShoe;
  if (InsideShirt(p) > 0) return kShirt;
  if (InsideTrousers(p) > 0) return kTrousers;
  return kSkin;
}

double Outfit::Thickness(const Vector3d& p) const {
  constexpr double kEdge = 0.010;  // width over which a hem rises
  const auto layer = [](double inside, double thickness) {
    return thickness * SmoothStep(-0.3 * kEdge, 0.7 * kEdge, inside);
  };
  const double shirt = InsideShirt(p), trousers = InsideTrousers(p);
  double thickness = 0;
  if (shirt > -kEdge || trousers > -kEdge) {
    const double folds =
        fold_height_ * (0.7 * ValueNoise(p.cwiseProduct(Vector3d(14, 7, 14)),
                                         noise_seed_ + 4) +
                        0.5 * ValueNoise(p * 26, noise_seed_ + 5));
    // Loose shirts hang away from the waist.
    const double flare = 1 + 0.5 * SmoothStep(0.2, 0.0, p.y() - hem_y_) *
                                 (p.y() < rest_[kLShoulder].y() - 0.1);
    thickness = std::max(
        layer(shirt,
              shirt_thickness_ * flare +
                  trousers_thickness_ * SmoothStep(0.01, -0.01, -trousers) +
                  folds),
        layer(trousers, trousers_thickness_ + folds));
  }
  thickness = std::max(thickness, layer(InsideShoe(p), 0.004));
  thickness = std::max(thickness, layer(InsideHair(p), hair_thickness_));
  // Bodies are no smooth unions of capsules: long waves on trunk and limbs,
  // none on the head.
  const double below_head =
      SmoothStep(0.0, 0.05, rest_[kHead].y() - 0.04 - p.y());
  const double bumps = ValueNoise(p * 5, noise_seed_ + 6) +
                       0.5 * ValueNoise(p * 11, noise_seed_ + 7);
  const double before_hands =
      SmoothStep(0.0, 0.05, rest_[kLWrist].x() - std::abs(p.x()));
  return thickness + bump_height_ * bumps * below_head * before_hands;
}

Vector3d Outfit::SkinColor(const Vector3d& p) const {
  double shade = 1 + 0.06 * ValueNoise(p * 35, noise_seed_ + 8) +
                 0.05 * ValueNoise(p * 120, noise_seed_ + 9);
  // Freckles and moles.
  const double spots = ValueNoise(p * 170, noise_seed_ + 10);
  if (spots > 0.55) shade *= 0.82;
  Vector3d color = shade * skin_;
  const Vector3d q = (p - rest_[kHead]) / head_unit_;
  if (q.z() < 0.03 || std::abs(q.x()) > 0.04 || q.y() < -0.04) return color;
  const auto in_ellipse = [&](double x, double y, double rx, double ry) {
    return std::pow((std::abs(q.x()) - x) / rx, 2) +
               std::pow((q.y() - y) / ry, 2) <
           1;
  };
  if (in_ellipse(0.0165, 0.0375, 0.0095, 0.0024)) return hair_ * 0.9;
  if (in_ellipse(0.0165, 0.0265, 0.0028, 0.0028)) return {0.02, 0.015, 0.01};
  if (in_ellipse(0.0165, 0.0265, 0.0068, 0.0034)) return {0.75, 0.73, 0.7};
  if (in_ellipse(0, -0.0065, 0.0125, 0.0045)) {
    const bool between = std::abs(q.y() + 0.0065) < 0.0008;
    return color.cwiseProduct(Vector3d(0.85, 0.5, 0.5)) * (between ? 0.4 : 1.0);
  }
  return color;
}

Vector3d Outfit::ShirtColor(const Vector3d& p) const {
  const double weave = 1 + 0.10 * ValueNoise(p * 90, noise_seed_ + 11) +
                       0.12 * ValueNoise(p * 22, noise_seed_ + 12);
  bool second = false;
  const bool low = p.y() < rest_[kLShoulder].y() - 0.08 * shape_.stature;
  const double arms = low ? -1 : std::abs(p.x()) - rest_[kLShoulder].x();
  // Along the sleeve stripes run round the arm.
  const double along = arms > 0 ? arms : rest_[kNeck].y() - p.y();
  const auto band = [&](double x) {
    return x / stripe_width_ - std::floor(x / stripe_width_) < 0.45;
  };
  if (pattern_ == 1) second = band(along);
  if (pattern_ == 2) second = band(along) != band(p.x() + p.z() + 3.0);
  if (pattern_ == 0) {
    const double y = p.y() - (rest_[kNeck].y() - 0.12 * shape_.stature);
    const double r = std::hypot(p.x(), y) / (0.05 * shape_.stature);
    second = p.z() > 0 && r < 1 &&
             (r > 0.82 || std::abs(p.x()) < 0.008 || (y > 0 && y < 0.015));
    second = second || (arms > 0 && sleeve_x_ - std::abs(p.x()) < 0.02);
  }
  return weave * (second ? shirt_second_ : shirt_);
}

Vector3d Outfit::Color(const Vector3d& p) const {
  switch (MaterialAt(p)) {
    case kShirt:
      return ShirtColor(p);
    case kTrousers: {
      const double fade = 1 + 0.25 * ValueNoise(p * 8, noise_seed_ + 13) +
                          0.15 * ValueNoise(p * 100, noise_seed_ + 14);
      const double seam =
          std::abs(p.z()) < 0.003 || p.y() - trousers_y_ < 0.012 ? 0.6 : 1;
      return fade * seam * trousers_;
    }
    case kShoe: {
      const double sole = p.y() < 0.014 ? 1.0 : 0.0;
      const double shade = 1 + 0.1 * ValueNoise(p * 70, noise_seed_ + 15);
      return shade * ((1 - sole) * shoe_ + sole * Vector3d(0.5, 0.5, 0.48));
    }
    case kHair: {
      const Vector3d strands(160, 18, 160);
      return hair_ *
             (1 + 0.45 * ValueNoise(p.cwiseProduct(strands), noise_seed_ + 16));
    }
    case kSkin:
      break;
  }
  return SkinColor(p);
}

}  // namespace sweepfit
