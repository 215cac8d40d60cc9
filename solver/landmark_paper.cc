// SPDX-License-Identifier: Apache-2.0
#include "solver/landmark_paper.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <utility>

#include "model/input_error.h"
#include "solver/landmark_contours.h"
#include "volume/cut_plane.h"

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Chain = std::vector<cv::Point>;

// Shares of the way from one feature to the next.
constexpr double kElbowShare = 0.485;  // shoulder to wrist
constexpr double kWristShare = 0.74;   // shoulder to finger tip
constexpr double kKneeShare = 0.49;    // hip to ankle
// Of the outline's height.
constexpr double kMinDefect = 0.02;
constexpr double kHipAboveCrotch = 0.06;
constexpr double kHipOffset = 0.051;
constexpr double kAnkleHeight = 0.045;
constexpr double kSpineAboveRoot = 0.095;
constexpr double kNeckDrop = 0.02;
constexpr double kHeadBelowCrown = 0.085;
constexpr double kSigma = 0.02;  // metres

Vector2d ToVector(const cv::Point& p) { return {p.x, p.y}; }

// The longest 8-connected chain around the silhouette, in pinhole pixels.
Chain ContourChain(const View& view) {
  const cv::Mat1b mask = view.signed_distance < 0;
  std::vector<Chain> chains;
  cv::findContours(mask, chains, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  if (chains.empty()) throw FitError("landmarks: an outline is empty");
  return *std::max_element(
      chains.begin(), chains.end(), [](const Chain& a, const Chain& b) {
        return cv::contourArea(a) < cv::contourArea(b);
      });
}

// The view whose camera stands most in that direction from the person.
const View& ViewFrom(const std::vector<View>& views,
                     const Vector3d& middle_in_world,
                     const Vector3d& direction) {
  const auto cosine = [&](const View& view) {
    Vector3d way = view.camera.CenterInWorld() - middle_in_world;
    way.y() = 0;
    return way.normalized().dot(direction);
  };
  return *std::max_element(
      views.begin(), views.end(), [&](const View& a, const View& b) {
        return cosine(a) < cosine(b);
      });
}

// The linear map from an upright picture's outline to the volume's box, seen
// from one side: horizontal in the picture is `right`, down is -y.
class BoxMap {
 public:
  BoxMap(const Chain& chain, const SolidGraph& graph, const Vector3d& right)
      : box_(cv::boundingRect(chain)) {
    low_.setConstant(std::numeric_limits<double>::max());
    high_ = -low_;
    for (int node = 0; node < graph.num_nodes(); ++node) {
      const Vector3d p = graph.PointInWorld(node);
      // The surface is a node's depth away.
      const Vector2d flat(right.dot(p), p.y());
      const Vector2d depth = Vector2d::Constant(graph.depth(node));
      low_ = low_.cwiseMin(flat - depth);
      high_ = high_.cwiseMax(flat + depth);
    }
  }

  double height_pixels() const { return box_.height; }
  // (along right, height) in the world.
  Vector2d ToWorld(const Vector2d& pixel) const {
    const double u = (pixel.x() - box_.x) / std::max(1, box_.width - 1);
    const double v = (pixel.y() - box_.y) / std::max(1, box_.height - 1);
    return {low_.x() + u * (high_.x() - low_.x()),
            high_.y() - v * (high_.y() - low_.y())};
  }

 private:
  cv::Rect box_;
  Vector2d low_, high_;
};

// The frontal outline's features in pixels. Sides are the person's: the
// picture's right is the left side.
struct FrontFeatures {
  std::array<std::optional<Vector2d>, kNumJoints> joint;
  std::array<std::optional<Vector2d>, 2> armpit;
  std::optional<Vector2d> crotch;
};

class FrontOutline {
 public:
  explicit FrontOutline(const View& view)
      : view_(view),
        chain_(ContourChain(view)),
        box_(cv::boundingRect(chain_)) {}

  const Chain& chain() const { return chain_; }
  FrontFeatures Find();

 private:
  // Deepest convexity defect in a window of the box (shares of its size, from
  // the top and, for the person's left, from the middle to the right).
  std::optional<Vector2d> Defect(double left,
                                 double right,
                                 double top,
                                 double bottom) const;
  // Middle between the edges across the way from a to b, at a share of it.
  Vector2d Centered(const Vector2d& a, const Vector2d& b, double share) const;

  const View& view_;
  Chain chain_;
  cv::Rect box_;
};

std::optional<Vector2d> FrontOutline::Defect(double left,
                                             double right,
                                             double top,
                                             double bottom) const {
  std::vector<int> hull;
  cv::convexHull(chain_, hull);
  // The chain may touch itself, for which OpenCV asks for ascending indices.
  std::sort(hull.begin(), hull.end());
  std::vector<cv::Vec4i> defects;
  if (hull.size() > 3) cv::convexityDefects(chain_, hull, defects);
  std::optional<Vector2d> deepest;
  double depth = kMinDefect * box_.height;
  for (const cv::Vec4i& defect : defects) {
    const double pixels = defect[3] / 256.0;
    const Vector2d p = ToVector(chain_[defect[2]]);
    const double x = (p.x() - box_.x) / box_.width;
    const double y = (p.y() - box_.y) / box_.height;
    if (pixels <= depth || x < left || x > right || y < top || y > bottom) {
      continue;
    }
    depth = pixels;
    deepest = p;
  }
  return deepest;
}

Vector2d FrontOutline::Centered(const Vector2d& a,
                                const Vector2d& b,
                                double share) const {
  const Vector2d p = a + share * (b - a);
  const double length = (b - a).norm();
  if (length < 2) return p;
  const Vector2d across = Vector2d(-(b - a).y(), (b - a).x()) / length;
  const double limit = 0.1 * box_.height;
  const double plus = FindEdge(view_, p, across, limit, 1);
  const double minus = FindEdge(view_, p, -across, limit, 1);
  if (plus < 0 || minus < 0) return p;
  return p + 0.5 * (plus - minus) * across;
}

FrontFeatures FrontOutline::Find() {
  FrontFeatures found;
  auto& joint = found.joint;
  const double height = box_.height;
  const auto extreme = [&](auto&& value, auto&& allowed) {
    std::optional<Vector2d> best;
    for (const cv::Point& point : chain_) {
      const Vector2d p = ToVector(point);
      if (allowed(p) && (!best || value(p) > value(*best))) best = p;
    }
    return best;
  };
  const auto anywhere = [](const Vector2d&) { return true; };
  const Vector2d crown =
      *extreme([](const Vector2d& p) { return -p.y(); }, anywhere);
  joint[kHeadEnd] = crown;
  found.crotch = Defect(0.2, 0.8, 0.4, 0.75);
  const double middle = found.crotch ? found.crotch->x() : crown.x();
  const double hip_y =
      (found.crotch ? found.crotch->y() : box_.y + 0.53 * height) -
      kHipAboveCrotch * height;
  joint[kRoot] = Vector2d(middle, hip_y);

  // The neck: the narrowest row between crown and shoulders.
  double narrowest = box_.width;
  for (int row = static_cast<int>(crown.y() + 0.09 * height);
       row < crown.y() + 0.2 * height;
       ++row) {
    const Vector2d p(crown.x(), row);
    const double limit = 0.12 * height;
    const double plus = FindEdge(view_, p, Vector2d::UnitX(), limit, 1);
    const double minus = FindEdge(view_, p, -Vector2d::UnitX(), limit, 1);
    if (plus < 0 || minus < 0 || plus + minus >= narrowest) continue;
    narrowest = plus + minus;
    joint[kNeck] = p + Vector2d(0.5 * (plus - minus), kNeckDrop * height);
  }
  joint[kHead] = crown + Vector2d(0, kHeadBelowCrown * height);
  joint[kSpine] = *joint[kRoot] - Vector2d(0, kSpineAboveRoot * height);

  for (const int side : {0, 1}) {
    const double sign = side == 0 ? 1 : -1;
    const int arm = side == 0 ? kLShoulder : kRShoulder;
    const int leg = side == 0 ? kLHip : kRHip;
    const auto outwards = [&](const Vector2d& p) {
      return sign * (p.x() - middle);
    };
    const auto tip = extreme(outwards, [&](const Vector2d& p) {
      return p.y() < box_.y + 0.7 * height;
    });
    const auto sole =
        extreme([](const Vector2d& p) { return p.y(); },
                [&](const Vector2d& p) { return outwards(p) > 0; });
    const double split = (middle - box_.x) / box_.width;
    found.armpit[side] =
        side == 0 ? Defect(split, 1, 0.15, 0.4) : Defect(0, split, 0.15, 0.4);
    if (found.armpit[side] && tip) {
      const Vector2d& armpit = *found.armpit[side];
      // The top of the contour above the armpit, half way down.
      const double up = FindEdge(
          view_, armpit - Vector2d(0, 2), -Vector2d::UnitY(), 0.2 * height, 1);
      const Vector2d shoulder =
          armpit - Vector2d(0, up > 0 ? 0.5 * up : 0.045 * height);
      joint[arm] = shoulder;
      joint[arm + 3] = *tip;
      joint[arm + 2] = Centered(shoulder, *tip, kWristShare);
      joint[arm + 1] = Centered(shoulder, *joint[arm + 2], kElbowShare);
    }
    joint[leg] = Vector2d(middle + sign * kHipOffset * height, hip_y);
    if (sole) {
      const Vector2d ankle = *sole - Vector2d(0, kAnkleHeight * height);
      joint[leg + 2] = Centered(*joint[leg], ankle, 1);
      joint[leg + 1] = Centered(*joint[leg], *joint[leg + 2], kKneeShare);
      joint[leg + 3] = *sole;
    }
  }
  return found;
}

}  // namespace

std::vector<Landmark3> FindPaperLandmarks(const std::vector<View>& views,
                                          const Volume& volume,
                                          const SolidGraph& graph,
                                          const Vector3d& facing_in_world,
                                          std::vector<Landmark2>* points) {
  const Vector3d left = Vector3d::UnitY().cross(facing_in_world);
  const Vector3d middle = 0.5 * (volume.BoxMin() + volume.BoxMax());
  const View& front = ViewFrom(views, middle, facing_in_world);
  const View& side = ViewFrom(views, middle, left);
  FrontOutline outline(front);
  const FrontFeatures features = outline.Find();
  const BoxMap front_map(outline.chain(), graph, left);
  // Seen from the left the person faces to the picture's left.
  const Chain side_chain = ContourChain(side);
  const BoxMap side_map(side_chain, graph, -facing_in_world);

  // Depth: the middle of the volume's chord along the line of sight, of those
  // that the line crosses the longest.
  const double reach = (volume.BoxMax() - volume.BoxMin()).norm();
  const auto middle_of_chord = [&](const Vector2d& at) {
    Vector3d point = at.x() * left + at.y() * Vector3d::UnitY();
    point += facing_in_world.dot(middle) * facing_in_world;
    const double step = volume.voxel_size();
    double best_length = 0, best = 0, start = 0;
    bool inside = false;
    for (double z = -0.5 * reach; z <= 0.5 * reach; z += step) {
      const bool now = volume.Sample(point + z * facing_in_world) < 0;
      if (now && !inside) start = z;
      if (!now && inside && z - start > best_length) {
        best_length = z - start;
        best = 0.5 * (z + start);
      }
      inside = now;
    }
    return Vector3d(point + best * facing_in_world);
  };
  std::array<std::optional<Vector3d>, kNumJoints> found;
  for (int j = 0; j < kNumJoints; ++j) {
    if (!features.joint[j]) continue;
    found[j] = middle_of_chord(front_map.ToWorld(*features.joint[j]));
  }
  // Feet: the depth of toes is the lateral outline's foremost low point; both
  // feet share it.
  const cv::Rect side_box = cv::boundingRect(side_chain);
  std::optional<Vector2d> toe;
  for (const cv::Point& point : side_chain) {
    const Vector2d p = ToVector(point);
    if (p.y() < side_box.y + 0.94 * side_box.height) continue;
    if (!toe || p.x() < toe->x()) toe = p;
  }
  if (toe) {
    const Vector2d at = side_map.ToWorld(*toe);
    for (const int j : {kLFootEnd, kRFootEnd}) {
      if (!found[j]) continue;
      *found[j] += (-at.x() - facing_in_world.dot(*found[j])) * facing_in_world;
    }
    points->push_back({side.camera.id,
                       "foot_end",
                       side.camera.Distort(*toe),
                       4 * Eigen::Matrix2d::Identity(),
                       "contour"});
  }
  // Cut-planes perpendicular to the bisector of the neighbours.
  const auto before_cut = found;
  for (const int j :
       {kLElbow, kLWrist, kRElbow, kRWrist, kLKnee, kLAnkle, kRKnee, kRAnkle}) {
    const auto& parent = before_cut[j - 1];
    const auto& child = before_cut[j + 1];
    if (!found[j] || !parent || !child) continue;
    Vector3d normal = (*found[j] - *parent).normalized();
    // The foot points away from the shank: its ankle is cut across the shank.
    if (j != kLAnkle && j != kRAnkle) {
      normal += (*child - *found[j]).normalized();
    }
    if (normal.norm() < 0.1) continue;
    const CutPlaneSection cut =
        CutPlane(volume,
                 *found[j],
                 normal.normalized(),
                 0.12 * (volume.BoxMax() - volume.BoxMin()).y());
    if (!cut.found || cut.touches_border) continue;
    *found[j] += facing_in_world.dot(cut.centroid_in_world - *found[j]) *
                 facing_in_world;
  }

  std::vector<Landmark3> landmarks;
  const auto add_point = [&](const std::string& name, const Vector2d& pixel) {
    points->push_back({front.camera.id,
                       name,
                       front.camera.Distort(pixel),
                       4 * Eigen::Matrix2d::Identity(),
                       "contour"});
  };
  for (int j = 0; j < kNumJoints; ++j) {
    if (!found[j]) continue;
    Landmark3 landmark;
    landmark.name = std::string(kJointNames[j]);
    landmark.joint = j;
    landmark.point_in_world = *found[j];
    landmark.covariance = kSigma * kSigma * Eigen::Matrix3d::Identity();
    landmark.num_views = 1;
    landmark.source = "both";
    landmarks.push_back(std::move(landmark));
    add_point(std::string(kJointNames[j]), *features.joint[j]);
  }
  if (features.crotch) add_point("crotch", *features.crotch);
  if (features.armpit[0]) add_point("l_armpit", *features.armpit[0]);
  if (features.armpit[1]) add_point("r_armpit", *features.armpit[1]);
  return landmarks;
}

}  // namespace sweepfit
