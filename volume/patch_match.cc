// SPDX-License-Identifier: Apache-2.0
#include "volume/patch_match.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "capture/colour.h"
#include "capture/exposure.h"
#include "model/median.h"

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Smoothing before matching, pixels, and the share of the standard deviation of
// white noise that it and bilinear sampling between pixels leave.
constexpr double kSmoothing = 0.6;
constexpr double kNoiseLeft = 0.4;
// Rounding to 8 bit alone leaves this much noise, CIELAB L.
constexpr double kLeastNoise = 0.05;

constexpr double kMedianOfAbs = 0.6745;  // of a standard normal variable

// Log lightness: the exposures of cameras differ by less than the prior, and
// places whose difference is beyond the threshold are not seen as they are.
constexpr double kGainPrior = 0.3;
constexpr double kGainHuber = 0.03;
// The difference between two views of one place has this share of the spread
// about a surface that is not the true one yet, and is at least so much.
constexpr double kSpreadShare = 0.6;
constexpr double kLeastSpread = 0.008;
// Of unrelated places, and how often gloss and shadows make one place look so.
constexpr double kUnrelatedSpread = 0.25;
constexpr double kUnrelatedShare = 0.1;
// Every so many points are enough to measure it.
constexpr size_t kMeasureStride = 3;

// p(difference | same place) / p(difference | unrelated places), both normal,
// the first with a share of outliers.
class LightnessRatio {
 public:
  explicit LightnessRatio(double sigma)
      : peak_((1 - kUnrelatedShare) * kUnrelatedSpread / sigma),
        precision_(0.5 / (sigma * sigma) -
                   0.5 / (kUnrelatedSpread * kUnrelatedSpread)) {}

  double operator()(double difference) const {
    return kUnrelatedShare +
           peak_ * std::exp(-precision_ * difference * difference);
  }

 private:
  double peak_, precision_;
};

// CIELAB L of a part of the picture.
cv::Mat1f Lightness(const cv::Mat3b& image, const cv::Rect& part) {
  cv::Mat1f lightness;
  cv::extractChannel(PictureToLab(image(part)), lightness, 0);
  return lightness;
}

// Standard deviation of the noise on the person: median response to a kernel
// that planes and straight edges along the axes do not excite (Immerkaer 1996).
double MeasureNoise(const cv::Mat1f& lightness, const cv::Mat1f& coverage) {
  std::vector<float> response;
  for (int v = 1; v + 1 < lightness.rows; v += 2) {
    const float* a = lightness[v - 1];
    const float* b = lightness[v];
    const float* c = lightness[v + 1];
    for (int u = 1; u + 1 < lightness.cols; u += 2) {
      if (coverage(v, u) < 0.99f) continue;
      response.push_back(std::abs(a[u - 1] - 2 * a[u] + a[u + 1] -
                                  2 * b[u - 1] + 4 * b[u] - 2 * b[u + 1] +
                                  c[u - 1] - 2 * c[u] + c[u + 1]));
    }
  }
  if (response.empty()) return kLeastNoise;
  constexpr double kGain = 6;  // root of the sum of squared taps
  return MedianInPlace(&response) / (kGain * kMedianOfAbs);
}

// Where the pixels of a box of pinhole pixels lie in the picture as taken.
cv::Mat2f DistortBox(const Camera& camera, const cv::Rect& box) {
  cv::Mat2f map(box.size());
  for (int v = 0; v < map.rows; ++v) {
    for (int u = 0; u < map.cols; ++u) {
      const Vector2d pixel = camera.Distort({box.x + u, box.y + v});
      map(v, u) = cv::Vec2f(static_cast<float>(pixel.x()),
                            static_cast<float>(pixel.y()));
    }
  }
  return map;
}

}  // namespace

double PixelSize(const std::vector<View>& views,
                 const Vector3d& place_in_world) {
  std::vector<double> sizes;
  for (const View& view : views) {
    sizes.push_back((view.camera.CenterInWorld() - place_in_world).norm() /
                    view.camera.FocalLength());
  }
  return MedianInPlace(&sizes);
}

PatchMatcher::PatchMatcher(const std::vector<View>& views,
                           const PatchOptions& options)
    : options_(options), pictures_(views.size()) {
  tbb::parallel_for(size_t{0}, views.size(), [&](size_t i) {
    const View& view = views[i];
    Picture& picture = pictures_[i];
    picture.camera = view.camera;
    picture.camera.distortion = {};
    picture.center_in_world = view.camera.CenterInWorld();
    picture.signed_distance = view.signed_distance;
    // In pinhole pixels, with room for patches.
    picture.box = BoxAround(view.signed_distance < 0, 2 * options.side);
    if (picture.box.empty()) return;
    // The part of the picture as taken that is seen there.
    cv::Mat2f map;
    cv::Rect part = picture.box;
    if (view.camera.HasDistortion()) {
      map = DistortBox(view.camera, picture.box);
      std::vector<cv::Mat1f> axes;
      cv::split(map, axes);
      double low[2], high[2];
      for (int axis = 0; axis < 2; ++axis) {
        cv::minMaxLoc(axes[axis], &low[axis], &high[axis]);
      }
      constexpr double kMargin = 4;
      part = cv::Rect(cv::Point(static_cast<int>(low[0] - kMargin),
                                static_cast<int>(low[1] - kMargin)),
                      cv::Point(static_cast<int>(high[0] + kMargin),
                                static_cast<int>(high[1] + kMargin))) &
             cv::Rect({0, 0}, view.image.size());
      if (part.empty()) {
        picture.box = {};
        return;
      }
    }
    picture.lightness = Lightness(view.image, part);
    picture.noise = std::max(
        kLeastNoise,
        kNoiseLeft * MeasureNoise(picture.lightness, view.coverage(part)));
    cv::GaussianBlur(picture.lightness, picture.lightness, {}, kSmoothing);
    if (!map.empty()) {
      map -= cv::Scalar(part.x, part.y);
      cv::Mat1f straight;
      cv::remap(picture.lightness,
                straight,
                map,
                cv::noArray(),
                cv::INTER_CUBIC,
                cv::BORDER_REPLICATE);
      picture.lightness = straight;
    }
  });
  // Every other place of the square, as on a chess board: neighbouring pixels
  // say nearly the same.
  const int half = options.side / 2;
  const double sigma = 0.6 * half;
  std::vector<Eigen::Vector3f> taps;
  for (int a = -half; a <= half; ++a) {
    for (int b = -half; b <= half; ++b) {
      if ((a + b) % 2 != 0) continue;
      const double weight = std::exp(-0.5 * (a * a + b * b) / (sigma * sigma));
      taps.emplace_back(a, b, weight);
    }
  }
  const auto count = static_cast<Eigen::Index>(taps.size());
  tap_a_.resize(count);
  tap_b_.resize(count);
  tap_weight_.resize(count);
  for (Eigen::Index t = 0; t < count; ++t) {
    tap_a_[t] = taps[t].x();
    tap_b_[t] = taps[t].y();
    tap_weight_[t] = taps[t].z();
  }
  tap_weight_ /= tap_weight_.sum();
  root_weight_ = tap_weight_.sqrt();
  tap_spread_ = (tap_weight_ * tap_a_.square()).sum();
}

std::vector<int> PatchMatcher::VisibleViews(const RayScene& scene,
                                            const Vector3d& point_in_world,
                                            const Vector3d& unit_normal,
                                            double tolerance) const {
  std::vector<std::pair<double, int>> seen;
  for (size_t i = 0; i < pictures_.size(); ++i) {
    const Vector3d& center = pictures_[i].center_in_world;
    const double facing =
        unit_normal.dot((center - point_in_world).normalized());
    if (facing < options_.min_facing) continue;
    if (!scene.IsVisible(point_in_world, center, tolerance)) continue;
    seen.emplace_back(-facing, static_cast<int>(i));
  }
  std::sort(seen.begin(), seen.end());
  std::vector<int> views;
  for (const auto& [facing, view] : seen) {
    if (static_cast<int>(views.size()) == options_.max_views) break;
    views.push_back(view);
  }
  return views;
}

bool PatchMatcher::SamplePatch(const Picture& picture,
                               const Vector3d& center_in_world,
                               const Vector3d& step_a,
                               const Vector3d& step_b,
                               Patch* patch) const {
  const Camera& camera = picture.camera;
  const Vector3d in_camera = camera.PointInCamera(center_in_world);
  if (!(in_camera.z() > 1e-3)) return false;
  const Vector3d p = camera.K * in_camera;
  const Vector2d pixel = p.hnormalized();
  // The patch is small: its image is affine.
  const Vector3d da = camera.K * (camera.camera_from_world * step_a);
  const Vector3d db = camera.K * (camera.camera_from_world * step_b);
  const Vector2d pa = (da.head<2>() - pixel * da.z()) / p.z();
  const Vector2d pb = (db.head<2>() - pixel * db.z()) / p.z();
  const int half = options_.side / 2;
  const Vector2d reach = half * (pa.cwiseAbs() + pb.cwiseAbs());
  const cv::Mat1f& image = picture.lightness;
  const Vector2d in_box = pixel - Vector2d(picture.box.x, picture.box.y);
  if (!(in_box.x() - reach.x() >= 0 && in_box.y() - reach.y() >= 0 &&
        in_box.x() + reach.x() < image.cols - 1 &&
        in_box.y() + reach.y() < image.rows - 1)) {
    return false;
  }
  // The edge of a silhouette is not texture: it lies elsewhere for every view.
  constexpr double kMargin = -0.5;  // pixels
  for (const Vector2d& to_side : {pa, pb}) {
    for (const int sign : {-half, half}) {
      const Vector2d side = pixel + sign * to_side;
      if (SampleBilinear(picture.signed_distance, side).value > kMargin) {
        return false;
      }
    }
  }
  const Eigen::Vector2f at = in_box.cast<float>();
  const Eigen::Vector2f to_a = pa.cast<float>(), to_b = pb.cast<float>();
  Eigen::ArrayXf& values = patch->values;
  values.resize(tap_weight_.size());
  const auto stride = static_cast<std::ptrdiff_t>(image.step1());
  const float* pixels = image[0];
  for (Eigen::Index t = 0; t < values.size(); ++t) {
    const float x = at.x() + tap_a_[t] * to_a.x() + tap_b_[t] * to_b.x();
    const float y = at.y() + tap_a_[t] * to_a.y() + tap_b_[t] * to_b.y();
    const int x0 = static_cast<int>(x);
    const int y0 = static_cast<int>(y);
    const float fx = x - static_cast<float>(x0);
    const float fy = y - static_cast<float>(y0);
    const float* top = pixels + y0 * stride + x0;
    const float* bottom = top + stride;
    const float upper = top[0] + fx * (top[1] - top[0]);
    const float lower = bottom[0] + fx * (bottom[1] - bottom[0]);
    values[t] = upper + fy * (lower - upper);
  }
  const float mean = (tap_weight_ * values).sum();
  patch->log_lightness = LogLightness(mean);
  values -= mean;
  if (!options_.with_slope) {
    // The taps are symmetric: the two slopes do not depend on each other.
    const float slope_a = (tap_weight_ * tap_a_ * values).sum() / tap_spread_;
    const float slope_b = (tap_weight_ * tap_b_ * values).sum() / tap_spread_;
    values -= slope_a * tap_a_ + slope_b * tap_b_;
  }
  const double variance = (tap_weight_ * values.square()).sum();
  values *= root_weight_ *
            static_cast<float>(
                1 / std::sqrt(variance + picture.noise * picture.noise));
  return true;
}

LightnessAgreement PatchMatcher::MeasureLightness(
    const std::vector<SeenPoint>& points) const {
  const int num_views = static_cast<int>(pictures_.size());
  std::vector<std::vector<LogBrightness>> places(
      (points.size() + kMeasureStride - 1) / kMeasureStride);
  tbb::parallel_for(size_t{0}, places.size(), [&](size_t k) {
    const auto& [point, normal, views] = points[kMeasureStride * k];
    const Vector3d step_a = options_.spacing * normal.unitOrthogonal();
    const Vector3d step_b = normal.cross(step_a);
    Patch patch;
    for (const int view : views) {
      if (SamplePatch(pictures_[view], point, step_a, step_b, &patch)) {
        places[k].push_back({view, patch.log_lightness});
      }
    }
  });
  LightnessAgreement agreement;
  agreement.log_gain = SolveLogGains(places, num_views, kGainHuber, kGainPrior);
  std::vector<double> differences;
  for (std::vector<LogBrightness>& place : places) {
    for (LogBrightness& seen : place) {
      seen.value += agreement.log_gain[seen.view];
    }
    for (size_t i = 0; i < place.size(); ++i) {
      for (size_t j = i + 1; j < place.size(); ++j) {
        differences.push_back(std::abs(place[i].value - place[j].value));
      }
    }
  }
  agreement.sigma = kLeastSpread;
  if (!differences.empty()) {
    agreement.sigma =
        std::clamp(kSpreadShare * MedianInPlace(&differences) / kMedianOfAbs,
                   kLeastSpread,
                   0.9 * kUnrelatedSpread);
  }
  return agreement;
}

std::vector<float> PatchMatcher::Evidence(
    const SeenPoint& seen,
    const std::vector<double>& depths,
    const LightnessAgreement* agreement) const {
  const auto& [point, normal, views] = seen;
  std::vector<float> evidence(depths.size(), kUnseen);
  if (views.size() < 2) return evidence;
  const Vector3d step_a = options_.spacing * normal.unitOrthogonal();
  const Vector3d step_b = normal.cross(step_a);
  const double lightness = agreement == nullptr ? 0
                           : views.size() > 2   ? options_.lightness
                                                : options_.lightness_two_views;
  const LightnessRatio ratio(lightness > 0 ? agreement->sigma : 1);
  std::vector<Patch> patches(views.size());
  for (size_t k = 0; k < depths.size(); ++k) {
    const Vector3d center = point - depths[k] * normal;
    size_t count = 0;
    for (const int view : views) {
      Patch& patch = patches[count];
      if (!SamplePatch(pictures_[view], center, step_a, step_b, &patch)) {
        continue;
      }
      if (lightness > 0) patch.log_lightness += agreement->log_gain[view];
      ++count;
    }
    if (count < 2) continue;
    double sum = 0, ratios = 1;
    int pairs = 0;
    for (size_t i = 0; i < count; ++i) {
      for (size_t j = i + 1; j < count; ++j) {
        const float r = std::clamp(
            (patches[i].values * patches[j].values).sum(), 0.f, 0.99f);
        sum -= 0.5 * options_.effective_taps * std::log(1 - r * r);
        if (lightness > 0) {
          ratios *= ratio(patches[i].log_lightness - patches[j].log_lightness);
        }
        ++pairs;
      }
    }
    sum += lightness * std::log(ratios);
    evidence[k] = static_cast<float>(
        std::max(0.0, static_cast<double>(count - 1) / pairs * sum));
  }
  return evidence;
}

}  // namespace sweepfit
