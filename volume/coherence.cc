// SPDX-License-Identifier: Apache-2.0
#include "volume/coherence.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <set>

#include "model/median.h"
#include "model/rigid_motion.h"
#include "volume/silhouette_cones.h"

namespace sweepfit {
namespace {

// Points looked at, of all outlines together and of each.
constexpr size_t kRays = 1600;
constexpr size_t kMinRaysPerView = 60;
constexpr size_t kMaxRaysPerView = 160;
// Steps along a ray, pixels.
constexpr double kStep = 0.7;
// Samples of a ray that lie further outside two or more silhouettes do not
// matter, whichever camera is left out or turned.
constexpr double kReach = 40;
constexpr double kNone = -1e9;  // a camera that does not see the point

// A view's silhouette as a function of points in the world.
class Cone {
 public:
  Cone(const View& view, const Eigen::Matrix3d& turn)
      : pixel_from_world_(view.camera.K * turn * view.camera.camera_from_world),
        world_in_pixel_(view.camera.K * turn * view.camera.world_in_camera),
        distance_(&view.signed_distance) {}

  // Signed distance to the silhouette in pixels, kNone outside the frame.
  double At(const Eigen::Vector3d& point_in_world) const {
    const Eigen::Vector3d p =
        pixel_from_world_ * point_in_world + world_in_pixel_;
    if (!(p.z() > 0)) return kNone;
    const double u = p.x() / p.z();
    const double v = p.y() / p.z();
    if (!(u >= 0 && v >= 0 && u < distance_->cols - 1 &&
          v < distance_->rows - 1)) {
      return kNone;
    }
    const int u0 = static_cast<int>(u);
    const int v0 = static_cast<int>(v);
    const double fu = u - u0, fv = v - v0;
    const float* top = (*distance_)[v0] + u0;
    const float* bottom = (*distance_)[v0 + 1] + u0;
    const double a = top[0] + fu * (top[1] - top[0]);
    const double b = bottom[0] + fu * (bottom[1] - bottom[0]);
    return a + fv * (b - a);
  }

 private:
  Eigen::Matrix3d pixel_from_world_;
  Eigen::Vector3d world_in_pixel_;
  const cv::Mat1f* distance_;
};

// A point of a ray with the largest distance to the other silhouettes, whose it
// is, and the largest of the rest.
struct Sample {
  Eigen::Vector3d point_in_world;
  float first = 0, second = 0;
  int first_view = -1;
};

struct Ray {
  Eigen::Vector2d pixel;  // on the outline, pinhole pixels
  std::vector<Sample> samples;
};

// One pose: its views and what their rays meet.
struct Scene {
  const std::vector<View>* views = nullptr;
  std::vector<int> camera;  // of each view: position in the result
  std::vector<Cone> cones;
  std::vector<std::vector<Ray>> rays;  // per view
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double radius = 0;  // about the middle, of what the cameras see
};

// Points of the outline, evenly, not where the picture's frame cuts the person.
std::vector<Eigen::Vector2d> OutlinePoints(const View& view, size_t most) {
  const cv::Mat1f& distance = view.signed_distance;
  constexpr int kFrame = 3;
  std::vector<Eigen::Vector2d> points;
  for (int v = kFrame; v < distance.rows - kFrame; ++v) {
    for (int u = kFrame; u < distance.cols - kFrame; ++u) {
      const float d = distance(v, u);
      if (std::abs(d) > 0.5f) continue;
      const Eigen::Vector2d gradient(
          0.5 * (distance(v, u + 1) - distance(v, u - 1)),
          0.5 * (distance(v + 1, u) - distance(v - 1, u)));
      const double squared = gradient.squaredNorm();
      if (squared < 0.25) continue;
      points.push_back(Eigen::Vector2d(u, v) - d / squared * gradient);
    }
  }
  std::vector<Eigen::Vector2d> chosen;
  const size_t count = std::min(points.size(), most);
  for (size_t i = 0; i < count; ++i) {
    chosen.push_back(points[i * points.size() / count]);
  }
  return chosen;
}

// Half the size of the person as the view shows it at the depth of a point.
double HalfExtent(const View& view, const Eigen::Vector3d& point_in_world) {
  const std::vector<Eigen::Vector2d> outline =
      OutlinePoints(view, kMaxRaysPerView);
  if (outline.empty()) return 0;
  Eigen::Vector2d low = outline.front(), high = outline.front();
  for (const Eigen::Vector2d& p : outline) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const double depth = view.camera.PointInCamera(point_in_world).z();
  return 0.5 * (high - low).norm() * depth / view.camera.FocalLength();
}

// Walks along the ray of `pixel` of view i, turned with the camera; the best
// sample first. `until_held`: stops at a point that all others hold.
std::vector<Sample> March(const Scene& scene,
                          size_t i,
                          const Eigen::Vector2d& pixel,
                          const Eigen::Matrix3d& turn,
                          bool until_held) {
  const Camera& camera = (*scene.views)[i].camera;
  const Eigen::Vector3d origin = camera.CenterInWorld();
  const Eigen::Vector3d direction =
      camera.camera_from_world.transpose() * turn.transpose() *
      (camera.camera_from_world * camera.RayInWorld(pixel));
  const double nearest = direction.dot(scene.middle - origin);
  double at = std::max(0.1, nearest - scene.radius);
  const double end = nearest + scene.radius;
  std::vector<Sample> samples;
  while (at < end) {
    Sample sample;
    sample.point_in_world = origin + at * direction;
    double first = kNone, second = kNone;
    for (size_t j = 0; j < scene.cones.size(); ++j) {
      if (j == i) continue;
      const double d = scene.cones[j].At(sample.point_in_world);
      if (d > first) {
        second = first;
        first = d;
        sample.first_view = static_cast<int>(j);
      } else if (d > second) {
        second = d;
      }
    }
    // A point that only one other camera sees says nothing.
    const double metres_per_pixel = at / camera.FocalLength();
    const double outside = until_held ? first : second;
    double step = kStep;
    if (outside > kReach) {
      step += 0.7 * (outside - kReach);
    } else if (second > kNone) {
      sample.first = static_cast<float>(first);
      sample.second = static_cast<float>(second);
      samples.push_back(sample);
      if (until_held && first <= 0) break;
    }
    at += step * metres_per_pixel;
  }
  std::stable_sort(
      samples.begin(), samples.end(), [](const Sample& a, const Sample& b) {
        return a.first < b.first;
      });
  return samples;
}

// How far the ray is outside all others but the view `without`.
double Miss(const std::vector<Sample>& samples, int without, double most) {
  double least = most;
  for (const Sample& sample : samples) {
    const double d =
        sample.first_view == without ? sample.second : sample.first;
    least = std::min(least, d);
    if (least <= 0) break;
  }
  return std::max(0.0, least);
}

Scene MakeScene(const std::vector<View>& views,
                const std::vector<int>& camera,
                size_t rays_per_view) {
  Scene scene;
  scene.views = &views;
  scene.camera = camera;
  scene.middle = MeetingPoint(MakeSilhouetteCones(views));
  std::vector<double> extents;
  for (const View& view : views) {
    scene.cones.emplace_back(view, Eigen::Matrix3d::Identity());
    extents.push_back(HalfExtent(view, scene.middle));
  }
  constexpr double kMargin = 1.4;
  scene.radius = kMargin * MedianInPlace(&extents);
  scene.rays.resize(views.size());
  tbb::parallel_for(size_t{0}, views.size(), [&](size_t i) {
    for (const Eigen::Vector2d& pixel :
         OutlinePoints(views[i], rays_per_view)) {
      scene.rays[i].push_back(
          {pixel, March(scene, i, pixel, Eigen::Matrix3d::Identity(), false)});
    }
  });
  return scene;
}

int ViewOf(const Scene& scene, int camera) {
  for (size_t i = 0; i < scene.camera.size(); ++i) {
    if (scene.camera[i] == camera) return static_cast<int>(i);
  }
  return -1;
}

// All misses in which the camera takes part, when it is turned: of its own
// outlines, and of the others' with its cone turned.
std::vector<double> MissesTurned(const std::vector<Scene>& scenes,
                                 int camera,
                                 const Eigen::Vector3d& turn) {
  const Eigen::Matrix3d rotation = RotationOf(turn);
  std::vector<double> misses;
  for (const Scene& scene : scenes) {
    const int k = ViewOf(scene, camera);
    if (k < 0) continue;
    const Cone cone((*scene.views)[k], rotation);
    for (size_t i = 0; i < scene.rays.size(); ++i) {
      for (const Ray& ray : scene.rays[i]) {
        if (static_cast<int>(i) == k) {
          misses.push_back(
              Miss(March(scene, i, ray.pixel, rotation, true), -1, kReach));
          continue;
        }
        double least = kReach;
        for (const Sample& sample : ray.samples) {
          const double rest =
              sample.first_view == k ? sample.second : sample.first;
          if (rest >= least) continue;
          least =
              std::min(least, std::max(rest, cone.At(sample.point_in_world)));
        }
        misses.push_back(std::max(0.0, least));
      }
    }
  }
  return misses;
}

// Huber's loss with its bend at one pixel, mean.
double Cost(const std::vector<double>& misses) {
  double sum = 0;
  for (const double m : misses) sum += m < 1 ? 0.5 * m * m : m - 0.5;
  return sum / static_cast<double>(std::max<size_t>(1, misses.size()));
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(std::max<size_t>(1, values.size()));
}

// Root mean square way of the camera's outlines under the turn.
double ShiftOf(const std::vector<Scene>& scenes,
               int camera,
               const Eigen::Vector3d& turn) {
  const Eigen::Matrix3d rotation = RotationOf(turn);
  double sum = 0;
  int count = 0;
  for (const Scene& scene : scenes) {
    const int k = ViewOf(scene, camera);
    if (k < 0) continue;
    const Eigen::Matrix3d& K = (*scene.views)[k].camera.K;
    const Eigen::Matrix3d homography = K * rotation * K.inverse();
    for (const Ray& ray : scene.rays[k]) {
      const Eigen::Vector2d moved =
          (homography * ray.pixel.homogeneous()).hnormalized();
      sum += (moved - ray.pixel).squaredNorm();
      ++count;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

// Levenberg-Marquardt with Huber's weights and numeric derivatives over the
// three angles.
void FindTurn(const std::vector<Scene>& scenes,
              int camera,
              double pixels_per_radian,
              CameraCoherence* result) {
  result->has_turn = true;
  constexpr int kMaxSteps = 15;
  constexpr double kEnough = 5e-3;  // a step that gains less is the last
  const double delta = 0.5 / pixels_per_radian;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  std::vector<double> misses = MissesTurned(scenes, camera, turn);
  result->miss_before = Mean(misses);
  double cost = Cost(misses);
  double damping = 1e-3;
  for (int step = 0; step < kMaxSteps; ++step) {
    std::array<std::vector<double>, 3> ahead, behind;
    for (int a = 0; a < 3; ++a) {
      ahead[a] =
          MissesTurned(scenes, camera, turn + delta * Eigen::Vector3d::Unit(a));
      behind[a] =
          MissesTurned(scenes, camera, turn - delta * Eigen::Vector3d::Unit(a));
    }
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (size_t r = 0; r < misses.size(); ++r) {
      Eigen::Vector3d row;
      for (int a = 0; a < 3; ++a) {
        row[a] = (ahead[a][r] - behind[a][r]) / (2 * delta);
      }
      const double weight = misses[r] > 1 ? 1 / misses[r] : 1;
      normal += weight * row * row.transpose();
      gradient += weight * misses[r] * row;
    }
    bool moved = false;
    for (int trial = 0; trial < 4 && !moved; ++trial) {
      Eigen::Matrix3d damped = normal;
      damped.diagonal() *= 1 + damping;
      damped.diagonal().array() += 1e-9 * normal.trace() + 1e-9;
      const Eigen::Vector3d candidate = turn - damped.ldlt().solve(gradient);
      std::vector<double> trial_misses =
          MissesTurned(scenes, camera, candidate);
      const double trial_cost = Cost(trial_misses);
      if (trial_cost < cost) {
        moved = cost - trial_cost > kEnough * cost;
        turn = candidate;
        misses = std::move(trial_misses);
        cost = trial_cost;
        damping = std::max(1e-6, 0.2 * damping);
        if (!moved) break;
      } else {
        damping *= 20;
      }
    }
    if (!moved) break;
  }
  result->turn = turn;
  result->miss_after = Mean(misses);
  result->shift = ShiftOf(scenes, camera, turn);
}

// What all measures are made of: the scenes and the cameras in them.
struct Setup {
  std::vector<Scene> scenes;
  std::vector<std::string> camera_ids;
  std::vector<double> focal_lengths;  // per camera
};

Setup MakeSetup(const std::vector<std::vector<View>>& poses) {
  Setup setup;
  size_t num_views = 0;
  for (const std::vector<View>& views : poses) num_views += views.size();
  const size_t rays_per_view = std::clamp(
      kRays / std::max<size_t>(1, num_views), kMinRaysPerView, kMaxRaysPerView);
  for (const std::vector<View>& views : poses) {
    std::vector<int> cameras;
    for (const View& view : views) {
      const auto it = std::find(
          setup.camera_ids.begin(), setup.camera_ids.end(), view.camera.id);
      cameras.push_back(static_cast<int>(it - setup.camera_ids.begin()));
      if (it == setup.camera_ids.end()) {
        setup.camera_ids.push_back(view.camera.id);
        setup.focal_lengths.push_back(view.camera.FocalLength());
      }
    }
    constexpr size_t kMinViews = 3;
    if (views.size() >= kMinViews) {
      setup.scenes.push_back(MakeScene(views, cameras, rays_per_view));
    }
  }
  return setup;
}

CameraCoherence Measure(const Setup& setup, int camera) {
  CameraCoherence result;
  result.camera_id = setup.camera_ids[camera];
  double own = 0;
  int num_own = 0;
  struct Sum {
    double with = 0, without = 0;
    int count = 0;
    double Harm() const { return with - without; }
  };
  std::vector<Sum> others(setup.camera_ids.size());
  for (const Scene& scene : setup.scenes) {
    const int k = ViewOf(scene, camera);
    for (size_t i = 0; i < scene.rays.size(); ++i) {
      Sum& sum = others[scene.camera[i]];
      for (const Ray& ray : scene.rays[i]) {
        const double with = Miss(ray.samples, -1, kMaxMiss);
        if (static_cast<int>(i) == k) {
          own += with;
          ++num_own;
        } else {
          sum.with += with;
          sum.without += k < 0 ? with : Miss(ray.samples, k, kMaxMiss);
          ++sum.count;
        }
      }
    }
  }
  result.miss = own / std::max(1, num_own);
  // One that suffers alone is wrong itself.
  const auto worst = std::max_element(
      others.begin(), others.end(), [](const Sum& a, const Sum& b) {
        return a.Harm() < b.Harm();
      });
  Sum total;
  for (auto it = others.begin(); it != others.end(); ++it) {
    if (it == worst) continue;
    total.with += it->with;
    total.without += it->without;
    total.count += it->count;
  }
  result.others_with = total.with / std::max(1, total.count);
  result.others_without = total.without / std::max(1, total.count);
  return result;
}

std::vector<CameraCoherence> MeasureAll(const Setup& setup) {
  std::vector<CameraCoherence> result(setup.camera_ids.size());
  tbb::parallel_for(size_t{0}, result.size(), [&](size_t c) {
    result[c] = Measure(setup, static_cast<int>(c));
  });
  return result;
}

// What the others' outlines suffer from the camera, pixels of one outline.
double Harm(const CameraCoherence& camera, size_t num_cameras) {
  return (camera.others_with - camera.others_without) *
         (static_cast<double>(num_cameras) - 2);
}

// A silhouette that cuts the others' outlines: they suffer by a pixel and more,
// and most of it goes when it is left out.
bool IsHarmful(const CameraCoherence& camera, size_t num_cameras) {
  return Harm(camera, num_cameras) > 1 &&
         camera.others_with > 2 * camera.others_without;
}

// A turn that explains what disagrees: not by chance, and worth a pixel. Sound
// cameras of rendered and real captures stay below 1.5 % (measured), a turn by
// 0.3 degrees about the optical axis gains 4.6 % and more.
bool IsTurned(const CameraCoherence& camera,
              size_t num_cameras,
              bool thorough) {
  constexpr double kMinShare = 0.04;  // of the miss that goes
  constexpr double kMinGain = 0.06;   // pixels of one outline
  const double gain = camera.miss_before - camera.miss_after;
  return camera.has_turn && gain > kMinShare * camera.miss_before &&
         gain * static_cast<double>(num_cameras) > kMinGain &&
         camera.shift > (thorough ? 0.7 : 3.0);
}

// After the turn the outlines are about as good as without the camera.
bool IsRepaired(const CameraCoherence& camera) {
  return camera.miss_after < 0.1 + 1.5 * camera.others_without;
}

// The camera whose calibration or whose silhouettes are worst, if any is.
std::optional<Incoherence> WorstCamera(const Setup& setup, bool thorough) {
  std::vector<CameraCoherence> cameras = MeasureAll(setup);
  const size_t count = cameras.size();
  // Turns take time; sound silhouettes miss by a tenth of a pixel or two.
  constexpr double kSuspicious = 0.4;
  const bool look =
      thorough ||
      std::any_of(
          cameras.begin(), cameras.end(), [&](const CameraCoherence& c) {
            return IsHarmful(c, count) || c.others_with > kSuspicious;
          });
  if (!look) return std::nullopt;
  tbb::parallel_for(size_t{0}, count, [&](size_t c) {
    FindTurn(
        setup.scenes, static_cast<int>(c), setup.focal_lengths[c], &cameras[c]);
  });
  const CameraCoherence* worst = nullptr;
  for (const CameraCoherence& camera : cameras) {
    if (!IsTurned(camera, count, thorough)) continue;
    if (worst == nullptr || camera.miss_before - camera.miss_after >
                                worst->miss_before - worst->miss_after) {
      worst = &camera;
    }
  }
  const CameraCoherence* most_harmful = nullptr;
  for (const CameraCoherence& camera : cameras) {
    if (!IsHarmful(camera, count)) continue;
    if (most_harmful == nullptr ||
        Harm(camera, count) > Harm(*most_harmful, count)) {
      most_harmful = &camera;
    }
  }
  if (worst != nullptr && (most_harmful == nullptr || IsRepaired(*worst))) {
    return Incoherence{Incoherence::Kind::kTurned, *worst, -1};
  }
  if (most_harmful != nullptr) {
    return Incoherence{Incoherence::Kind::kMoved, *most_harmful, -1};
  }
  return std::nullopt;
}

// Of a camera that is wrong as a whole: the poses whose silhouettes cut the
// others, when there are sound ones too.
std::vector<int> HarmfulPoses(const std::vector<std::vector<View>>& poses,
                              const std::string& camera_id) {
  std::vector<int> harmful;
  for (size_t p = 0; p < poses.size(); ++p) {
    const Setup setup = MakeSetup({poses[p]});
    if (setup.scenes.empty()) continue;
    for (const CameraCoherence& camera : MeasureAll(setup)) {
      if (camera.camera_id == camera_id &&
          IsHarmful(camera, setup.camera_ids.size())) {
        harmful.push_back(static_cast<int>(p));
      }
    }
  }
  return harmful;
}

bool RemoveView(const std::string& camera_id, std::vector<View>* views) {
  return std::erase_if(*views, [&](const View& view) {
           return view.camera.id == camera_id;
         }) > 0;
}

}  // namespace

std::optional<std::string> IncoherenceOptions::Check() const {
  if (mode != "repair" && mode != "warn" && mode != "off") {
    return "coherence.mode must be repair, warn or off, not '" + mode + "'";
  }
  return std::nullopt;
}

std::vector<CameraCoherence> MeasureCoherence(
    const std::vector<std::vector<View>>& poses) {
  return MeasureAll(MakeSetup(poses));
}

void MeasureTurn(const std::vector<std::vector<View>>& poses,
                 CameraCoherence* camera) {
  const Setup setup = MakeSetup(poses);
  const auto it = std::find(
      setup.camera_ids.begin(), setup.camera_ids.end(), camera->camera_id);
  if (it == setup.camera_ids.end()) return;
  const auto c = it - setup.camera_ids.begin();
  FindTurn(setup.scenes, static_cast<int>(c), setup.focal_lengths[c], camera);
}

std::vector<Incoherence> FindIncoherence(std::vector<std::vector<View>> poses,
                                         const IncoherenceOptions& options) {
  std::vector<Incoherence> found;
  Setup setup = MakeSetup(poses);
  // More than a third of the cameras cannot be told from the rest.
  const size_t most = setup.camera_ids.size() / 3;
  std::set<std::string> wrong;
  // One may be turned first and left out then.
  for (size_t round = 0; round < 2 * most && wrong.size() < most; ++round) {
    const auto worst = WorstCamera(setup, options.thorough);
    if (!worst) break;
    std::vector<Incoherence> findings = {*worst};
    if (worst->kind == Incoherence::Kind::kMoved) {
      findings.clear();
      const std::string& id = worst->camera.camera_id;
      for (const int p : HarmfulPoses(poses, id)) {
        findings.push_back({Incoherence::Kind::kHides, worst->camera, p});
      }
      // No pose alone is plainly wrong, or the camera shows too much as well:
      // it looks elsewhere than its calibration says.
      if (findings.empty() || worst->camera.miss > 1.5) findings = {*worst};
    }
    const std::vector<bool> repaired = RepairIncoherence(findings, &poses);
    const bool any =
        std::find(repaired.begin(), repaired.end(), true) != repaired.end();
    if (wrong.insert(worst->camera.camera_id).second || any) {
      found.insert(found.end(), findings.begin(), findings.end());
    }
    if (!any) break;  // it would be found again and again
    setup = MakeSetup(poses);
    if (setup.scenes.empty()) break;
  }
  // What shows too much does not harm the others; it is told pose by pose.
  for (size_t p = 0; p < poses.size(); ++p) {
    const Setup alone = MakeSetup({poses[p]});
    if (alone.scenes.empty()) continue;
    for (const CameraCoherence& camera : MeasureAll(alone)) {
      constexpr double kTooMuch = 1.5;
      if (camera.miss < kTooMuch) continue;
      found.push_back({Incoherence::Kind::kShows, camera, static_cast<int>(p)});
    }
  }
  return found;
}

std::vector<bool> RepairIncoherence(const std::vector<Incoherence>& found,
                                    std::vector<std::vector<View>>* poses) {
  std::vector<bool> repaired;
  for (const Incoherence& item : found) {
    const std::string& id = item.camera.camera_id;
    bool is_repaired = false;
    for (size_t p = 0; p < poses->size(); ++p) {
      std::vector<View>& views = (*poses)[p];
      const bool is_meant = item.pose < 0 || item.pose == static_cast<int>(p);
      if (!is_meant || item.kind == Incoherence::Kind::kShows) continue;
      if (item.kind == Incoherence::Kind::kTurned) {
        const Eigen::Matrix3d rotation = RotationOf(item.camera.turn);
        for (View& view : views) {
          if (view.camera.id != id) continue;
          Camera& camera = view.camera;
          camera.camera_from_world = rotation * camera.camera_from_world;
          camera.world_in_camera = rotation * camera.world_in_camera;
          is_repaired = true;
        }
      } else if (views.size() > 3) {
        is_repaired |= RemoveView(id, &views);
      }
    }
    repaired.push_back(is_repaired);
  }
  return repaired;
}

std::string Incoherence::Text() const {
  char text[240];
  const std::string& id = camera.camera_id;
  switch (kind) {
    case Kind::kTurned:
      std::snprintf(text,
                    sizeof(text),
                    "camera %s is turned by %.2f degrees against the others: "
                    "its outlines are %.1f pixels off",
                    id.c_str(),
                    camera.turn.norm() * 180 / std::numbers::pi,
                    camera.shift);
      break;
    case Kind::kMoved:
      std::snprintf(text,
                    sizeof(text),
                    "camera %s disagrees with the others (by %.1f pixels, and "
                    "no turn repairs it): wrong calibration or pictures",
                    id.c_str(),
                    std::max(camera.miss, camera.others_with));
      break;
    case Kind::kHides:
      std::snprintf(text,
                    sizeof(text),
                    "camera %s: its silhouette lacks parts that the others see",
                    id.c_str());
      break;
    case Kind::kShows:
      std::snprintf(text,
                    sizeof(text),
                    "camera %s: its silhouette shows parts that the others do "
                    "not (%.1f pixels)",
                    id.c_str(),
                    camera.miss);
      break;
  }
  return text;
}

std::string Incoherence::RepairText(bool repaired) const {
  switch (kind) {
    case Kind::kTurned:
      return "; it is turned back, but calibrate it anew";
    case Kind::kMoved:
    case Kind::kHides:
      return repaired ? "; it is left out"
                      : "; it stays, as without it two views are left";
    case Kind::kShows:
      return "";
  }
  return "";
}

}  // namespace sweepfit
