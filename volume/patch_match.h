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
  // A patch's slope of lightness is texture and shading; as a pattern, shading
  // agrees nearly anywhere.
  bool with_slope = true;
  // How much the likelihood of equal lightness counts beside that of equal
  // patterns, and how much where only two views see a patch.
  double lightness = 0;
  double lightness_two_views = 0;
};

// A point of a surface and the views that see it, most frontal first.
struct SeenPoint {
  Eigen::Vector3d point_in_world;
  Eigen::Vector3d unit_normal;
  std::vector<int> views;
};

// How the lightness of one place differs between the views.
struct LightnessAgreement {
  Eigen::VectorXd log_gain;  // per view: to be added to its log lightness
  double sigma = 0;          // of the difference that is left between two views
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

  // How well the views agree on the lightness of a surface that is nearly the
  // true one: what is matt looks equally light from everywhere, but for the
  // exposures. A surface that is still off, gloss and changing light widen it.
  LightnessAgreement MeasureLightness(
      const std::vector<SeenPoint>& points) const;

  // Log likelihood ratio, "the views show the same patch here" against "they
  // show unrelated patches", for the patches at point - depth * normal. From
  // the correlations r of all pairs of views, shrunk by the noise, and the
  // differences d of their log lightness,
  //   (m - 1) / pairs * sum_pairs  -taps / 2 * ln(1 - max(r, 0)^2)
  //       + options.lightness * ln(p(d | same) / p(d | unrelated)),
  // at least 0; without `agreement` (null) by patterns alone. kUnseen where
  // fewer than two views see the whole patch.
  std::vector<float> Evidence(const SeenPoint& seen,
                              const std::vector<double>& depths,
                              const LightnessAgreement* agreement) const;

 private:
  struct Picture {
    Camera camera;        // without distortion
    cv::Rect box;         // around the person
    cv::Mat1f lightness;  // CIELAB L there, lightly smoothed
    double noise = 0;     // its standard deviation
    cv::Mat1f signed_distance;
    Eigen::Vector3d center_in_world;
  };

  // What a view shows of a patch.
  struct Patch {
    Eigen::ArrayXf values;     // of unit length, times the roots of the weights
    double log_lightness = 0;  // of its mean
  };
  bool SamplePatch(const Picture& picture,
                   const Eigen::Vector3d& center_in_world,
                   const Eigen::Vector3d& step_a,
                   const Eigen::Vector3d& step_b,
                   Patch* patch) const;

  PatchOptions options_;
  std::vector<Picture> pictures_;
  // Places along the two directions of a patch, and weights: sum 1.
  Eigen::ArrayXf tap_a_, tap_b_, tap_weight_, root_weight_;
  float tap_spread_ = 0;  // variance along one direction
};

}  // namespace sweepfit
