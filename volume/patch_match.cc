// SPDX-License-Identifier: Apache-2.0
#include "volume/patch_match.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Smoothing before matching, pixels, and the share of the standard deviation of
// white noise that it leaves.
constexpr double kSmoothing = 0.6;
constexpr double kNoiseLeft = 0.5;
// Rounding to 8 bit alone makes this much noise, CIELAB L.
constexpr double kLeastNoise = 0.15;

cv::Mat1f Lightness(const cv::Mat3b& image) {
  cv::Mat3f bgr;
  image.convertTo(bgr, CV_32F, 1.0 / 255);
  cv::Mat3f lab;
  cv::cvtColor(bgr, lab, cv::COLOR_BGR2Lab);
  cv::Mat1f lightness;
  cv::extractChannel(lab, lightness, 0);
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
  const auto middle =
      response.begin() + static_cast<std::ptrdiff_t>(response.size() / 2);
  std::nth_element(response.begin(), middle, response.end());
  constexpr double kGain = 6;              // root of the sum of squared taps
  constexpr double kMedianOfAbs = 0.6745;  // of a standard normal variable
  return *middle / (kGain * kMedianOfAbs);
}

// Over pinhole pixels.
cv::Mat1f Straighten(const View& view, const cv::Mat1f& lightness) {
  if (!view.camera.HasDistortion()) return lightness;
  cv::Mat2f map(view.camera.height, view.camera.width);
  for (int v = 0; v < map.rows; ++v) {
    for (int u = 0; u < map.cols; ++u) {
      const Vector2d pixel = view.camera.Distort({u, v});
      map(v, u) = cv::Vec2f(static_cast<float>(pixel.x()),
                            static_cast<float>(pixel.y()));
    }
  }
  cv::Mat1f straight;
  cv::remap(lightness,
            straight,
            map,
            cv::noArray(),
            cv::INTER_CUBIC,
            cv::BORDER_REPLICATE);
  return straight;
}

}  // namespace

double PixelSize(const std::vector<View>& views,
                 const Vector3d& place_in_world) {
  std::vector<double> sizes;
  for (const View& view : views) {
    sizes.push_back((view.camera.CenterInWorld() - place_in_world).norm() /
                    view.camera.FocalLength());
  }
  const auto middle =
      sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle;
}

PatchMatcher::PatchMatcher(const std::vector<View>& views,
                           const PatchOptions& options)
    : options_(options), pictures_(views.size()) {
  tbb::parallel_for(size_t{0}, views.size(), [&](size_t i) {
    Picture& picture = pictures_[i];
    picture.camera = views[i].camera;
    picture.camera.distortion = {};
    cv::Mat1f lightness = Lightness(views[i].image);
    picture.noise = std::max(
        kLeastNoise, kNoiseLeft * MeasureNoise(lightness, views[i].coverage));
    cv::GaussianBlur(lightness, lightness, {}, kSmoothing);
    picture.lightness = Straighten(views[i], lightness);
    picture.signed_distance = views[i].signed_distance;
    picture.center_in_world = views[i].camera.CenterInWorld();
  });
  const double half = 0.5 * (options.side - 1);
  const double sigma = 0.6 * half;
  double sum = 0;
  for (int a = 0; a < options.side; ++a) {
    for (int b = 0; b < options.side; ++b) {
      const double r2 = (a - half) * (a - half) + (b - half) * (b - half);
      tap_weight_.push_back(
          static_cast<float>(std::exp(-0.5 * r2 / (sigma * sigma))));
      sum += tap_weight_.back();
    }
  }
  for (float& weight : tap_weight_) weight /= static_cast<float>(sum);
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
                               std::vector<float>* patch) const {
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
  if (!(pixel.x() - reach.x() >= 0 && pixel.y() - reach.y() >= 0 &&
        pixel.x() + reach.x() < image.cols - 1 &&
        pixel.y() + reach.y() < image.rows - 1)) {
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
  patch->resize(tap_weight_.size());
  float mean = 0;
  int t = 0;
  for (int a = -half; a <= half; ++a) {
    for (int b = -half; b <= half; ++b, ++t) {
      const auto x = static_cast<float>(pixel.x() + a * pa.x() + b * pb.x());
      const auto y = static_cast<float>(pixel.y() + a * pa.y() + b * pb.y());
      const int x0 = static_cast<int>(x);
      const int y0 = static_cast<int>(y);
      const float fx = x - static_cast<float>(x0);
      const float fy = y - static_cast<float>(y0);
      const float* top = image[y0] + x0;
      const float* bottom = image[y0 + 1] + x0;
      const float upper = top[0] + fx * (top[1] - top[0]);
      const float lower = bottom[0] + fx * (bottom[1] - bottom[0]);
      const float value = upper + fy * (lower - upper);
      (*patch)[t] = value;
      mean += tap_weight_[t] * value;
    }
  }
  float variance = 0;
  for (size_t i = 0; i < patch->size(); ++i) {
    float& value = (*patch)[i];
    value -= mean;
    variance += tap_weight_[i] * value * value;
  }
  const auto scale = static_cast<float>(
      1 / std::sqrt(variance + picture.noise * picture.noise));
  for (size_t i = 0; i < patch->size(); ++i) {
    (*patch)[i] *= scale * std::sqrt(tap_weight_[i]);
  }
  return true;
}

std::vector<float> PatchMatcher::Evidence(
    const std::vector<int>& views,
    const Vector3d& point_in_world,
    const Vector3d& unit_normal,
    const std::vector<double>& depths) const {
  std::vector<float> evidence(depths.size(), 0.f);
  if (views.size() < 2) return evidence;
  const Vector3d step_a = options_.spacing * unit_normal.unitOrthogonal();
  const Vector3d step_b = unit_normal.cross(step_a);
  std::vector<std::vector<float>> patches(views.size());
  for (size_t k = 0; k < depths.size(); ++k) {
    const Vector3d center = point_in_world - depths[k] * unit_normal;
    size_t count = 0;
    for (const int view : views) {
      if (SamplePatch(
              pictures_[view], center, step_a, step_b, &patches[count])) {
        ++count;
      }
    }
    if (count < 2) continue;
    double sum = 0;
    int pairs = 0;
    for (size_t i = 0; i < count; ++i) {
      for (size_t j = i + 1; j < count; ++j) {
        float r = 0;
        for (size_t t = 0; t < tap_weight_.size(); ++t) {
          r += patches[i][t] * patches[j][t];
        }
        r = std::clamp(r, 0.f, 0.99f);
        sum -= 0.5 * options_.effective_taps * std::log(1 - r * r);
        ++pairs;
      }
    }
    evidence[k] =
        static_cast<float>(static_cast<double>(count - 1) / pairs * sum);
  }
  return evidence;
}

}  // namespace sweepfit
