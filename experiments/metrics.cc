// SPDX-License-Identifier: Apache-2.0
#include "experiments/metrics.h"

#include <glog/logging.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <nanoflann.hpp>
#include <numeric>

#include "experiments/random.h"
#include "model/closest_point.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

using Points2d = std::vector<Eigen::Vector2d>;

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(values.size());
}

// Percentile with linear interpolation between the sorted values.
double Percentile(std::vector<double> values, double percent) {
  std::sort(values.begin(), values.end());
  const double at = percent / 100 * static_cast<double>(values.size() - 1);
  const size_t low = static_cast<size_t>(at);
  const size_t high = std::min(low + 1, values.size() - 1);
  return values[low] + (at - std::floor(at)) * (values[high] - values[low]);
}

// ------------------------------------------------------------- silhouettes

// Steps per pixel of the grid on which boundaries are sampled.
constexpr int kBoundarySteps = 3;

double Bilinear(const cv::Mat1f& image, double x, double y) {
  const int x0 = std::clamp(static_cast<int>(x), 0, image.cols - 1);
  const int y0 = std::clamp(static_cast<int>(y), 0, image.rows - 1);
  const int x1 = std::min(x0 + 1, image.cols - 1);
  const int y1 = std::min(y0 + 1, image.rows - 1);
  const double fx = x - x0, fy = y - y0;
  return (1 - fy) * ((1 - fx) * image(y0, x0) + fx * image(y0, x1)) +
         fy * ((1 - fx) * image(y1, x0) + fx * image(y1, x1));
}

// Crossings of the 0.5 level with the lines of a grid kBoundarySteps times
// finer than the pixels, the mask being interpolated bilinearly.
Points2d BoundaryPoints(const cv::Mat1f& mask) {
  Points2d points;
  const auto add = [&](double x, double y) {
    if (x > 1 && y > 1 && x < mask.cols - 2 && y < mask.rows - 2) {
      points.emplace_back(x, y);
    }
  };
  constexpr double kStep = 1.0 / kBoundarySteps;
  for (int row = 0; row + 1 < mask.rows; ++row) {
    for (int col = 0; col + 1 < mask.cols; ++col) {
      const auto [low, high] = std::minmax({mask(row, col),
                                            mask(row, col + 1),
                                            mask(row + 1, col),
                                            mask(row + 1, col + 1)});
      if (low >= 0.5f || high < 0.5f) continue;
      double value[kBoundarySteps + 1][kBoundarySteps + 1];
      for (int j = 0; j <= kBoundarySteps; ++j) {
        for (int i = 0; i <= kBoundarySteps; ++i) {
          value[j][i] = Bilinear(mask, col + i * kStep, row + j * kStep) - 0.5;
        }
      }
      // Every cell owns its grid lines but the last, which its neighbour has.
      for (int j = 0; j < kBoundarySteps; ++j) {
        for (int i = 0; i < kBoundarySteps; ++i) {
          const double v = value[j][i];
          const double right = value[j][i + 1], below = value[j + 1][i];
          if ((v < 0) != (right < 0)) {
            add(col + (i + v / (v - right)) * kStep, row + j * kStep);
          }
          if ((v < 0) != (below < 0)) {
            add(col + i * kStep, row + (j + v / (v - below)) * kStep);
          }
        }
      }
    }
  }
  return points;
}

struct PointCloud2d {
  const Points2d& points;
  size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(size_t i, size_t axis) const {
    return points[i][static_cast<int>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using KdTree2d = nanoflann::KDTreeSingleIndexAdaptor<
    nanoflann::L2_Simple_Adaptor<double, PointCloud2d>,
    PointCloud2d,
    2>;

// Distance to the curve that the points sample: to the nearest sample or to
// the segments from it to the next two when these are its neighbours.
class SampledCurve {
 public:
  explicit SampledCurve(const Points2d& points)
      : cloud_{points}, tree_(2, cloud_) {
    tree_.buildIndex();
  }
  double Distance(const Eigen::Vector2d& p) const {
    constexpr size_t kNeighbours = 3;
    unsigned index[kNeighbours];
    double squared[kNeighbours];
    const size_t found = tree_.knnSearch(p.data(), kNeighbours, index, squared);
    double best = std::sqrt(squared[0]);
    const Eigen::Vector2d& a = cloud_.points[index[0]];
    for (size_t i = 1; i < found; ++i) {
      const Eigen::Vector2d ab = cloud_.points[index[i]] - a;
      const double length_squared = ab.squaredNorm();
      if (length_squared >= 1) continue;
      const double s = std::clamp(
          (p - a).dot(ab) / std::max(length_squared, 1e-12), 0.0, 1.0);
      best = std::min(best, (p - a - s * ab).norm());
    }
    return best;
  }

 private:
  PointCloud2d cloud_;
  KdTree2d tree_;
};

double OverlapOverUnion(const cv::Mat1f& a, const cv::Mat1f& b) {
  double common = 0, either = 0;
  for (int row = 0; row < a.rows; ++row) {
    for (int col = 0; col < a.cols; ++col) {
      common += std::min(a(row, col), b(row, col));
      either += std::max(a(row, col), b(row, col));
    }
  }
  return either > 0 ? common / either : 1;
}

// ------------------------------------------------------------------ joints

// Bones inside the trunk's width depend on the rig more than on the person.
bool IsComparedBone(int joint) {
  return kJointParents[joint] >= 0 && joint != kLShoulder &&
         joint != kRShoulder && joint != kLHip && joint != kRHip;
}

double AlignedError(const JointPositions& joints, const JointPositions& truth) {
  Eigen::Matrix3Xd from(3, kNumJoints), to(3, kNumJoints);
  for (int j = 0; j < kNumJoints; ++j) {
    from.col(j) = joints[j];
    to.col(j) = truth[j];
  }
  const Eigen::Matrix4d to_from = Eigen::umeyama(from, to, true);
  const Eigen::Matrix3Xd aligned =
      (to_from.topLeftCorner<3, 3>() * from).colwise() +
      to_from.topRightCorner<3, 1>();
  return (aligned - to).colwise().norm().mean();
}

// ---------------------------------------------------------------- surfaces

std::vector<Eigen::Vector3d> SampleSurface(const TriangleMesh& mesh,
                                           int count,
                                           unsigned seed) {
  std::vector<double> cumulative;
  cumulative.reserve(mesh.triangles.size());
  double area = 0;
  for (const Triangle& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.vertices[t[0]];
    area +=
        0.5 * (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).norm();
    cumulative.push_back(area);
  }
  CHECK_GT(area, 0);
  Random random(seed);
  std::vector<Eigen::Vector3d> points(count);
  for (int i = 0; i < count; ++i) {
    // Stratified: one point in each of `count` equal shares of the area.
    const double at = (i + random.Uniform()) / count * area;
    const size_t index = std::min<size_t>(
        std::upper_bound(cumulative.begin(), cumulative.end(), at) -
            cumulative.begin(),
        cumulative.size() - 1);
    const Triangle& t = mesh.triangles[index];
    const double r1 = std::sqrt(random.Uniform()), r2 = random.Uniform();
    points[i] = (1 - r1) * mesh.vertices[t[0]] +
                r1 * (1 - r2) * mesh.vertices[t[1]] +
                r1 * r2 * mesh.vertices[t[2]];
  }
  return points;
}

// Rows: left (across the hips, level), up (+Y), front.
Eigen::Matrix3d BodyFromWorld(const JointPositions& joints) {
  Eigen::Vector3d left = joints[kLHip] - joints[kRHip];
  left.y() = 0;
  if (left.norm() < 1e-6) return Eigen::Matrix3d::Identity();
  left.normalize();
  Eigen::Matrix3d body_from_world;
  body_from_world << left.transpose(), Eigen::RowVector3d::UnitY(),
      left.cross(Eigen::Vector3d::UnitY()).transpose();
  return body_from_world;
}

}  // namespace

SilhouetteError CompareMasks(const cv::Mat1f& mask, const cv::Mat1f& truth) {
  CHECK(mask.size() == truth.size());
  SilhouetteError error;
  error.iou = OverlapOverUnion(mask, truth);
  const Points2d own = BoundaryPoints(mask), other = BoundaryPoints(truth);
  if (own.empty() || other.empty()) {
    if (own.empty() == other.empty()) return error;
    const double infinity = std::numeric_limits<double>::infinity();
    error.boundary_mean = error.boundary_p95 = infinity;
    error.signed_mean = own.empty() ? -infinity : infinity;
    return error;
  }
  std::vector<double> distances, signed_distances;
  const auto measure = [&](const Points2d& points,
                           const Points2d& curve_points,
                           const cv::Mat1f& other_mask,
                           double sign_where_outside) {
    const SampledCurve curve(curve_points);
    for (const Eigen::Vector2d& p : points) {
      const double d = curve.Distance(p);
      const bool outside = Bilinear(other_mask, p.x(), p.y()) < 0.5;
      distances.push_back(d);
      signed_distances.push_back(outside ? sign_where_outside * d
                                         : -sign_where_outside * d);
    }
  };
  measure(own, other, truth, 1);
  measure(other, own, mask, -1);
  error.boundary_mean = Mean(distances);
  error.boundary_p95 = Percentile(distances, 95);
  error.signed_mean = Mean(signed_distances);
  return error;
}

nlohmann::ordered_json ErrorToJson(const SilhouetteError& error) {
  return {{"iou", error.iou},
          {"boundary_mean", error.boundary_mean},
          {"boundary_p95", error.boundary_p95},
          {"signed_mean", error.signed_mean}};
}

JointError CompareJoints(const JointPositions& joints,
                         const JointPositions& truth) {
  JointError error;
  int num_bones = 0;
  const Eigen::Matrix3d body_from_world = BodyFromWorld(truth);
  for (int j = 0; j < kNumJoints; ++j) {
    error.offset_in_body[j] = body_from_world * (joints[j] - truth[j]);
    error.per_joint[j] = (joints[j] - truth[j]).norm();
    error.mpjpe += error.per_joint[j] / kNumJoints;
    if (!IsComparedBone(j)) continue;
    const int parent = kJointParents[j];
    error.bone_length_mae += std::abs((joints[j] - joints[parent]).norm() -
                                      (truth[j] - truth[parent]).norm());
    ++num_bones;
  }
  error.bone_length_mae /= num_bones;
  for (int j : kLimbJoints) {
    error.limb_mpjpe += error.per_joint[j] / kLimbJoints.size();
  }
  error.pa_mpjpe = AlignedError(joints, truth);
  return error;
}

JointPositions LoadTruthJoints(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw InputError(path.string() + ": cannot be read");
  nlohmann::json document;
  try {
    document = nlohmann::json::parse(file);
  } catch (const nlohmann::json::exception& error) {
    throw InputError(path.string() + ": not valid JSON: " + error.what());
  }
  if (!document.is_object() || document.value("unit", "m") != "m") {
    throw InputError(path.string() + ": unit: must be \"m\"");
  }
  if (!document.contains("joints") || !document["joints"].is_object()) {
    throw InputError(path.string() + ": joints: missing or not a mapping");
  }
  JointPositions positions;
  for (int j = 0; j < kNumJoints; ++j) {
    const std::string name(kJointNames[j]);
    const std::string where = path.string() + ": joints." + name;
    const auto entry = document["joints"].find(name);
    if (entry == document["joints"].end())
      throw InputError(where + ": missing");
    if (!entry->is_array() || entry->size() != 3) {
      throw InputError(where + ": must be three numbers");
    }
    for (int axis = 0; axis < 3; ++axis) {
      const nlohmann::json& value = (*entry)[axis];
      if (!value.is_number() || !std::isfinite(value.get<double>())) {
        throw InputError(where + ": must be three finite numbers");
      }
      positions[j][axis] = value.get<double>();
    }
  }
  return positions;
}

SurfaceError CompareSurfaces(const TriangleMesh& mesh,
                             const TriangleMesh& truth,
                             int samples,
                             unsigned seed) {
  CHECK_GT(samples, 0);
  const std::vector<Eigen::Vector3d> points =
      SampleSurface(mesh, samples, seed);
  const std::vector<Eigen::Vector3d> normals = VertexNormals(truth);
  const ClosestPointFinder finder(truth);
  std::vector<double> distances(points.size()), signed_distances(points.size());
  // Each iteration writes its own element, so the order does not matter.
  tbb::parallel_for(size_t{0}, points.size(), [&](size_t i) {
    const ClosestPointFinder::Result nearest = finder.Find(points[i]);
    const Triangle& t = truth.triangles[nearest.triangle];
    const Eigen::Vector3d& w = nearest.on_mesh.weights;
    const Eigen::Vector3d normal =
        w[0] * normals[t[0]] + w[1] * normals[t[1]] + w[2] * normals[t[2]];
    const bool inside = normal.dot(points[i] - nearest.on_mesh.point) < 0;
    distances[i] = nearest.distance;
    signed_distances[i] = inside ? -nearest.distance : nearest.distance;
  });
  SurfaceError error;
  error.mean = Mean(distances);
  error.median = Percentile(distances, 50);
  error.p95 = Percentile(distances, 95);
  error.max = *std::max_element(distances.begin(), distances.end());
  error.signed_mean = Mean(signed_distances);
  return error;
}

}  // namespace sweepfit
