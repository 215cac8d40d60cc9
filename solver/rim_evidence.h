// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "capture/silhouette.h"
#include "model/body.h"

namespace sweepfit {

// A body in one posture with what the evidence is compared to.
struct PosedBody {
  TriangleMesh mesh;                     // world
  std::vector<Eigen::Vector3d> normals;  // per vertex, outward, world
  std::vector<VertexMotion> motions;     // rest -> world
};
PosedBody PoseForFit(const Body& body, const Pose& pose);

// The observed outline of one view: points every `spacing` pinhole pixels with
// outward unit normals. Pieces at the picture's border are left out: there the
// picture ends, not the person.
struct ObservedContour {
  double spacing = 0;
  std::vector<Eigen::Vector2d> pixel;
  std::vector<Eigen::Vector2d> normal;
};
ObservedContour ObserveContour(const View& view, double spacing);

// A vertex on the outline of the posed body in one view.
struct RimPoint {
  int vertex;
  int view;
  Eigen::Vector2d pixel;   // pinhole
  Eigen::Vector2d normal;  // outward unit normal in the picture
  double depth;
  double weight;  // share of an independent observation, see below
  // 1, or less where another part's rim may be what the outline shows.
  double trust = 1;
};

// The rim vertex as the view sees it, with a weight of 1; none behind the
// camera, or where the surface looks along the view.
std::optional<RimPoint> SeeRim(const PosedBody& body,
                               int vertex,
                               const View& view,
                               int view_index);

// An observed contour point and the rim vertex that explains it best.
struct ContourPair {
  int vertex;
  int view;
  Eigen::Vector2d contour_pixel;
  Eigen::Vector2d contour_normal;
  double depth;
  double weight;
};

// Neighbouring boundary pixels share their errors over about 15 px, so a point
// counts as spacing / 15 of an observation; otherwise thousands of pixels would
// outvote every prior.
inline constexpr double kContourCorrelationPixels = 15;

// Vertices where the surface turns away from the camera: the better end of
// every edge whose ends face differently.
std::vector<int> ContourGenerator(const PosedBody& body,
                                  const std::vector<Quad>& quads,
                                  const Eigen::Vector3d& camera_in_world);

// True for views that stand opposite another one: these two see one outline.
std::vector<bool> HaveOpposite(const std::vector<View>& views);
// Outlines that differ: two views opposite each other count once.
int NumOutlines(const std::vector<View>& views);

struct OutlineOptions {
  // Weights of a rim that runs beside another part's. The outline shows the
  // outer one of the two and would draw the inner one outwards, so the inner
  // one says little. In views with an opposite one, which sees the same outline
  // with the other part in front, both do.
  double inner_rival_weight = 0.1;
  double opposite_rival_weight = 0.2;
  std::optional<std::string> Check() const;
};

struct RimEvidence {
  std::vector<RimPoint> rim;         // model -> image
  std::vector<ContourPair> contour;  // image -> model
  int num_unexplained = 0;           // contour points without a partner

  void AddPairs(const std::vector<ContourPair>& pairs) {
    contour.insert(contour.end(), pairs.begin(), pairs.end());
  }
};

// Finds the rim of the posed body in every view (contour generator on the
// outline of the body) and pairs it with the observed contours. A pair must lie
// within max_distance pixels and its normals within 60 degrees. Rims of two
// parts that run side by side (one leg before the other, an arm before the
// small of the back) count as `options` says.
RimEvidence GatherRimEvidence(const PosedBody& body,
                              const std::vector<Quad>& quads,
                              const std::vector<View>& views,
                              const std::vector<ObservedContour>& contours,
                              double max_distance,
                              const OutlineOptions& options);

// Mean distance in metres between the rim of the body and the silhouettes.
double MeanRimError(const RimEvidence& evidence,
                    const std::vector<View>& views);

}  // namespace sweepfit
