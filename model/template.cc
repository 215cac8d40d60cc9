// SPDX-License-Identifier: Apache-2.0
#include "model/template.h"

#include <cmath>
#include <sstream>

#include "model/anthropometry.h"
#include "model/input_error.h"
#include "model/template_binding.h"
#include "model/template_geometry.h"
#include "model/template_sections.h"
#include "model/template_solid.h"
#include "model/template_tables.h"
#include "model/template_topology.h"
#include "model/template_uv.h"

namespace sweepfit {
namespace {

void CheckRange(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;  // false for NaN
  std::ostringstream message;
  message << "template." << name << " is " << value << ", not within " << low
          << " .. " << high;
  throw InputError(message.str());
}

void CheckOptions(const TemplateOptions& options) {
  CheckRange("sex", options.sex, 0, 1);
  CheckRange("stature", options.stature, 0.6, 2.5);
  if (options.mass != 0) CheckRange("mass", options.mass, 3, 400);
}

using JointPositions = std::array<Eigen::Vector3d, kNumJoints>;

// The skeleton of the tables, scaled so that the crown is `stature` above the
// soles; `height` receives that of the root joint.
Skeleton RestSkeleton(const TemplateTables& tables,
                      const TemplateOptions& options,
                      double* height) {
  Skeleton skeleton;
  skeleton.rest_direction = tables.rest_direction;
  const Anthropometry& anthropometry = Anthropometry::Default();
  skeleton.length[kRoot] = 0;
  for (int joint = 1; joint < kNumJoints; ++joint)
    skeleton.length[joint] = anthropometry.bone[joint].Mean(options.sex);
  const JointFrames frames = RestFrames(skeleton);
  const double below = tables.ankle_height - frames.joint_in_world[kLAnkle].y();
  const double above = frames.joint_in_world[kHeadEnd].y();
  const double scale = options.stature / (above + below);
  for (double& length : skeleton.length) length *= scale;
  *height = below * scale;
  return skeleton;
}

JointPositions StandingJoints(const Skeleton& skeleton, double root_height) {
  JointPositions joints = RestFrames(skeleton).joint_in_world;
  for (Eigen::Vector3d& joint : joints) joint.y() += root_height;
  return joints;
}

const GirthRegression* FindRegression(const std::string& name) {
  const Anthropometry& tables = Anthropometry::Default();
  if (name == "chest") return &tables.chest;
  if (name == "waist") return &tables.waist;
  if (name == "buttock") return &tables.buttock;
  if (name == "thigh") return &tables.thigh;
  if (name == "calf") return &tables.calf;
  if (name == "neck") return &tables.neck;
  if (name == "ankle") return &tables.ankle;
  return nullptr;
}

// How the girths differ from those of the mean mass at this stature.
std::vector<double> GirthFactors(const TemplateTables& tables,
                                 const TemplateOptions& options,
                                 double mean_mass) {
  std::vector<double> factors;
  for (const GirthTarget& target : tables.girths) {
    const GirthRegression* regression = FindRegression(target.name);
    if (options.mass == 0) {
      factors.push_back(1);
    } else if (regression != nullptr) {
      factors.push_back(
          regression->Girth(options.sex, options.mass, options.stature) /
          regression->Girth(options.sex, mean_mass, options.stature));
    } else {
      factors.push_back(
          std::pow(options.mass / mean_mass, target.mass_exponent));
    }
  }
  return factors;
}

}  // namespace

Body BuildTemplate(const TemplateOptions& options) {
  CheckOptions(options);
  const TemplateTables tables = TemplateTables::Default(options.sex);
  const double mean_mass = tables.ponderal_index * std::pow(options.stature, 3);

  Body body;
  body.sex = options.sex;
  body.stature = options.stature;
  body.mass = options.mass == 0 ? mean_mass : options.mass;
  double root_height = 0;
  body.skeleton = RestSkeleton(tables, options, &root_height);
  const TemplateSolid solid(tables,
                            options.stature,
                            StandingJoints(body.skeleton, root_height),
                            GirthFactors(tables, options, mean_mass));

  const HalfComplex half = BuildHalfComplex();
  const std::vector<Eigen::Vector3d> half_vertices = PlaceHalf(half, solid);
  body.topology = MirrorComplex(half);
  body.topology.uv = UnrollCharts(half, half_vertices);
  body.sweeps = TemplateSweeps(solid, body.skeleton);

  std::vector<Eigen::Vector3d> vertices(body.topology.mirror_vertex.size());
  for (int v = 0; v < half.num_vertices; ++v) {
    const Eigen::Vector3d at_rest =
        half_vertices[v] - Eigen::Vector3d(0, root_height, 0);
    vertices[body.topology.mirror_vertex[v]] =
        at_rest.cwiseProduct(Eigen::Vector3d(-1, 1, 1));
    vertices[v] = at_rest;
  }
  BindVertices(vertices,
               TemplateWeights(half, half_vertices, body.topology, solid),
               &body);
  return body;
}

}  // namespace sweepfit
