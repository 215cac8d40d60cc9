// SPDX-License-Identifier: Apache-2.0
#include <glog/logging.h>

#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "capture/render.h"
#include "model/vertex_neighbours.h"
#include "solver/displacement.h"
#include "solver/fit_body.h"
#include "solver/relax_surface.h"
#include "solver/solve_person.h"
#include "solver/surface_thickness.h"

namespace sweepfit {
namespace {

using Eigen::Vector3d;

// Evidence farther than this from the surface belongs to something else.
constexpr double kReach = 0.025;  // metres
// Fingers and faces keep the template's shape: outlines seldom resolve them.
constexpr double kDetailStiffness = 6;
// Shares of sigma_magnitude: hands and feet move little, what is thin hardly.
constexpr double kDetailShare = 0.25;
constexpr double kThinShare = 0.015;

constexpr double kRimReach = 15;  // pixels
// The photographs are matched this far about the surface, metres, in steps of
// so many pixels; less far once the surface has moved there.
constexpr double kPhotoReachFirst = 0.008;
constexpr double kPhotoReach = 0.005;
constexpr double kPhotoStep = 0.5;
constexpr double kInnerReach = 0.010;

bool IsDetail(BodyPart part) {
  return part == BodyPart::kLHand || part == BodyPart::kRHand ||
         part == BodyPart::kLFoot || part == BodyPart::kRFoot;
}

using SparseMatrix = Eigen::SparseMatrix<double>;

// The posture's normals turned back to rest: the directions of the offsets.
std::vector<Vector3d> OffsetDirections(const PosedBody& posed) {
  std::vector<Vector3d> directions(posed.normals.size());
  for (size_t v = 0; v < directions.size(); ++v) {
    directions[v] = posed.motions[v].rotation.transpose() * posed.normals[v];
  }
  return directions;
}

// Least squares for one offset per vertex along its normal:
//   sum w (d_i - target)^2 / sigma^2
//   + sum (d_i - mean of neighbours)^2 / sigma_smooth^2
//   + sum d_i^2 / sigma_magnitude^2
//   + sum over pairs (d_i - d_mirror(i) + a_i)^2 / sigma_symmetry^2
// a_i: by how much the vertex stands out farther than its mirror image, beyond
// what it does in the template.
class OffsetSystem {
 public:
  // `stiffness`: the matrix of what does not depend on the evidence. `solver`
  // has analysed its pattern.
  OffsetSystem(const SparseMatrix& stiffness,
               Eigen::SimplicialLDLT<SparseMatrix>* solver)
      : stiffness_(stiffness),
        solver_(solver),
        diagonal_(Eigen::VectorXd::Zero(stiffness.rows())),
        right_(Eigen::VectorXd::Zero(stiffness.rows())) {}

  void Add(int vertex, double target, double weight) {
    diagonal_[vertex] += weight;
    right_[vertex] += weight * target;
  }

  // Only the right hand side of what `stiffness` holds already.
  void PullApart(int vertex, int mirror, double difference, double weight) {
    right_[vertex] += weight * difference;
    right_[mirror] -= weight * difference;
  }

  Eigen::VectorXd Solve() {
    SparseMatrix matrix = stiffness_;
    for (Eigen::Index i = 0; i < diagonal_.size(); ++i) {
      matrix.coeffRef(i, i) += diagonal_[i];
    }
    solver_->factorize(matrix);
    CHECK(solver_->info() == Eigen::Success);
    return solver_->solve(right_);
  }

 private:
  const SparseMatrix& stiffness_;
  Eigen::SimplicialLDLT<SparseMatrix>* solver_;
  Eigen::VectorXd diagonal_;
  Eigen::VectorXd right_;
};

// People are much the same on both sides: where the evidence is weak, the other
// side knows. A template may have differences of its own; those stay.
class Symmetry {
 public:
  Symmetry(const Body& body,
           const std::vector<Vector3d>& reference_rest,
           double sigma)
      : mirror_(body.topology.mirror_vertex), weight_(1 / (sigma * sigma)) {
    const TriangleMesh reference{
        reference_rest, TriangulateQuads(body.topology.quads, reference_rest)};
    reference_apart_ = Apart(reference_rest, VertexNormals(reference));
  }

  SparseMatrix Stiffness() const {
    const auto n = static_cast<Eigen::Index>(mirror_.size());
    std::vector<Eigen::Triplet<double>> triplets;
    ForEachPair([&](int v, int m) {
      triplets.emplace_back(v, v, weight_);
      triplets.emplace_back(m, m, weight_);
      triplets.emplace_back(v, m, -weight_);
      triplets.emplace_back(m, v, -weight_);
    });
    SparseMatrix matrix(n, n);
    matrix.setFromTriplets(triplets.begin(), triplets.end());
    return matrix;
  }

  // Where the posture bends a normal on one side only, measuring along the
  // offsets errs by less than the people differ.
  void AddTo(const Body& body,
             const std::vector<Vector3d>& directions,
             OffsetSystem* system) const {
    const std::vector<double> apart = Apart(RestVertices(body), directions);
    ForEachPair([&](int v, int m) {
      system->PullApart(v, m, reference_apart_[v] - apart[v], weight_);
    });
  }

 private:
  template <typename Visit>
  void ForEachPair(const Visit& visit) const {
    for (int v = 0; v < static_cast<int>(mirror_.size()); ++v) {
      if (mirror_[v] > v) visit(v, mirror_[v]);
    }
  }

  // How far the first vertex of every pair stands out beyond the second one's
  // mirror image, along the normals of both; 0 for the other vertices.
  std::vector<double> Apart(const std::vector<Vector3d>& rest,
                            const std::vector<Vector3d>& normals) const {
    const auto beyond = [&](int v, int m) {
      const Vector3d image(-rest[m].x(), rest[m].y(), rest[m].z());
      return normals[v].dot(rest[v] - image);
    };
    std::vector<double> apart(rest.size(), 0.0);
    ForEachPair(
        [&](int v, int m) { apart[v] = 0.5 * (beyond(v, m) - beyond(m, v)); });
    return apart;
  }

  const std::vector<int>& mirror_;
  double weight_;
  std::vector<double> reference_apart_;
};

// Thin pieces of the head, its ears: offsets along their normals would turn
// them inside out.
std::vector<bool> FindThin(const Body& body) {
  constexpr double kThin = 0.007;  // of stature
  TriangleMesh mesh;
  mesh.vertices = RestVertices(body);
  mesh.triangles = TriangulateQuads(body.topology.quads, mesh.vertices);
  const std::vector<double> thickness =
      SurfaceThickness(RayScene(mesh), mesh.vertices, VertexNormals(mesh));
  std::vector<bool> thin(body.num_vertices());
  for (int v = 0; v < body.num_vertices(); ++v) {
    thin[v] = body.topology.part[v] == BodyPart::kHead &&
              thickness[v] < kThin * body.stature;
  }
  return thin;
}

// L^T L of the scale-dependent Laplacian: neighbours count by their inverse
// squared distance, and rows are scaled so that the sum over the vertices is
// the integral of the squared Laplacian whatever the size and shape of the
// quads, sigma_smooth being that of quads of kSpacing.
SparseMatrix SmoothnessMatrix(const Body& body, double sigma_smooth) {
  constexpr double kSpacing = 0.010;  // metres
  constexpr double kMaxScale = 8;
  const int n = body.num_vertices();
  const auto neighbours = VertexNeighbours(body.topology.quads, n);
  const std::vector<Vector3d> vertices = RestVertices(body);
  std::vector<double> area(n, 0.0);
  for (const Quad& quad : body.topology.quads) {
    const int corners = NumCorners(quad);
    const double share = (vertices[quad[2]] - vertices[quad[0]])
                             .cross(vertices[quad[3]] - vertices[quad[1]])
                             .norm() /
                         (2 * corners);
    for (int i = 0; i < corners; ++i) area[quad[i]] += share;
  }
  std::vector<Eigen::Triplet<double>> triplets;
  for (int i = 0; i < n; ++i) {
    std::vector<double> weights;
    double sum = 0;
    for (const int j : neighbours[i]) {
      const double squared =
          std::max((vertices[j] - vertices[i]).squaredNorm(), 1e-8);
      weights.push_back(1 / squared);
      sum += weights.back();
    }
    const double count = static_cast<double>(weights.size());
    const double scale = std::sqrt(area[i]) * kSpacing * sum / count;
    const double stiffness =
        std::min(scale, kMaxScale) *
        (IsDetail(body.topology.part[i]) ? kDetailStiffness : 1) / sigma_smooth;
    triplets.emplace_back(i, i, stiffness);
    for (size_t k = 0; k < weights.size(); ++k) {
      triplets.emplace_back(i, neighbours[i][k], -stiffness * weights[k] / sum);
    }
  }
  SparseMatrix laplacian(n, n);
  laplacian.setFromTriplets(triplets.begin(), triplets.end());
  return SparseMatrix(laplacian.transpose()) * laplacian;
}

void AddTargets(const PoseEvidence& evidence,
                RimEvidence rims,
                const PictureMatches& pictures,
                const PosedBody& posed,
                double sigma_rim,
                OffsetSystem* system) {
  const std::vector<View>& views = *evidence.views;
  rims.AddPairs(pictures.inner);
  const auto add = [&](int vertex, double target, double weight, double sigma) {
    if (std::abs(target) > kReach) return;
    // Huber weights at two standard deviations.
    const double robust = std::min(1.0, 2 * sigma / std::abs(target));
    system->Add(vertex, target, robust * weight / (sigma * sigma));
  };
  for (const RimPoint& rim : rims.rim) {
    const View& view = views[rim.view];
    const double metre = rim.depth / view.camera.FocalLength();
    add(rim.vertex,
        -metre * SampleBilinear(view.signed_distance, rim.pixel).value,
        rim.weight,
        sigma_rim);
  }
  for (const ContourPair& pair : rims.contour) {
    const View& view = views[pair.view];
    const double metre = pair.depth / view.camera.FocalLength();
    const Eigen::Vector2d pixel =
        view.camera.ProjectPinhole(posed.mesh.vertices[pair.vertex]);
    add(pair.vertex,
        metre * pair.contour_normal.dot(pair.contour_pixel - pixel),
        pair.weight,
        sigma_rim);
  }
  for (const PhotoPoint& point : pictures.photo.points) {
    const int v = point.vertex;
    const double target =
        point.unit_normal.dot(point.point_in_world - posed.mesh.vertices[v]);
    add(v, target, evidence.photo->options().weight, point.sigma);
  }
  const double margin = 0.5 * evidence.volume->voxel_size();
  for (size_t v = 0; v < posed.mesh.vertices.size(); ++v) {
    const double phi = evidence.volume->Sample(posed.mesh.vertices[v]);
    if (phi > margin && phi < 0.9 * evidence.volume->band_half_width()) {
      add(static_cast<int>(v), -phi, 0.3, sigma_rim);
    }
  }
}

void ApplyOffsets(const Eigen::VectorXd& offset,
                  std::vector<Vector3d> directions,
                  Body* body) {
  for (size_t v = 0; v < directions.size(); ++v) {
    directions[v] *= offset[static_cast<Eigen::Index>(v)];
  }
  DisplaceAtRest(directions, body);
}

}  // namespace

std::optional<std::string> RefineOptions::Check() const {
  if (rounds < 1 || rounds > 50) return "refine.rounds must be 1 to 50";
  for (const double sigma :
       {sigma_rim, sigma_smooth, sigma_magnitude, sigma_symmetry}) {
    if (!(sigma > 0)) return "refine.sigma_* must be positive";
  }
  return std::nullopt;
}

void RefineSurface(const std::vector<PoseEvidence>& evidence,
                   const RefineOptions& options,
                   const std::vector<Vector3d>& reference_rest,
                   const JointResult& joints,
                   Body* body,
                   StageSummary* summary) {
  const auto relax = [&] {
    const RelaxedSurface relaxed = RelaxSurface(reference_rest, body);
    summary->figures["relaxed_vertices"] = relaxed.moved_vertices;
    summary->figures["turned_faces"] = relaxed.turned_faces_left;
    summary->figures["torn_edges"] = relaxed.long_edges_left;
    summary->status = "ok";
  };
  if (!options.enabled) {
    summary->figures["enabled"] = false;
    relax();
    return;
  }
  const int n = body->num_vertices();
  const Symmetry symmetry(*body, reference_rest, options.sigma_symmetry);
  SparseMatrix stiffness =
      SmoothnessMatrix(*body, options.sigma_smooth) + symmetry.Stiffness();
  const std::vector<bool> thin = FindThin(*body);
  for (int i = 0; i < n; ++i) {
    double sigma = options.sigma_magnitude;
    if (thin[i]) {
      sigma *= kThinShare;
    } else if (IsDetail(body->topology.part[i])) {
      sigma *= kDetailShare;
    }
    stiffness.coeffRef(i, i) += 1 / (sigma * sigma);
  }
  Eigen::SimplicialLDLT<SparseMatrix> solver;
  solver.analyzePattern(stiffness);

  StandingBody standing = Stand(evidence, joints, *body, kRimReach);
  summary->figures["rim_error_start_mm"] = 1000 * standing.rim_error;
  std::vector<PictureMatches> pictures;
  int rounds = 0;
  for (; rounds < options.rounds; ++rounds) {
    // Matched anew each time: patches lie flatter on a better surface.
    pictures = MatchPictures(evidence,
                             standing.posed,
                             *body,
                             {rounds == 0 ? kPhotoReachFirst : kPhotoReach,
                              kPhotoStep,
                              kInnerReach});
    OffsetSystem system(stiffness, &solver);
    const std::vector<Vector3d> directions =
        OffsetDirections(standing.posed.front());
    symmetry.AddTo(*body, directions, &system);
    for (size_t p = 0; p < evidence.size(); ++p) {
      AddTargets(evidence[p],
                 standing.rims[p],
                 pictures[p],
                 standing.posed[p],
                 options.sigma_rim,
                 &system);
    }
    Body candidate = *body;
    ApplyOffsets(system.Solve(), directions, &candidate);
    StandingBody moved = Stand(evidence, joints, candidate, kRimReach);
    // A refinement that does not bring the outlines closer is not kept.
    if (!(moved.rim_error < standing.rim_error)) break;
    *body = std::move(candidate);
    standing = std::move(moved);
  }
  size_t num_photo_points = 0, num_inner_points = 0;
  double lightness_sigma = 0;
  for (const PictureMatches& of_pose : pictures) {
    num_photo_points += of_pose.photo.points.size();
    lightness_sigma = std::max(lightness_sigma, of_pose.photo.lightness_sigma);
    num_inner_points += of_pose.inner.size();
  }
  double largest = 0;
  for (const Vector3d& d : body->displacement_in_section) {
    largest = std::max(largest, d.norm());
  }
  summary->figures["rounds"] = rounds;
  summary->figures["photo_points"] = num_photo_points;
  // Of the pose that is worst off: gloss and changing light show here.
  summary->figures["lightness_sigma"] = lightness_sigma;
  summary->figures["inner_contour_points"] = num_inner_points;
  summary->figures["rim_error_end_mm"] = 1000 * standing.rim_error;
  summary->figures["largest_displacement_mm"] = 1000 * largest;
  relax();
}

}  // namespace sweepfit
