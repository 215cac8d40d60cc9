// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "capture/render.h"
#include "capture/silhouette.h"

namespace sweepfit {

struct PatchOptions {
  int side = 9;               // taps along a patch, odd
  double spacing = 0.002;     // between taps, metres
  double min_facing = 0.35;   // cosine to the normal
  int max_views = 6;          // the most frontal ones
  double effective_taps = 8;  // as many are independent of each other
  // How far a patch's slope of lightness counts, 0 to 1. It is texture and
  // shading; shading agrees nearly anywhere. Where only two views see a patch
  // it is missed more.
  double slope = 1;
  double slope_two_views = 1;
};

// Instead of evidence: the pictures cannot say. Evidence itself is >= 0.
inline constexpr float kUnseen = -1;

// What a pixel is wide at a place, metres: median of the views.
double PixelSize(const std::vector<View>& views,
                 const Eigen::Vector3d& place_in_world);

// How well the pictures agree that a surface patch lies at a place.
class PatchMatcher {
 public:
  PatchMatcher(const std::vector<View>& views, const PatchOptions& options);

  const PatchOptions& options() const { return options_; }

  // Views that see a point of the scene's surface, most frontal first.
  std::vector<int> VisibleViews(const RayScene& scene,
                                const Eigen::Vector3d& point_in_world,
                                const Eigen::Vector3d& unit_normal,
                                double tolerance) const;

  // Log likelihood ratio, "the views show the same patch here" against "they
  // show unrelated patches", for the patches at point - depth * normal. From
  // the correlations r of all pairs of views, shrunk by the noise,
  //   (m - 1) / pairs * sum_pairs  -taps / 2 * ln(1 - max(r, 0)^2).
  // kUnseen where fewer than two views see the whole patch.
  std::vector<float> Evidence(const std::vector<int>& views,
                              const Eigen::Vector3d& point_in_world,
                              const Eigen::Vector3d& unit_normal,
                              const std::vector<double>& depths) const;

 private:
  struct Picture {
    Camera camera;        // without distortion
    cv::Rect box;         // around the person
    cv::Mat1f lightness;  // CIELAB L there, lightly smoothed
    double noise = 0;     // its standard deviation
    cv::Mat1f signed_distance;
    Eigen::Vector3d center_in_world;
  };

  bool SamplePatch(const Picture& picture,
                   const Eigen::Vector3d& center_in_world,
                   const Eigen::Vector3d& step_a,
                   const Eigen::Vector3d& step_b,
                   double slope,
                   Eigen::ArrayXf* patch) const;

  PatchOptions options_;
  std::vector<Picture> pictures_;
  // Places along the two directions of a patch, and weights: sum 1.
  Eigen::ArrayXf tap_a_, tap_b_, tap_weight_, root_weight_;
  float tap_spread_ = 0;  // variance along one direction
};

}  // namespace sweepfit
