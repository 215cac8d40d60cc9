// SPDX-License-Identifier: Apache-2.0
#include "solver/texture.h"

#include <glog/logging.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

#include "capture/colour.h"
#include "capture/exposure.h"
#include "capture/render.h"
#include "model/median.h"
#include "model/mesh.h"
#include "model/smooth_step.h"

namespace sweepfit {
namespace {

// A view counts where it looks at the surface less obliquely than this, and
// where the picture is safe: this many pixels inside the silhouette and away
// from depth steps and the frame. It counts fully from kFullMargin pixels on.
constexpr double kMinCosine = 0.25;
constexpr double kMinMargin = 3;
constexpr double kFullMargin = 12;
// Neighbouring pixels whose depth differs by more see different limbs; a point
// that lies deeper than the nearest surface by more is hidden. Metres.
constexpr double kDepthStep = 0.03;
constexpr double kDepthTolerance = 0.01;
// Detail finer than this comes from the best view, the rest from all, metres.
constexpr double kDetailScale = 0.02;
// Views whose colour is off the median by this log ratio are doubted.
constexpr double kDoubtfulLogRatio = 0.25;
// Confidence from which nothing is filled in.
constexpr double kSafeConfidence = 0.1;
// Exposure: Huber threshold of a log ratio, and how far cameras may differ.
constexpr double kExposureHuber = 0.05;
constexpr double kExposurePrior = 0.1;
constexpr double kDarkest = 0.004;  // linear; outside, a ratio says nothing
constexpr double kBrightest = 0.9;

using Color = Eigen::Vector3f;  // linear light, blue green red, 0 to 1

// ---------------------------------------------------------------------------
// Colour

// Per 1/kSrgbSteps of linear light the first byte that is not darker.
constexpr int kSrgbSteps = 4096;
const std::array<std::uint8_t, kSrgbSteps + 1>& SrgbTable() {
  static const std::array<std::uint8_t, kSrgbSteps + 1> table = [] {
    const auto& linear = LinearOfCode();
    std::array<std::uint8_t, kSrgbSteps + 1> bytes;
    int byte = 0;
    for (int i = 0; i <= kSrgbSteps; ++i) {
      while (linear[byte] < static_cast<float>(i) / kSrgbSteps) ++byte;
      bytes[i] = static_cast<std::uint8_t>(byte);
    }
    return bytes;
  }();
  return table;
}

// The byte whose linear value is nearest, up to the curvature of the code.
std::uint8_t LinearToSrgb(float linear) {
  const auto& table = LinearOfCode();
  if (!(linear > 0)) return 0;
  if (linear >= 1) return 255;
  int upper = SrgbTable()[static_cast<int>(linear * kSrgbSteps)];
  while (table[upper] < linear) ++upper;
  const bool nearer_below = linear - table[upper - 1] < table[upper] - linear;
  return static_cast<std::uint8_t>(nearer_below ? upper - 1 : upper);
}

Color Linear(const cv::Vec3b& bgr) {
  const auto& table = LinearOfCode();
  return {table[bgr[0]], table[bgr[1]], table[bgr[2]]};
}

Color ToColor(const cv::Vec3f& value) { return {value[0], value[1], value[2]}; }

// Bilinear sample of an image of any pixel type; coordinates are clamped.
template <typename Pixel, typename Convert>
Color SampleColor(const cv::Mat_<Pixel>& image,
                  double x,
                  double y,
                  const Convert& convert) {
  x = std::clamp(x, 0.0, image.cols - 1.0);
  y = std::clamp(y, 0.0, image.rows - 1.0);
  const int x0 = std::min(static_cast<int>(x), std::max(0, image.cols - 2));
  const int y0 = std::min(static_cast<int>(y), std::max(0, image.rows - 2));
  const int x1 = std::min(x0 + 1, image.cols - 1);
  const int y1 = std::min(y0 + 1, image.rows - 1);
  const float fx = static_cast<float>(x - x0);
  const float fy = static_cast<float>(y - y0);
  return (1 - fy) *
             ((1 - fx) * convert(image(y0, x0)) + fx * convert(image(y0, x1))) +
         fy * ((1 - fx) * convert(image(y1, x0)) + fx * convert(image(y1, x1)));
}

template <typename Body>
void ParallelFor(int count, const Body& body) {
  tbb::parallel_for(tbb::blocked_range<int>(0, count),
                    [&body](const tbb::blocked_range<int>& range) {
                      for (int i = range.begin(); i != range.end(); ++i) {
                        body(i);
                      }
                    });
}

// ---------------------------------------------------------------------------
// Surface and atlas

// One half of a quad.
struct Facet {
  Triangle vertex;
  std::array<Eigen::Vector2f, 3> uv;
  // The same corners on the other side of the body, where there is one.
  bool has_mirror = false;
  std::array<Eigen::Vector2f, 3> mirror_uv;
};

// A key of the face; of a triangle without the corner that is there twice.
Quad Sorted(Quad quad) {
  if (IsTriangle(quad)) quad[3] = -1;
  std::sort(quad.begin(), quad.end());
  return quad;
}

const Eigen::Vector2f& CornerUv(const BodyTopology& topology,
                                int quad,
                                int vertex) {
  const Quad& corners = topology.quads[quad];
  const auto corner = std::find(corners.begin(), corners.end(), vertex);
  CHECK(corner != corners.end());
  return topology.uv[quad][corner - corners.begin()];
}

// The triangles of the body as it is exported: split by the rest positions.
std::vector<Facet> BuildFacets(const Body& body) {
  const BodyTopology& topology = body.topology;
  const std::vector<Triangle> triangles =
      TriangulateQuads(topology.quads, RestVertices(body));
  std::map<Quad, int> quad_of;
  std::vector<int> quad_of_triangle;
  for (std::size_t q = 0; q < topology.quads.size(); ++q) {
    quad_of.emplace(Sorted(topology.quads[q]), static_cast<int>(q));
    quad_of_triangle.insert(quad_of_triangle.end(),
                            IsTriangle(topology.quads[q]) ? 1 : 2,
                            static_cast<int>(q));
  }
  CHECK_EQ(triangles.size(), quad_of_triangle.size());
  std::vector<Facet> facets(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    Facet& facet = facets[t];
    const int quad = quad_of_triangle[t];
    facet.vertex = triangles[t];
    for (int i = 0; i < 3; ++i) {
      facet.uv[i] = CornerUv(topology, quad, facet.vertex[i]);
    }
    Quad mirrored = topology.quads[quad];
    for (int& vertex : mirrored) vertex = topology.mirror_vertex[vertex];
    const auto found = quad_of.find(Sorted(mirrored));
    if (found == quad_of.end() || found->second == quad) continue;
    facet.has_mirror = true;
    for (int i = 0; i < 3; ++i) {
      facet.mirror_uv[i] = CornerUv(
          topology, found->second, topology.mirror_vertex[facet.vertex[i]]);
    }
  }
  return facets;
}

// Texel coordinates, centres at integers, row 0 at the top (v = 1).
Eigen::Vector2d TexelOf(const Eigen::Vector2f& uv, int size) {
  return {uv.x() * size - 0.5, (1.0 - uv.y()) * size - 0.5};
}

// Which facet covers each texel centre (-1: none), and the barycentric weights
// of its second and third corner there.
struct AtlasMap {
  cv::Mat1i facet;
  cv::Mat2f weights;
};

// Fills in the texels of some rows that lie in a facet.
void RasteriseFacet(const Facet& facet,
                    int index,
                    const cv::Range& rows,
                    AtlasMap* map) {
  const int size = map->facet.rows;
  const Eigen::Vector2d a = TexelOf(facet.uv[0], size);
  Eigen::Matrix2d edges;
  edges.col(0) = TexelOf(facet.uv[1], size) - a;
  edges.col(1) = TexelOf(facet.uv[2], size) - a;
  if (std::abs(edges.determinant()) < 1e-9) return;
  const Eigen::Matrix2d weights_of = edges.inverse();
  const Eigen::Vector2d low =
      a + edges.rowwise().minCoeff().cwiseMin(Eigen::Vector2d::Zero());
  const Eigen::Vector2d high =
      a + edges.rowwise().maxCoeff().cwiseMax(Eigen::Vector2d::Zero());
  const auto first = [](double x) { return std::max(0, int(std::ceil(x))); };
  const auto last = [size](double x) {
    return std::min(size - 1, int(std::floor(x)));
  };
  constexpr double kOnEdge = -1e-6;
  const int first_row = std::max(rows.start, first(low.y()));
  const int last_row = std::min(rows.end - 1, last(high.y()));
  for (int y = first_row; y <= last_row; ++y) {
    for (int x = first(low.x()); x <= last(high.x()); ++x) {
      const Eigen::Vector2d w = weights_of * (Eigen::Vector2d(x, y) - a);
      if (w.x() < kOnEdge || w.y() < kOnEdge || w.sum() > 1 - kOnEdge) continue;
      map->facet(y, x) = index;
      map->weights(y, x) = {static_cast<float>(w.x()),
                            static_cast<float>(w.y())};
    }
  }
}

AtlasMap RasteriseAtlas(const std::vector<Facet>& facets, int size) {
  AtlasMap map{cv::Mat1i(size, size, -1), cv::Mat2f::zeros(size, size)};
  // Of facets that share a texel the last has it: each band of rows goes
  // through all of them in order.
  constexpr int kBandRows = 128;
  ParallelFor((size + kBandRows - 1) / kBandRows, [&](int band) {
    const cv::Range rows(band * kBandRows,
                         std::min(size, (band + 1) * kBandRows));
    for (std::size_t t = 0; t < facets.size(); ++t) {
      RasteriseFacet(facets[t], static_cast<int>(t), rows, &map);
    }
  });
  return map;
}

template <typename Value>
Value Interpolate(const std::vector<Value>& values,
                  const Triangle& vertex,
                  const cv::Vec2f& weights) {
  using Scalar = typename Value::Scalar;
  const Scalar b1 = weights[0];
  const Scalar b2 = weights[1];
  return (1 - b1 - b2) * values[vertex[0]] + b1 * values[vertex[1]] +
         b2 * values[vertex[2]];
}

// The body in one pose.
struct PosedSurface {
  TriangleMesh mesh;
  std::vector<Eigen::Vector3d> normals;
};

// ---------------------------------------------------------------------------
// Views

// One picture made ready for looking things up.
struct PreparedView {
  const View* view = nullptr;
  int pose = 0;
  Eigen::Vector3d center_in_world;
  cv::Rect box;      // of the silhouette, pinhole pixels; all that is of use
  cv::Mat1f depth;   // of the box, metres along z; 0 where nothing is
  cv::Mat1f margin;  // of the box: px to the nearest unsafe place
  cv::Mat3f coarse;  // the picture without detail, linear, reduced
  Color gain = Color::Ones();  // what makes its exposure that of the others
};

// Depth of the nearest surface through every pinhole pixel of the silhouette
// in a box.
cv::Mat1f RenderDepth(const View& view,
                      const cv::Rect& box,
                      const RayScene& scene) {
  cv::Mat1f depth = cv::Mat1f::zeros(box.size());
  const cv::Mat1f distance = view.signed_distance(box);
  const Eigen::Vector3d center = view.camera.CenterInWorld();
  const Eigen::Vector3d forward =
      view.camera.camera_from_world.row(2).transpose();
  ParallelFor(depth.rows, [&](int y) {
    for (int x = 0; x < depth.cols; ++x) {
      if (distance(y, x) > 0) continue;
      const Eigen::Vector3d ray =
          view.camera.RayInWorld(Eigen::Vector2d(box.x + x, box.y + y));
      const RayScene::Hit hit = scene.Intersect(center, ray);
      if (hit.triangle < 0) continue;
      depth(y, x) = static_cast<float>(hit.distance * ray.dot(forward));
    }
  });
  return depth;
}

// Pixels from every pixel to the silhouette's boundary or to a depth step
// within it; negative outside the silhouette.
cv::Mat1f SafetyMargin(const cv::Mat1f& signed_distance,
                       const cv::Mat1f& depth) {
  cv::Mat1b smooth(depth.size(), 255);
  const auto is_step = [](float a, float b) {
    return a > 0 && b > 0 && std::abs(a - b) > kDepthStep;
  };
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      if (x + 1 < depth.cols && is_step(depth(y, x), depth(y, x + 1))) {
        smooth(y, x) = smooth(y, x + 1) = 0;
      }
      if (y + 1 < depth.rows && is_step(depth(y, x), depth(y + 1, x))) {
        smooth(y, x) = smooth(y + 1, x) = 0;
      }
    }
  }
  cv::Mat1f margin;
  cv::distanceTransform(smooth, margin, cv::DIST_L2, cv::DIST_MASK_5);
  cv::Mat1f inside = -signed_distance;
  return cv::min(margin, inside);
}

// The picture blurred by `sigma` pixels, from pixels of the person only, at a
// resolution that suffices for that.
cv::Mat3f CoarsePicture(const View& view, double sigma) {
  cv::Mat1b mask = view.coverage > 0.99;
  cv::erode(mask, mask, cv::Mat::ones(5, 5, CV_8U));
  cv::Mat3f masked(view.image.size());
  cv::Mat1f weight(view.image.size());
  ParallelFor(masked.rows, [&](int y) {
    for (int x = 0; x < masked.cols; ++x) {
      const bool inside = mask(y, x) != 0;
      const Color color = Linear(view.image(y, x));
      weight(y, x) = inside ? 1.0f : 0.0f;
      masked(y, x) =
          inside ? cv::Vec3f(color[0], color[1], color[2]) : cv::Vec3f(0, 0, 0);
    }
  });
  const double reduction = std::max(1.0, sigma / 3);
  const cv::Size size(
      std::max(1, static_cast<int>(std::ceil(masked.cols / reduction))),
      std::max(1, static_cast<int>(std::ceil(masked.rows / reduction))));
  const auto blurred = [&](const cv::Mat& source) {
    cv::Mat result;
    cv::resize(source, result, size, 0, 0, cv::INTER_AREA);
    cv::GaussianBlur(result, result, {0, 0}, sigma / reduction);
    return result;
  };
  cv::Mat3f coarse = blurred(masked);
  const cv::Mat1f total = blurred(weight);
  for (int y = 0; y < coarse.rows; ++y) {
    for (int x = 0; x < coarse.cols; ++x) {
      coarse(y, x) /= std::max(total(y, x), 1e-6f);
    }
  }
  return coarse;
}

PreparedView Prepare(const View& view,
                     int pose,
                     const PosedSurface& surface,
                     const RayScene& scene) {
  PreparedView prepared;
  prepared.view = &view;
  prepared.pose = pose;
  prepared.center_in_world = view.camera.CenterInWorld();
  prepared.box = cv::boundingRect(cv::Mat1b(view.signed_distance <= 0));
  if (!prepared.box.empty()) {
    prepared.depth = RenderDepth(view, prepared.box, scene);
    prepared.margin =
        SafetyMargin(view.signed_distance(prepared.box), prepared.depth);
  }
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& vertex : surface.mesh.vertices) middle += vertex;
  middle /= static_cast<double>(surface.mesh.vertices.size());
  const double distance =
      std::max(0.1, (middle - prepared.center_in_world).norm());
  const double sigma = std::clamp(
      kDetailScale * view.camera.FocalLength() / distance, 2.0, 64.0);
  prepared.coarse = CoarsePicture(view, sigma);
  return prepared;
}

// What a view says about a point of the surface.
struct Observation {
  int view = -1;
  Eigen::Vector2d pixel;  // where the picture shows it
  double quality = 0;     // 0..1: angle and safety
  double weight = 0;      // quality times resolution
  Color coarse;           // linear, exposure corrected
  Color log_coarse;       // where outliers are looked for
};

// Looks at a point (world) with a unit normal; false where the view says
// nothing.
bool Observe(const PreparedView& prepared,
             const Eigen::Vector3d& point,
             const Eigen::Vector3d& normal,
             Observation* observation) {
  const Camera& camera = prepared.view->camera;
  const Eigen::Vector3d to_camera = prepared.center_in_world - point;
  const double towards = normal.dot(to_camera);
  if (!(towards > 0)) return false;  // most that fail, without a square root
  const double cosine = towards / to_camera.norm();
  if (!(cosine > kMinCosine)) return false;
  const Eigen::Vector3d point_in_camera = camera.PointInCamera(point);
  const double depth = point_in_camera.z();
  if (depth < 1e-3) return false;

  const Eigen::Vector2d pinhole = camera.ToPinholePixel(point_in_camera);
  const int x =
      static_cast<int>(std::floor(pinhole.x() + 0.5)) - prepared.box.x;
  const int y =
      static_cast<int>(std::floor(pinhole.y() + 0.5)) - prepared.box.y;
  if (x < 0 || y < 0 || x >= prepared.depth.cols || y >= prepared.depth.rows) {
    return false;
  }
  const float nearest = prepared.depth(y, x);
  if (nearest > 0 && depth > nearest + kDepthTolerance) return false;
  const Eigen::Vector2d pixel = camera.Distort(pinhole);
  const double margin = std::min({double{prepared.margin(y, x)},
                                  pixel.x(),
                                  pixel.y(),
                                  camera.width - 1 - pixel.x(),
                                  camera.height - 1 - pixel.y()});
  if (!(margin > kMinMargin)) return false;

  const double resolution = camera.FocalLength() / depth;  // pixels per metre
  observation->quality =
      cosine * cosine *
      SmoothStep((margin - kMinMargin) / (kFullMargin - kMinMargin));
  observation->weight = observation->quality * resolution * resolution;
  observation->pixel = pixel;
  const double scale_x = double(prepared.coarse.cols) / camera.width;
  const double scale_y = double(prepared.coarse.rows) / camera.height;
  observation->coarse =
      prepared.gain.cwiseProduct(SampleColor(prepared.coarse,
                                             (pixel.x() + 0.5) * scale_x - 0.5,
                                             (pixel.y() + 0.5) * scale_y - 0.5,
                                             ToColor));
  return observation->weight > 0;
}

// All views of a point whose place is known in every pose.
template <typename PointAndNormal>
void ObserveAll(const std::vector<PreparedView>& views,
                int num_poses,
                const PointAndNormal& point_and_normal,
                std::vector<Observation>* observations) {
  observations->clear();
  std::size_t next = 0;
  for (int pose = 0; pose < num_poses; ++pose) {
    const auto [point, normal] = point_and_normal(pose);
    for (; next < views.size() && views[next].pose == pose; ++next) {
      Observation observation;
      if (!Observe(views[next], point, normal, &observation)) continue;
      observation.view = static_cast<int>(next);
      observations->push_back(observation);
    }
  }
}

// Of three or more views those that disagree with the median colour lose
// weight: they see a highlight, or a hand that hides this place although the
// fitted hand does not. Every view has one vote: the one that looks straightest
// is often the one that is hidden.
void DoubtOutliers(std::vector<Observation>* observations,
                   std::vector<float>* scratch) {
  if (observations->size() < 3) return;
  for (Observation& observation : *observations) {
    for (int channel = 0; channel < 3; ++channel) {
      observation.log_coarse[channel] =
          std::log(std::max(1e-4f, observation.coarse[channel]));
    }
  }
  Color median;
  scratch->resize(observations->size());
  for (int channel = 0; channel < 3; ++channel) {
    for (std::size_t i = 0; i < scratch->size(); ++i) {
      (*scratch)[i] = (*observations)[i].log_coarse[channel];
    }
    median[channel] = MedianInPlace(scratch);
  }
  for (Observation& observation : *observations) {
    double off = 0;
    for (int channel = 0; channel < 3; ++channel) {
      const double difference =
          (observation.log_coarse[channel] - median[channel]) /
          kDoubtfulLogRatio;
      off += difference * difference / 3;
    }
    observation.weight /= (1 + off) * (1 + off);
  }
}

// The power that makes the best view win in the fine band.
float Eighth(float x) {
  const float x2 = x * x;
  const float x4 = x2 * x2;
  return x4 * x4;
}

// Two bands: coarse colour is the weighted mean of all views, detail comes from
// the best, so that errors of the geometry neither double it nor leave seams.
struct Blended {
  Color coarse = Color::Zero();
  double confidence = 0;
  double best = 0;  // the largest weight of an observation
};

Blended Blend(std::vector<Observation>* observations,
              std::vector<float>* scratch) {
  Blended blended;
  if (observations->empty()) return blended;
  DoubtOutliers(observations, scratch);
  double total_quality = 0;
  for (const Observation& observation : *observations) {
    blended.best = std::max(blended.best, observation.weight);
    total_quality += observation.quality;
  }
  float total = 0;
  for (const Observation& observation : *observations) {
    const float weight = static_cast<float>(observation.weight / blended.best);
    blended.coarse += weight * observation.coarse;
    total += weight;
  }
  blended.coarse /= total;
  blended.confidence = 1 - std::exp(-total_quality);
  return blended;
}

// The coarse colour with the detail of the pictures.
Color WithDetail(const Blended& blended,
                 const std::vector<PreparedView>& views,
                 const std::vector<Observation>& observations) {
  // Views that have less of the weight than this are not looked at: they would
  // have 1/15000 of the best one's say.
  constexpr float kLeastWeight = 0.3f;
  Color detail = Color::Zero();
  float total = 0;
  for (const Observation& observation : observations) {
    const float weight = static_cast<float>(observation.weight / blended.best);
    if (weight < kLeastWeight) continue;
    const PreparedView& prepared = views[observation.view];
    const Color color =
        prepared.gain.cwiseProduct(SampleColor(prepared.view->image,
                                               observation.pixel.x(),
                                               observation.pixel.y(),
                                               Linear));
    const float sharp = Eighth(weight);
    detail += sharp * (color - observation.coarse);
    total += sharp;
  }
  return (blended.coarse + detail / total).cwiseMax(0.0f).cwiseMin(1.0f);
}

// ---------------------------------------------------------------------------
// Exposure

using ObservationsPerVertex = std::vector<std::vector<Observation>>;

ObservationsPerVertex ObserveVertices(
    const std::vector<PreparedView>& views,
    const std::vector<PosedSurface>& surfaces) {
  const int num_vertices =
      static_cast<int>(surfaces.front().mesh.vertices.size());
  ObservationsPerVertex observations(num_vertices);
  ParallelFor(num_vertices, [&](int v) {
    ObserveAll(
        views,
        static_cast<int>(surfaces.size()),
        [&](int pose) {
          return std::pair(surfaces[pose].mesh.vertices[v],
                           surfaces[pose].normals[v]);
        },
        &observations[v]);
  });
  return observations;
}

// ln of the coarse colour in one channel, per vertex, of the views that show it
// neither too dark nor too bright.
std::vector<std::vector<LogBrightness>> LogBrightnesses(
    const ObservationsPerVertex& observations, int channel) {
  std::vector<std::vector<LogBrightness>> all(observations.size());
  for (std::size_t v = 0; v < observations.size(); ++v) {
    for (const Observation& observation : observations[v]) {
      const float value = observation.coarse[channel];
      if (!(value > kDarkest && value < kBrightest)) continue;
      all[v].push_back(
          {observation.view, std::log(double{value}), observation.quality});
    }
  }
  return all;
}

void EqualiseExposure(ObservationsPerVertex* observations,
                      std::vector<PreparedView>* views) {
  const int num_views = static_cast<int>(views->size());
  ParallelFor(3, [&](int channel) {
    const Eigen::VectorXd gain =
        SolveLogGains(LogBrightnesses(*observations, channel),
                      num_views,
                      kExposureHuber,
                      kExposurePrior);
    for (int i = 0; i < num_views; ++i) {
      (*views)[i].gain[channel] = static_cast<float>(std::exp(gain[i]));
    }
  });
  for (std::vector<Observation>& all : *observations) {
    for (Observation& observation : all) {
      const Color& gain = (*views)[observation.view].gain;
      observation.coarse = observation.coarse.cwiseProduct(gain);
    }
  }
}

// ---------------------------------------------------------------------------
// What nobody saw

std::vector<std::pair<int, int>> Edges(const std::vector<Quad>& quads) {
  std::vector<std::pair<int, int>> edges;
  for (const Quad& quad : quads) {
    for (int i = 0; i < 4; ++i) {
      if (quad[i] == quad[(i + 1) % 4]) continue;
      edges.push_back(std::minmax(quad[i], quad[(i + 1) % 4]));
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

// Continues values over the mesh to vertices where they are not known, as
// smoothly as possible (discrete Laplace equation). Parts without any known
// vertex get the mean.
void FillHarmonically(const std::vector<std::pair<int, int>>& edges,
                      const std::vector<bool>& known,
                      std::vector<Color>* values) {
  std::vector<int> unknown_index(known.size(), -1);
  int num_unknown = 0;
  Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
  for (std::size_t v = 0; v < known.size(); ++v) {
    if (known[v]) {
      mean += (*values)[v].cast<double>();
    } else {
      unknown_index[v] = num_unknown++;
    }
  }
  if (num_unknown == 0) return;
  const int num_known = static_cast<int>(known.size()) - num_unknown;
  mean /= std::max(1, num_known);

  constexpr double kPullToMean = 1e-6;  // decides where nothing else does
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixX3d rhs = kPullToMean * mean.replicate(num_unknown, 1);
  for (int i = 0; i < num_unknown; ++i) entries.emplace_back(i, i, kPullToMean);
  const auto add = [&](int from, int to) {
    const int i = unknown_index[from];
    if (i < 0) return;
    entries.emplace_back(i, i, 1);
    if (unknown_index[to] < 0) {
      rhs.row(i) += (*values)[to].cast<double>();
    } else {
      entries.emplace_back(i, unknown_index[to], -1);
    }
  };
  for (const auto& [a, b] : edges) {
    add(a, b);
    add(b, a);
  }
  Eigen::SparseMatrix<double> laplacian(num_unknown, num_unknown);
  laplacian.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(laplacian);
  CHECK(solver.info() == Eigen::Success);
  const Eigen::MatrixX3d solved = solver.solve(rhs);
  for (std::size_t v = 0; v < known.size(); ++v) {
    if (unknown_index[v] < 0) continue;
    (*values)[v] = solved.row(unknown_index[v]).cast<float>();
  }
}

// Colours for the surface that no view shows.
struct Fallback {
  std::vector<Color> color;             // per vertex
  std::vector<Color> minus_other_side;  // per vertex: colour less the mirrored
};

// Prefers the colour of the other side, shifted so that it fits the colours
// around; where that is not known either, the surroundings continue.
Fallback BuildFallback(const BodyTopology& topology,
                       ObservationsPerVertex* observations) {
  const std::size_t num_vertices = observations->size();
  Fallback fallback;
  fallback.color.resize(num_vertices);
  fallback.minus_other_side.assign(num_vertices, Color::Zero());
  std::vector<bool> seen(num_vertices);
  std::vector<float> scratch;
  for (std::size_t v = 0; v < num_vertices; ++v) {
    const Blended blended = Blend(&(*observations)[v], &scratch);
    fallback.color[v] = blended.coarse;
    seen[v] = blended.confidence >= kSafeConfidence;
  }
  const std::vector<std::pair<int, int>> edges = Edges(topology.quads);
  std::vector<bool> both_seen(num_vertices);
  for (std::size_t v = 0; v < num_vertices; ++v) {
    const int other = topology.mirror_vertex[v];
    both_seen[v] = seen[v] && seen[other];
    if (both_seen[v]) {
      fallback.minus_other_side[v] = fallback.color[v] - fallback.color[other];
    }
  }
  FillHarmonically(edges, both_seen, &fallback.minus_other_side);
  std::vector<bool> known = seen;
  for (std::size_t v = 0; v < num_vertices; ++v) {
    const int other = topology.mirror_vertex[v];
    if (seen[v] || !seen[other]) continue;
    known[v] = true;
    fallback.color[v] = fallback.color[other] + fallback.minus_other_side[v];
  }
  FillHarmonically(edges, known, &fallback.color);
  return fallback;
}

// ---------------------------------------------------------------------------
// The atlas

struct LinearAtlas {
  cv::Mat3f color;
  cv::Mat1f confidence;
};

LinearAtlas BlendAtlas(const AtlasMap& map,
                       const std::vector<Facet>& facets,
                       const std::vector<PosedSurface>& surfaces,
                       const std::vector<PreparedView>& views) {
  LinearAtlas atlas{cv::Mat3f::zeros(map.facet.size()),
                    cv::Mat1f::zeros(map.facet.size())};
  ParallelFor(map.facet.rows, [&](int y) {
    std::vector<Observation> observations;
    std::vector<float> scratch;
    for (int x = 0; x < map.facet.cols; ++x) {
      if (map.facet(y, x) < 0) continue;
      const Triangle& vertex = facets[map.facet(y, x)].vertex;
      const cv::Vec2f& weights = map.weights(y, x);
      ObserveAll(
          views,
          static_cast<int>(surfaces.size()),
          [&](int pose) {
            const PosedSurface& surface = surfaces[pose];
            const Eigen::Vector3d normal =
                Interpolate(surface.normals, vertex, weights);
            return std::pair(
                Interpolate(surface.mesh.vertices, vertex, weights),
                Eigen::Vector3d(normal.normalized()));
          },
          &observations);
      if (observations.empty()) continue;
      const Blended blended = Blend(&observations, &scratch);
      const Color color = WithDetail(blended, views, observations);
      atlas.color(y, x) = {color[0], color[1], color[2]};
      atlas.confidence(y, x) = static_cast<float>(blended.confidence);
    }
  });
  return atlas;
}

// ---------------------------------------------------------------------------
// Spill

// The channel of the key screen that most views see, if they do.
std::optional<int> SpilledChannel(const std::vector<PreparedView>& views) {
  for (const int channel : {0, 1}) {
    const auto count =
        std::count_if(views.begin(), views.end(), [&](const PreparedView& v) {
          return v.view->key_channel == channel;
        });
    if (2 * static_cast<std::size_t>(count) > views.size()) return channel;
  }
  return std::nullopt;
}

// The light of a key screen spills onto people: skin turns green, and blue
// jeans do. The screen's channel is limited to the mean of the other two, as
// compositors do (Wright, Digital Compositing for Film and Video, "despill");
// strong yellow and cyan, which have as much of it of their own, lose some too.
Color WithoutSpill(const Color& color, int channel, double share) {
  const float limit = 0.5F * (color.sum() - color[channel]);
  Color result = color;
  result[channel] -=
      static_cast<float>(share) * std::max(0.0F, color[channel] - limit);
  return result;
}

// The colour of a texel as the fallback has it.
Color FallbackColor(const LinearAtlas& atlas,
                    const Facet& facet,
                    const cv::Vec2f& weights,
                    const Fallback& fallback) {
  if (facet.has_mirror) {
    const Eigen::Vector2f uv =
        (1 - weights[0] - weights[1]) * facet.mirror_uv[0] +
        weights[0] * facet.mirror_uv[1] + weights[1] * facet.mirror_uv[2];
    const int size = atlas.color.rows;
    const Eigen::Vector2d texel = TexelOf(uv, size);
    const int x = std::clamp<int>(std::lround(texel.x()), 0, size - 1);
    const int y = std::clamp<int>(std::lround(texel.y()), 0, size - 1);
    if (atlas.confidence(y, x) >= kSafeConfidence) {
      return ToColor(atlas.color(y, x)) +
             Interpolate(fallback.minus_other_side, facet.vertex, weights);
    }
  }
  return Interpolate(fallback.color, facet.vertex, weights);
}

// 8-bit colours, the fallback where the views are not sure, without the light
// of a key screen.
cv::Mat3b FinishAtlas(const LinearAtlas& atlas,
                      const AtlasMap& map,
                      const std::vector<Facet>& facets,
                      const Fallback& fallback,
                      std::optional<int> spilled_channel,
                      double despill) {
  cv::Mat3b finished = cv::Mat3b::zeros(map.facet.size());
  ParallelFor(finished.rows, [&](int y) {
    for (int x = 0; x < finished.cols; ++x) {
      if (map.facet(y, x) < 0) continue;
      Color color = ToColor(atlas.color(y, x));
      const float seen = static_cast<float>(
          std::min(1.0, atlas.confidence(y, x) / kSafeConfidence));
      if (seen < 1) {
        const Color filled = FallbackColor(
            atlas, facets[map.facet(y, x)], map.weights(y, x), fallback);
        color = seen * color + (1 - seen) * filled;
      }
      if (spilled_channel) {
        color = WithoutSpill(color, *spilled_channel, despill);
      }
      for (int c = 0; c < 3; ++c) finished(y, x)[c] = LinearToSrgb(color[c]);
    }
  });
  return finished;
}

// Texels outside all charts take the colour of the nearest chart texel, so
// that filtering does not draw the background in.
void FillGutters(const AtlasMap& map, cv::Mat3b* atlas) {
  cv::Mat1b outside = map.facet < 0;
  if (cv::countNonZero(outside) == static_cast<int>(outside.total())) return;
  cv::Mat1f distance;
  cv::Mat1i label;
  cv::distanceTransform(outside,
                        distance,
                        label,
                        cv::DIST_L2,
                        cv::DIST_MASK_5,
                        cv::DIST_LABEL_PIXEL);
  std::vector<cv::Vec3b> color_of_label(outside.total() + 1);
  for (int y = 0; y < outside.rows; ++y) {
    for (int x = 0; x < outside.cols; ++x) {
      if (!outside(y, x)) color_of_label[label(y, x)] = (*atlas)(y, x);
    }
  }
  for (int y = 0; y < outside.rows; ++y) {
    for (int x = 0; x < outside.cols; ++x) {
      if (outside(y, x)) (*atlas)(y, x) = color_of_label[label(y, x)];
    }
  }
}

// ---------------------------------------------------------------------------
// Report

// Share of the posed surface's area whose vertices some view shows.
double SeenShare(const PosedSurface& surface,
                 const ObservationsPerVertex& observations) {
  double seen = 0;
  double total = 0;
  for (const Triangle& triangle : surface.mesh.triangles) {
    const auto& vertices = surface.mesh.vertices;
    const double area =
        (vertices[triangle[1]] - vertices[triangle[0]])
            .cross(vertices[triangle[2]] - vertices[triangle[0]])
            .norm();
    total += area;
    for (const int v : triangle) {
      if (!observations[v].empty()) seen += area / 3;
    }
  }
  return total > 0 ? seen / total : 0;
}

void Summarise(const std::vector<PreparedView>& views,
               double seen_share,
               int size,
               Progress* progress,
               StageSummary* summary) {
  constexpr double kLittle = 0.5;
  std::vector<std::string> warnings;
  if (seen_share < kLittle) {
    warnings.push_back("only " + std::to_string(std::lround(100 * seen_share)) +
                       " % of the surface is seen by a camera; the rest of "
                       "the texture is filled in");
  }
  for (const std::string& warning : warnings) {
    if (progress != nullptr) progress->Warning(warning);
  }
  if (summary == nullptr) return;
  summary->status = warnings.empty() ? "ok" : "weak";
  summary->warnings = warnings;
  summary->figures["size"] = size;
  summary->figures["seen_share"] = seen_share;
  nlohmann::ordered_json gains = nlohmann::ordered_json::array();
  for (const PreparedView& view : views) {
    gains.push_back({{"pose", view.pose},
                     {"camera", view.view->camera.id},
                     {"gain_bgr", {view.gain[0], view.gain[1], view.gain[2]}}});
  }
  summary->figures["exposure"] = gains;
}

}  // namespace

std::optional<std::string> TextureOptions::Check() const {
  if (size < 64 || size > 16384) {
    return "texture.size must lie between 64 and 16384";
  }
  if (!(despill >= 0 && despill <= 1)) return "texture.despill must be 0 to 1";
  return std::nullopt;
}

Texture SolveTexture(
    const Body& body,
    const std::vector<std::vector<Eigen::Vector3d>>& vertices_in_world,
    const std::vector<std::vector<View>>& views,
    const TextureOptions& options,
    Progress* progress,
    StageSummary* summary) {
  CHECK(!options.Check().has_value());
  CHECK(!vertices_in_world.empty());
  CHECK_EQ(vertices_in_world.size(), views.size());

  const std::vector<Facet> facets = BuildFacets(body);
  std::vector<PosedSurface> surfaces;
  std::vector<PreparedView> prepared;
  for (std::size_t pose = 0; pose < views.size(); ++pose) {
    PosedSurface surface;
    surface.mesh.vertices = vertices_in_world[pose];
    CHECK_EQ(surface.mesh.vertices.size(), body.binding.size());
    for (const Facet& facet : facets) {
      surface.mesh.triangles.push_back(facet.vertex);
    }
    surface.normals = VertexNormals(surface.mesh);
    const RayScene scene(surface.mesh);
    const std::size_t first = prepared.size();
    prepared.resize(first + views[pose].size());
    ParallelFor(static_cast<int>(views[pose].size()), [&](int i) {
      prepared[first + i] =
          Prepare(views[pose][i], static_cast<int>(pose), surface, scene);
    });
    surfaces.push_back(std::move(surface));
  }

  ObservationsPerVertex observations = ObserveVertices(prepared, surfaces);
  EqualiseExposure(&observations, &prepared);
  const double seen_share = SeenShare(surfaces.front(), observations);
  const Fallback fallback = BuildFallback(body.topology, &observations);

  const AtlasMap map = RasteriseAtlas(facets, options.size);
  const LinearAtlas linear = BlendAtlas(map, facets, surfaces, prepared);
  Texture texture;
  std::optional<int> spilled_channel;
  if (options.despill > 0) spilled_channel = SpilledChannel(prepared);
  texture.atlas = FinishAtlas(
      linear, map, facets, fallback, spilled_channel, options.despill);
  texture.confidence = linear.confidence;
  FillGutters(map, &texture.atlas);

  Summarise(prepared, seen_share, options.size, progress, summary);
  if (summary != nullptr && spilled_channel) {
    summary->figures["despilled_channel"] =
        *spilled_channel == 1 ? "green" : "blue";
  }
  return texture;
}

}  // namespace sweepfit
