// SPDX-License-Identifier: Apache-2.0
#include "solver/rim_evidence.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "capture/render.h"
#include "residuals/measurement.h"

namespace sweepfit {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kMinNormalAgreement = 0.5;  // cos 60 degrees
// Resolution at which the body's own outline is drawn; half the picture's is
// enough to tell the outline from folds inside it.
constexpr double kOutlineScale = 0.5;
constexpr double kOutlineTolerance = 1.6;  // pixels of the drawn outline

// Rims are rivals that run side by side in the picture, within this reach, and
// belong to places of the body this far apart, metres.
constexpr double kRivalReach = 0.013;
constexpr double kRivalDistance = 0.08;
constexpr double kRivalAgreement = 0.8;  // cosine of the normals
// The outline is that of the rival that lies this much further outside, pixels.
constexpr double kRivalOutside = 0.15;

// Views are opposite whose axes, seen from above, are: the cosine between them.
constexpr double kOpposite = -0.9;
constexpr double kLevel = 0.3;  // shorter from above: looks up or down

// The same view without distortion and at another resolution.
Camera ScaledPinhole(const Camera& camera, double scale) {
  Camera scaled = camera;
  scaled.distortion = {};
  scaled.width = static_cast<int>(std::ceil(camera.width * scale));
  scaled.height = static_cast<int>(std::ceil(camera.height * scale));
  // Pixel centres are at integers: (u + .5) scales, not u.
  scaled.K.topRows<2>() *= scale;
  scaled.K(0, 2) = (camera.K(0, 2) + 0.5) * scale - 0.5;
  scaled.K(1, 2) = (camera.K(1, 2) + 0.5) * scale - 0.5;
  return scaled;
}

// The side of a closed mesh that a camera sees covers what all of it does.
TriangleMesh FacingSide(const TriangleMesh& mesh,
                        const Vector3d& camera_in_world) {
  TriangleMesh side;
  side.vertices = mesh.vertices;
  side.triangles.reserve(mesh.triangles.size());
  for (const Triangle& t : mesh.triangles) {
    const Vector3d& a = mesh.vertices[t[0]];
    const Vector3d normal =
        (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a);
    if (normal.dot(camera_in_world - a) > 0) side.triangles.push_back(t);
  }
  return side;
}

// The part of a pinhole view that shows the mesh.
Camera CropToMesh(const Camera& pinhole, const TriangleMesh& mesh) {
  constexpr double kMargin = 4;  // pixels
  const cv::Rect box = BoxOfMesh(pinhole, mesh, kMargin);
  Camera cropped = pinhole;
  cropped.width = box.width;
  cropped.height = box.height;
  cropped.K.topRightCorner<2, 1>() -= Vector2d(box.x, box.y);
  return cropped;
}

// Unsigned distance in scaled pixels to the outline of the drawn body.
struct Outline {
  cv::Mat1f distance;
  double length = 0;  // pixels of the full picture
};

Outline DrawOutline(const Camera& scaled, const TriangleMesh& mesh) {
  const cv::Mat1f coverage = RenderCoverage(scaled, mesh, 1);
  cv::Mat1b inside = coverage >= 0.5f;
  cv::Mat1b edge;
  cv::morphologyEx(inside,
                   edge,
                   cv::MORPH_GRADIENT,
                   cv::getStructuringElement(cv::MORPH_CROSS, {3, 3}));
  Outline outline;
  // The gradient marks pixels on both sides of the outline.
  outline.length = 0.5 * cv::countNonZero(edge) / kOutlineScale;
  cv::Mat1b background = ~edge;
  cv::distanceTransform(
      background, outline.distance, cv::DIST_L2, cv::DIST_MASK_5);
  return outline;
}

bool AreOpposite(const View& a, const View& b) {
  const auto axis_from_above = [](const View& view) -> Vector2d {
    const Vector3d axis = view.camera.camera_from_world.row(2);
    return {axis.x(), axis.z()};
  };
  const Vector2d of_a = axis_from_above(a), of_b = axis_from_above(b);
  return of_a.norm() > kLevel && of_b.norm() > kLevel &&
         of_a.normalized().dot(of_b.normalized()) < kOpposite;
}

// Whether the outline at a rim may be that of another part whose rim runs
// beside it: the outer one, or either where an opposite view sees the same
// outline.
bool HasRival(const PosedBody& body,
              const std::vector<RimPoint>& turning,
              double focal_length,
              bool has_opposite,
              const RimPoint& rim) {
  const double reach = kRivalReach * focal_length / rim.depth;
  const auto is_rival = [&](const RimPoint& other) {
    const Vector2d offset = other.pixel - rim.pixel;
    return offset.squaredNorm() < reach * reach &&
           (has_opposite || offset.dot(rim.normal) > kRivalOutside) &&
           other.normal.dot(rim.normal) > kRivalAgreement &&
           (body.mesh.vertices[other.vertex] - body.mesh.vertices[rim.vertex])
                   .norm() > kRivalDistance;
  };
  return std::any_of(turning.begin(), turning.end(), is_rival);
}

std::vector<RimPoint> FindRim(const PosedBody& body,
                              const std::vector<Quad>& quads,
                              const View& view,
                              int view_index,
                              bool has_opposite,
                              const OutlineOptions& options) {
  const double rival_weight =
      has_opposite ? options.opposite_rival_weight : options.inner_rival_weight;
  const Camera scaled =
      CropToMesh(ScaledPinhole(view.camera, kOutlineScale), body.mesh);
  const Outline outline =
      DrawOutline(scaled, FacingSide(body.mesh, view.camera.CenterInWorld()));
  const cv::Rect frame(1, 1, scaled.width - 2, scaled.height - 2);
  std::vector<RimPoint> rim, turning;
  for (const int v :
       ContourGenerator(body, quads, view.camera.CenterInWorld())) {
    const Vector3d& x = body.mesh.vertices[v];
    const auto point = SeeRim(body, v, view, view_index);
    if (!point) continue;
    turning.push_back(*point);
    const Vector2d at = scaled.ProjectPinhole(x);
    const cv::Point pixel(static_cast<int>(std::lround(at.x())),
                          static_cast<int>(std::lround(at.y())));
    if (!frame.contains(pixel)) continue;
    if (outline.distance(pixel) > kOutlineTolerance) continue;
    rim.push_back(*point);
  }
  if (rim.empty()) return rim;
  const double spacing = outline.length / static_cast<double>(rim.size());
  for (RimPoint& point : rim) {
    if (rival_weight < 1 &&
        HasRival(
            body, turning, view.camera.FocalLength(), has_opposite, point)) {
      point.trust = rival_weight;
    }
    point.weight =
        point.trust * std::min(1.0, spacing / kContourCorrelationPixels);
  }
  return rim;
}

// Pairs are found by distance, where a difference of normals counts as well:
// 1 - cos = 1 costs as much as kNormalPixels.
constexpr double kNormalPixels = 40;

void PairContour(const std::vector<RimPoint>& rim,
                 const ObservedContour& contour,
                 double max_distance,
                 std::vector<ContourPair>* pairs,
                 int* num_unexplained) {
  const double share =
      std::min(1.0, contour.spacing / kContourCorrelationPixels);
  for (size_t i = 0; i < contour.pixel.size(); ++i) {
    const RimPoint* best = nullptr;
    double best_cost = max_distance * max_distance;
    for (const RimPoint& point : rim) {
      const double distance = (point.pixel - contour.pixel[i]).squaredNorm();
      if (distance >= best_cost) continue;
      const double agreement = point.normal.dot(contour.normal[i]);
      if (agreement < kMinNormalAgreement) continue;
      const double turn = kNormalPixels * (1 - agreement);
      if (distance + turn * turn < best_cost) {
        best_cost = distance + turn * turn;
        best = &point;
      }
    }
    if (best == nullptr) {
      ++*num_unexplained;
      continue;
    }
    pairs->push_back({best->vertex,
                      best->view,
                      contour.pixel[i],
                      contour.normal[i],
                      best->depth,
                      best->trust * share});
  }
}

}  // namespace

PosedBody PoseForFit(const Body& body, const Pose& pose) {
  PosedBody posed;
  const BodyDeformer deformer(body);
  posed.motions = deformer.Motions(pose);
  posed.mesh.vertices = deformer.rest_vertices();
  for (size_t i = 0; i < posed.motions.size(); ++i) {
    Vector3d& x = posed.mesh.vertices[i];
    x = posed.motions[i].rotation * x + posed.motions[i].translation;
  }
  posed.mesh.triangles =
      TriangulateQuads(body.topology.quads, posed.mesh.vertices);
  posed.normals = VertexNormals(posed.mesh);
  return posed;
}

std::optional<RimPoint> SeeRim(const PosedBody& body,
                               int vertex,
                               const View& view,
                               int view_index) {
  const auto projection =
      ProjectWithDerivative(view.camera, body.mesh.vertices[vertex]);
  const Vector2d normal =
      (view.camera.camera_from_world * body.normals[vertex]).head<2>();
  if (!projection || normal.norm() < 0.3) return std::nullopt;
  return RimPoint{vertex,
                  view_index,
                  projection->pixel,
                  normal.normalized(),
                  projection->depth,
                  1.0};
}

ObservedContour ObserveContour(const View& view, double spacing) {
  ObservedContour observed;
  observed.spacing = spacing;
  constexpr double kBorder = 3;  // pixels
  for (const auto& polyline : SubpixelContours(view.coverage)) {
    std::vector<Vector2d> pinhole;
    pinhole.reserve(polyline.size());
    for (const Vector2d& pixel : polyline) {
      pinhole.push_back(view.camera.Undistort(pixel));
    }
    double length = 0;
    for (size_t i = 0; i < pinhole.size(); ++i) {
      length += (pinhole[(i + 1) % pinhole.size()] - pinhole[i]).norm();
    }
    // Specks have no shape to compare.
    if (length < 8 * spacing) continue;
    const int num_samples = static_cast<int>(length / spacing);
    const double step = length / num_samples;
    double walked = 0, next = 0;
    for (size_t i = 0; i < pinhole.size(); ++i) {
      const size_t j = (i + 1) % pinhole.size();
      const double piece = (pinhole[j] - pinhole[i]).norm();
      while (next < walked + piece && piece > 0) {
        const double f = (next - walked) / piece;
        const Vector2d at = pinhole[i] + f * (pinhole[j] - pinhole[i]);
        // A chord over some points gives a steadier tangent than one piece.
        const size_t reach = 3;
        const Vector2d chord =
            pinhole[(j + reach) % pinhole.size()] -
            pinhole[(i + pinhole.size() - reach % pinhole.size()) %
                    pinhole.size()];
        next += step;
        const Vector2d picture = view.camera.Distort(at);
        const bool at_border = picture.x() < kBorder || picture.y() < kBorder ||
                               picture.x() > view.camera.width - 1 - kBorder ||
                               picture.y() > view.camera.height - 1 - kBorder;
        if (at_border || chord.norm() < 1e-9) continue;
        Vector2d normal = Vector2d(chord.y(), -chord.x()).normalized();
        // The distance grows to the outside whichever way the line was walked.
        if (SampleBilinear(view.signed_distance, at + 2 * normal).value <
            SampleBilinear(view.signed_distance, at - 2 * normal).value) {
          normal = -normal;
        }
        observed.pixel.push_back(at);
        observed.normal.push_back(normal);
      }
      walked += piece;
    }
  }
  return observed;
}

std::vector<int> ContourGenerator(const PosedBody& body,
                                  const std::vector<Quad>& quads,
                                  const Vector3d& camera_in_world) {
  const size_t n = body.mesh.vertices.size();
  std::vector<double> facing(n);
  for (size_t i = 0; i < n; ++i) {
    facing[i] = body.normals[i].dot(
        (camera_in_world - body.mesh.vertices[i]).normalized());
  }
  std::vector<bool> on_rim(n, false);
  for (const Quad& quad : quads) {
    for (int k = 0; k < 4; ++k) {
      const int a = quad[k], b = quad[(k + 1) % 4];
      if ((facing[a] < 0) == (facing[b] < 0)) continue;
      on_rim[std::abs(facing[a]) <= std::abs(facing[b]) ? a : b] = true;
    }
  }
  std::vector<int> rim;
  for (size_t i = 0; i < n; ++i) {
    if (on_rim[i]) rim.push_back(static_cast<int>(i));
  }
  return rim;
}

std::vector<bool> HaveOpposite(const std::vector<View>& views) {
  std::vector<bool> result;
  for (const View& view : views) {
    result.push_back(
        std::any_of(views.begin(), views.end(), [&](const View& other) {
          return AreOpposite(view, other);
        }));
  }
  return result;
}

int NumOutlines(const std::vector<View>& views) {
  const std::vector<bool> has_opposite = HaveOpposite(views);
  const auto num_opposite =
      std::count(has_opposite.begin(), has_opposite.end(), true);
  return static_cast<int>(views.size()) - static_cast<int>(num_opposite / 2);
}

std::optional<std::string> OutlineOptions::Check() const {
  for (const double weight : {inner_rival_weight, opposite_rival_weight}) {
    if (!(weight >= 0 && weight <= 1)) {
      return "outlines.*_rival_weight must be 0 to 1";
    }
  }
  return std::nullopt;
}

RimEvidence GatherRimEvidence(const PosedBody& body,
                              const std::vector<Quad>& quads,
                              const std::vector<View>& views,
                              const std::vector<ObservedContour>& contours,
                              double max_distance,
                              const OutlineOptions& options) {
  struct PerView {
    std::vector<RimPoint> rim;
    std::vector<ContourPair> pairs;
    int num_unexplained = 0;
  };
  const std::vector<bool> has_opposite = HaveOpposite(views);
  std::vector<PerView> per_view(views.size());
  tbb::parallel_for(size_t{0}, views.size(), [&](size_t v) {
    PerView& result = per_view[v];
    result.rim = FindRim(
        body, quads, views[v], static_cast<int>(v), has_opposite[v], options);
    PairContour(result.rim,
                contours[v],
                max_distance,
                &result.pairs,
                &result.num_unexplained);
  });
  RimEvidence evidence;
  for (const PerView& result : per_view) {
    evidence.rim.insert(
        evidence.rim.end(), result.rim.begin(), result.rim.end());
    evidence.contour.insert(
        evidence.contour.end(), result.pairs.begin(), result.pairs.end());
    evidence.num_unexplained += result.num_unexplained;
  }
  return evidence;
}

double MeanRimError(const RimEvidence& evidence,
                    const std::vector<View>& views) {
  double sum = 0, weight = 0;
  for (const RimPoint& rim : evidence.rim) {
    const View& view = views[rim.view];
    const double distance =
        SampleBilinear(view.signed_distance, rim.pixel).value;
    sum +=
        rim.weight * std::abs(distance) * rim.depth / view.camera.FocalLength();
    weight += rim.weight;
  }
  return weight > 0 ? sum / weight : 0;
}

}  // namespace sweepfit
