// SPDX-License-Identifier: Apache-2.0
// Compares the sweeps with linear blend skinning and dual quaternion skinning
// on the template: volume against bend and twist, faces turned over,
// self-intersections, and how closely skinning follows the sweeps.
//
//   deformation_bench FIGURE.png    draws the figure, prints the tables
//   deformation_bench BODY.json     only how skinning follows the sweeps of a
//                                   fitted body, on postures of many seeds
#include <chrono>
#include <cstdio>
#include <functional>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "model/body.h"
#include "model/body_io.h"
#include "model/helper_joints.h"
#include "model/joint_limits.h"
#include "model/lbs.h"
#include "model/mesh.h"
#include "model/self_intersection.h"
#include "model/template.h"

namespace sweepfit {
namespace {

using Vertices = std::vector<Eigen::Vector3d>;

constexpr double kDegree = std::numbers::pi / 180;

struct Method {
  std::string name;
  cv::Scalar color;
  std::function<Vertices(const Pose&)> pose;
};

// Enclosed volume between the faces of some parts and the centre of their
// border, cubic metres.
double PartVolume(const Body& body,
                  const Vertices& x,
                  const std::vector<BodyPart>& parts) {
  const auto is_in = [&](int v) {
    for (const BodyPart part : parts) {
      if (body.topology.part[v] == part) return true;
    }
    return false;
  };
  Eigen::Vector3d border(0, 0, 0);
  int count = 0;
  std::vector<Quad> quads;
  for (const Quad& quad : body.topology.quads) {
    int num_in = 0;
    for (const int v : quad) num_in += is_in(v);
    if (num_in == 4) quads.push_back(quad);
    if (num_in == 0 || num_in == 4) continue;
    for (const int v : quad) {
      if (!is_in(v)) continue;
      border += x[v];
      ++count;
    }
  }
  border /= count;
  Vertices centred = x;
  for (Eigen::Vector3d& p : centred) p -= border;
  return EnclosedVolume({centred, TriangulateQuads(quads, centred)});
}

// One curve per method: change of volume in per cent of the limb's.
struct Chart {
  std::string title;
  std::vector<double> degrees;
  std::vector<std::vector<double>> percent;  // per method
};

Chart MeasureVolume(const Body& body,
                    const std::vector<Method>& methods,
                    const std::string& title,
                    const std::vector<BodyPart>& parts,
                    const std::vector<double>& degrees,
                    const std::function<Pose(double)>& pose) {
  Chart chart{title, degrees, {}};
  const Vertices rest = RestVertices(body);
  const auto triangles = TriangulateQuads(body.topology.quads, rest);
  const double limb = PartVolume(body, rest, parts);
  const double whole = EnclosedVolume({rest, triangles});
  for (const Method& method : methods) {
    chart.percent.emplace_back();
    for (const double d : degrees) {
      const double volume = EnclosedVolume({method.pose(pose(d)), triangles});
      chart.percent.back().push_back(100 * (volume - whole) / limb);
    }
  }
  return chart;
}

void Draw(const Chart& chart,
          const std::vector<Method>& methods,
          cv::Mat3b picture) {
  const double low = -8, high = 2;
  const cv::Rect area(52, 34, picture.cols - 70, picture.rows - 74);
  const auto at = [&](double degrees, double percent) {
    return cv::Point(
        area.x + static_cast<int>(area.width * degrees / chart.degrees.back()),
        area.y + static_cast<int>(area.height *
                                  (high - std::clamp(percent, low, high)) /
                                  (high - low)));
  };
  const cv::Scalar grey(200, 200, 200), black(40, 40, 40);
  const auto text = [&](const std::string& words, cv::Point where) {
    cv::putText(picture,
                words,
                where,
                cv::FONT_HERSHEY_SIMPLEX,
                0.42,
                black,
                1,
                cv::LINE_AA);
  };
  text(chart.title, {area.x, 20});
  for (int percent = -8; percent <= 2; percent += 2) {
    cv::line(picture,
             at(0, percent),
             at(chart.degrees.back(), percent),
             percent == 0 ? black : grey);
    text(std::to_string(percent) + "%", {8, at(0, percent).y + 4});
  }
  for (const double d : chart.degrees) {
    if (static_cast<int>(d) % 30 != 0) continue;
    text(std::to_string(static_cast<int>(d)),
         {at(d, low).x - 8, area.y + area.height + 16});
  }
  for (std::size_t m = 0; m < methods.size(); ++m) {
    for (std::size_t i = 1; i < chart.degrees.size(); ++i) {
      cv::line(picture,
               at(chart.degrees[i - 1], chart.percent[m][i - 1]),
               at(chart.degrees[i], chart.percent[m][i]),
               methods[m].color,
               2,
               cv::LINE_AA);
    }
  }
}

void DrawAll(const std::vector<Chart>& charts,
             const std::vector<Method>& methods,
             const std::string& path) {
  const int width = 330, height = 300;
  cv::Mat3b picture(height + 24,
                    width * static_cast<int>(charts.size()),
                    cv::Vec3b(255, 255, 255));
  for (std::size_t c = 0; c < charts.size(); ++c) {
    Draw(charts[c],
         methods,
         picture(cv::Rect(static_cast<int>(c) * width, 0, width, height)));
  }
  int x = 52;
  for (const Method& method : methods) {
    cv::line(picture, {x, height + 6}, {x + 24, height + 6}, method.color, 2);
    cv::putText(picture,
                method.name,
                {x + 30, height + 11},
                cv::FONT_HERSHEY_SIMPLEX,
                0.45,
                cv::Scalar(40, 40, 40),
                1,
                cv::LINE_AA);
    x += 230;
  }
  cv::imwrite(path, picture);
}

// Faces that look away from where the sections' rotations turn them.
int CountTurned(const std::vector<Triangle>& triangles,
                const Vertices& rest,
                const std::vector<VertexMotion>& motions,
                const Vertices& posed) {
  int count = 0;
  for (const Triangle& t : triangles) {
    const auto normal = [&t](const Vertices& x) {
      return Eigen::Vector3d((x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]));
    };
    const Eigen::Vector3d at_rest = normal(rest);
    Eigen::Vector3d expected = Eigen::Vector3d::Zero();
    for (const int v : t) expected += motions[v].rotation * at_rest;
    count += normal(posed).dot(expected) <= 0;
  }
  return count;
}

void CompareShapes(const Body& body,
                   const BodyDeformer& deformer,
                   const std::vector<Method>& methods,
                   const std::string& title,
                   const std::vector<Pose>& poses) {
  const Vertices& rest = deformer.rest_vertices();
  const auto triangles = TriangulateQuads(body.topology.quads, rest);
  const std::size_t at_rest = SelfIntersections({rest, triangles}).size();
  std::printf("\n%s (%zu postures; %zu pairs intersect at rest)\n\n",
              title.c_str(),
              poses.size(),
              at_rest);
  std::printf(
      "| method | faces turned over | worst posture | intersecting pairs, mean "
      "| worst | postures worse than LBS |\n|---|---|---|---|---|---|\n");
  std::vector<std::vector<std::size_t>> pairs(methods.size());
  std::vector<std::vector<int>> turned(methods.size());
  std::size_t lbs = 0;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    if (methods[m].name == "LBS") lbs = m;
    for (const Pose& pose : poses) {
      const Vertices posed = methods[m].pose(pose);
      turned[m].push_back(
          CountTurned(triangles, rest, deformer.Motions(pose), posed));
      pairs[m].push_back(SelfIntersections({posed, triangles}).size());
    }
  }
  for (std::size_t m = 0; m < methods.size(); ++m) {
    long sum_turned = 0, sum_pairs = 0, worse = 0;
    for (std::size_t p = 0; p < poses.size(); ++p) {
      sum_turned += turned[m][p];
      sum_pairs += static_cast<long>(pairs[m][p]);
      worse += pairs[m][p] > pairs[lbs][p];
    }
    std::printf("| %s | %ld | %d | %.0f | %zu | %ld |\n",
                methods[m].name.c_str(),
                sum_turned,
                *std::max_element(turned[m].begin(), turned[m].end()),
                static_cast<double>(sum_pairs) / poses.size(),
                *std::max_element(pairs[m].begin(), pairs[m].end()),
                worse);
  }
}

void CompareBakes(const BodyDeformer& deformer,
                  const std::vector<Method>& methods,
                  const std::vector<Pose>& poses) {
  std::printf("\nAgainst the sweeps, %zu random postures within the limits\n\n",
              poses.size());
  std::printf("| method | rms, mm | max, mm |\n|---|---|---|\n");
  for (std::size_t m = 1; m < methods.size(); ++m) {
    double sum = 0, max = 0;
    std::size_t count = 0;
    for (const Pose& pose : poses) {
      const Vertices sweeps = deformer.Vertices(pose);
      const Vertices other = methods[m].pose(pose);
      for (std::size_t v = 0; v < sweeps.size(); ++v) {
        const double error = (other[v] - sweeps[v]).norm();
        sum += error * error;
        max = std::max(max, error);
        ++count;
      }
    }
    std::printf("| %s | %.2f | %.1f |\n",
                methods[m].name.c_str(),
                1000 * std::sqrt(sum / count),
                1000 * max);
  }
}

// How closely skinning with helpers follows on postures of other seeds, and in
// how many the sweeps cut themselves more than `plain` skinning.
void CompareSeeds(const Body& body,
                  const BodyDeformer& deformer,
                  const SkinWeights& skin,
                  const SkinWeights& plain) {
  const JointLimits limits(body.skeleton);
  const JointMotions motions(body, skin.helpers);
  const Vertices& rest = deformer.rest_vertices();
  const auto triangles = TriangulateQuads(body.topology.quads, rest);
  constexpr int kPoses = 60;
  constexpr double kFar = 0.020;  // metres
  std::printf(
      "\nLBS with helpers on %d random postures of each seed\n\n"
      "| seed | rms, mm | max, mm | of %d vertices beyond 20 mm | faces of the "
      "sweeps turned over | postures worse than LBS |\n"
      "|---|---|---|---|---|---|\n",
      kPoses,
      kPoses * body.num_vertices());
  for (const unsigned seed : {1u,
                              2u,
                              3u,
                              4u,
                              5u,
                              6u,
                              7u,
                              8u,
                              9u,
                              10u,
                              11u,
                              12u,
                              13u,
                              14u,
                              777u,
                              20261u}) {
    double sum = 0, max = 0;
    int far_off = 0, turned = 0, worse = 0;
    for (const Pose& pose : limits.RandomPoses(kPoses, seed)) {
      const Vertices sweeps = deformer.Vertices(pose);
      const Vertices skinned = SkinVertices(rest, skin, motions.At(pose));
      turned += CountTurned(triangles, rest, deformer.Motions(pose), sweeps);
      worse +=
          SelfIntersections({sweeps, triangles}).size() >
          SelfIntersections({PoseVerticesLbs(body, plain, pose), triangles})
              .size();
      for (std::size_t v = 0; v < sweeps.size(); ++v) {
        const double error = (skinned[v] - sweeps[v]).norm();
        sum += error * error;
        max = std::max(max, error);
        far_off += error > kFar;
      }
    }
    std::printf("| %u | %.1f | %.1f | %d | %d | %d |\n",
                seed,
                1000 * std::sqrt(sum / (kPoses * body.num_vertices())),
                1000 * max,
                far_off,
                turned,
                worse);
  }
}

void Run(const std::string& figure) {
  const Body body = BuildTemplate(TemplateOptions());
  const BodyDeformer deformer(body);
  const JointLimits limits(body.skeleton);
  const SkinWeights helped =
      FitSkinWeights(body, kSkinPoses, kSkinSeed).weights;
  const SkinWeights plain =
      FitSkinWeights(body, kSkinPoses, kSkinSeed, false).weights;
  const std::vector<Method> methods = {
      {"sweeps",
       {40, 120, 0},
       [&](const Pose& p) { return deformer.Vertices(p); }},
      {"LBS",
       {40, 40, 200},
       [&](const Pose& p) { return PoseVerticesLbs(body, plain, p); }},
      {"dual quaternions",
       {200, 120, 0},
       [&](const Pose& p) {
         return PoseVerticesDualQuaternion(body, plain, p);
       }},
      {"LBS with helpers", {0, 160, 230}, [&](const Pose& p) {
         return PoseVerticesLbs(body, helped, p);
       }}};

  const std::vector<double> bends = {0, 15, 30, 45, 60, 75, 90, 105, 120, 135};
  const std::vector<double> twists = {0, 15, 30, 45, 60, 75, 90};
  const std::vector<BodyPart> arm = {BodyPart::kLArm, BodyPart::kLHand};
  const std::vector<BodyPart> leg = {BodyPart::kLLeg, BodyPart::kLFoot};
  const auto bent = [&](int joint) {
    return [&limits, joint](double degrees) {
      Pose pose;
      pose.rotation[joint] = limits.Rotation(joint, {degrees * kDegree, 0, 0});
      return pose;
    };
  };
  const auto twisted = [&](double degrees) {
    Pose pose;
    pose.rotation[kLElbow] = Eigen::AngleAxisd(
        degrees * kDegree, body.skeleton.rest_direction[kLWrist]);
    return pose;
  };
  const std::vector<Chart> charts = {
      MeasureVolume(body, methods, "Elbow bent", arm, bends, bent(kLElbow)),
      MeasureVolume(body, methods, "Knee bent", leg, bends, bent(kLKnee)),
      MeasureVolume(body, methods, "Forearm twisted", arm, twists, twisted)};
  DrawAll(charts, methods, figure);
  std::printf("Change of volume, per cent of the limb\n");
  for (const Chart& chart : charts) {
    std::printf("\n| %s |", chart.title.c_str());
    for (const double d : chart.degrees) std::printf(" %.0f |", d);
    std::printf("\n|---|");
    for (std::size_t i = 0; i < chart.degrees.size(); ++i) std::printf("---|");
    std::printf("\n");
    for (std::size_t m = 0; m < methods.size(); ++m) {
      std::printf("| %s |", methods[m].name.c_str());
      for (const double p : chart.percent[m]) std::printf(" %.2f |", p);
      std::printf("\n");
    }
  }
  CompareShapes(body,
                deformer,
                methods,
                "Single joints at their limits",
                limits.LimitPoses());
  const std::vector<Pose> random = limits.RandomPoses(60, 777);
  CompareShapes(
      body, deformer, methods, "Random postures within the limits", random);
  CompareBakes(deformer, methods, random);
  CompareSeeds(body, deformer, helped, plain);

  double best = 1e9;
  for (const Pose& pose : random) {
    const auto start = std::chrono::steady_clock::now();
    deformer.Vertices(pose);
    const std::chrono::duration<double> passed =
        std::chrono::steady_clock::now() - start;
    best = std::min(best, passed.count());
  }
  std::printf("\n%d vertices posed in %.1f ms (fastest of %zu postures)\n",
              body.num_vertices(),
              1000 * best,
              random.size());
}

void RunOnBody(const std::string& path) {
  const Body body = LoadBody(path);
  CompareSeeds(body,
               BodyDeformer(body),
               FitSkinWeights(body, kSkinPoses, kSkinSeed).weights,
               FitSkinWeights(body, kSkinPoses, kSkinSeed, false).weights);
}

}  // namespace
}  // namespace sweepfit

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: deformation_bench FIGURE.png | BODY.json\n");
    return 2;
  }
  const std::string argument = argv[1];
  if (argument.ends_with(".json")) {
    sweepfit::RunOnBody(argument);
  } else {
    sweepfit::Run(argument);
  }
  return 0;
}
