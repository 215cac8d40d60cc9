// SPDX-License-Identifier: Apache-2.0
#include "experiments/report_html.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

#include "model/skeleton.h"

namespace sweepfit {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kStyle[] = R"(
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 76rem;
       padding: 0 1rem; color: #1c2430; background: #fbfbfa; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem;
     border-bottom: 1px solid #d9dde2; padding-bottom: .2rem; }
table { border-collapse: collapse; margin: .6rem 0; }
th, td { text-align: left; padding: .2rem .9rem .2rem 0;
         border-bottom: 1px solid #e6e9ed; vertical-align: top; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
.grid { display: flex; flex-wrap: wrap; gap: .6rem; }
figure { margin: 0; } figcaption { font-size: .8rem; color: #5a6572; }
.grid img { height: 26rem; border-radius: 4px; }
.renders img { height: 20rem; background: #fff; }
img.wide { max-width: 100%; } img.texture { width: 24rem; }
.warn { background: #fff4d6; border-left: 4px solid #e0a100;
        padding: .5rem .9rem; margin: .5rem 0; }
.key { display: inline-block; width: .8rem; height: .8rem; margin: 0 .3rem 0 1rem; }
.ok { color: #1d7a3a; } .weak { color: #a06a00; } .failed { color: #b3261e; }
)";

std::string Number(const Json& value, int decimals, double factor = 1) {
  if (!value.is_number()) return "&ndash;";
  char text[48];
  std::snprintf(
      text, sizeof(text), "%.*f", decimals, factor * value.get<double>());
  return text;
}

std::string Text(const Json& value) {
  return EscapeHtml(value.is_string() ? value.get<std::string>()
                                      : value.dump());
}

std::string Join(const Json& list) {
  std::string text;
  for (const Json& item : list) {
    text += (text.empty() ? "" : ", ") + Text(item);
  }
  return text;
}

void Warn(const std::string& html, std::ostream& out) {
  out << "<p class=\"warn\">" << html << "</p>\n";
}

void WriteHead(const Json& report, std::ostream& out) {
  out << "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
      << "<meta name=\"viewport\" content=\"width=device-width\">\n<title>"
      << "sweepfit: " << Text(report["capture"]) << "</title>\n<style>"
      << kStyle << "</style></head><body>\n<h1>" << Text(report["capture"])
      << "</h1>\n<p>Fitted by sweepfit " << Text(report["version"]) << " from "
      << report["cameras"].size() << " cameras (" << Join(report["cameras"])
      << "), until stage " << Text(report["options"]["until"]) << ".</p>\n";
  if (report.contains("model") && report["model"].is_string()) {
    out << "<p>Model: <a href=\"" << Text(report["model"]) << "\">"
        << Text(report["model"]) << "</a></p>\n";
  }
}

void WriteWarnings(const Json& report, std::ostream& out) {
  if (report["holdout_scores_void"].get<bool>()) {
    Warn("Holdout cameras were used by this fit (" +
             Join(report["holdout_used"]) +
             "): scores on holdout cameras are void.",
         out);
  }
  for (const auto& [pose, figures] : report["poses"].items()) {
    if (!figures.contains("unsafe_limbs") || figures["unsafe_limbs"].empty()) {
      continue;
    }
    Warn("Pose " + EscapeHtml(pose) + ": not safe: <b>" +
             Join(figures["unsafe_limbs"]) +
             "</b>. These limbs rest on priors more than on the pictures.",
         out);
  }
}

void WritePictures(const std::string& title,
                   const std::string& style,
                   const std::vector<ReportPictures::Picture>& pictures,
                   std::ostream& out) {
  if (pictures.empty()) return;
  out << "<h2>" << title << "</h2>\n<div class=\"" << style << "\">\n";
  for (const auto& picture : pictures) {
    const std::string path = EscapeHtml(picture.path);
    const std::string caption = EscapeHtml(picture.caption);
    out << "<figure><a href=\"" << path << "\"><img src=\"" << path
        << "\" alt=\"" << caption << "\"></a><figcaption>" << caption
        << "</figcaption></figure>\n";
  }
  out << "</div>\n";
}

void WriteSilhouetteScores(const Json& report, std::ostream& out) {
  bool any = false;
  for (const auto& [pose, figures] : report["poses"].items()) {
    if (!figures.contains("silhouette")) continue;
    if (!any) {
      out << "<h2>Fitted mesh against silhouettes</h2>\n<table><tr><th>pose"
          << "</th><th>camera</th><th class=\"n\">IoU</th><th class=\"n\">"
          << "boundary mean, px</th><th class=\"n\">p95, px</th>"
          << "<th class=\"n\">signed, px</th></tr>\n";
      any = true;
    }
    for (const auto& [camera, error] :
         figures["silhouette"]["cameras"].items()) {
      out << "<tr><td>" << EscapeHtml(pose) << "</td><td>" << EscapeHtml(camera)
          << "</td><td class=\"n\">" << Number(error["iou"], 4)
          << "</td><td class=\"n\">" << Number(error["boundary_mean"], 2)
          << "</td><td class=\"n\">" << Number(error["boundary_p95"], 2)
          << "</td><td class=\"n\">" << Number(error["signed_mean"], 2)
          << "</td></tr>\n";
    }
  }
  if (any) out << "</table>\n";
}

void WriteBody(const Json& report, std::ostream& out) {
  if (!report.contains("body")) return;
  const Json& body = report["body"];
  out << "<h2>Body</h2>\n<table>\n<tr><td>stature</td><td>"
      << Number(body["stature"], 3) << " m</td></tr>\n<tr><td>sex (0 female "
      << "&ndash; 1 male)</td><td>" << Number(body["sex"], 2)
      << "</td></tr>\n<tr><td>mesh</td><td>" << body["vertices"].dump()
      << " vertices, " << body["quads"].dump() << " quads</td></tr>\n";
  if (report.contains("skin")) {
    out << "<tr><td>linear skinning against sweeps</td><td>rms "
        << Number(report["skin"]["rms"], 2, 1000) << " mm, max "
        << Number(report["skin"]["max"], 1, 1000) << " mm</td></tr>\n";
  }
  out << "</table>\n";
}

void WriteStages(const Json& report, std::ostream& out) {
  out << "<h2>Stages</h2>\n<table><tr><th>stage</th><th>status</th>"
      << "<th class=\"n\">seconds</th><th>warnings</th></tr>\n";
  const Json& seconds = report["times"]["stages"];
  for (size_t i = 0; i < report["stages"].size(); ++i) {
    const Json& stage = report["stages"][i];
    const std::string status = Text(stage["status"]);
    out << "<tr><td>" << Text(stage["stage"]) << "</td><td class=\"" << status
        << "\">" << status << "</td><td class=\"n\">"
        << Number(seconds[i]["seconds"], 2) << "</td><td>";
    for (const Json& warning : stage["warnings"]) {
      out << Text(warning) << "<br>";
    }
    out << "</td></tr>\n";
  }
  out << "</table>\n<p>" << Number(report["times"]["total"], 1)
      << " s in all.</p>\n";
}

// A colour for each family of residuals: what pictures say is blue and green,
// what was known before is warm.
const char* FamilyColour(const std::string& family) {
  static const std::map<std::string, const char*> kColours = {
      {"landmark", "#2b6cb0"},
      {"silhouette", "#4299e1"},
      {"photo", "#2f9e6e"},
      {"hull", "#8ac6d1"},
      {"stature", "#805ad5"},
      {"anthropometric", "#dd8a1f"},
      {"template", "#b7791f"},
      {"pose", "#e8b04b"},
      {"girth", "#f0cf8e"},
      {"symmetry", "#d98880"},
      {"smoothness", "#c9cfd6"}};
  const auto it = kColours.find(family);
  return it == kColours.end() ? "#000000" : it->second;
}

void WriteLegend(const std::vector<std::string>& families, std::ostream& out) {
  out << "<p>";
  for (const std::string& family : families) {
    out << "<span class=\"key\" style=\"background:" << FamilyColour(family)
        << "\"></span>" << EscapeHtml(family);
  }
  out << "</p>\n";
}

// A piece of a bar of shares in an SVG picture.
void WritePiece(double x,
                double y,
                double width,
                double height,
                const std::string& colour,
                std::ostream& out) {
  char text[160];
  std::snprintf(text,
                sizeof text,
                "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" "
                "fill=\"%s\"/>",
                x,
                y,
                width,
                height,
                colour.c_str());
  out << text;
}

// How many unknowns each family of residuals decides, stage by stage.
void WriteFamilies(const Json& report, std::ostream& out) {
  std::vector<std::pair<std::string, const Json*>> columns;
  for (const Json& stage : report["stages"]) {
    if (!stage.contains("figures")) continue;
    const Json& figures = stage["figures"];
    const std::string name = stage["stage"].get<std::string>();
    if (figures.contains("families")) {
      columns.emplace_back(name, &figures["families"]);
    } else if (figures.contains("pose") && figures["pose"].is_object() &&
               figures["pose"].contains("families")) {
      columns.emplace_back(name, &figures["pose"]["families"]);
    }
  }
  if (columns.empty()) return;
  out << "<h2>What decided the posture</h2>\n<p>Effective parameters: how many "
      << "of the unknowns each family of residuals decides.</p>\n"
      << "<table><tr><th>family</th>";
  for (const auto& [name, families] : columns) {
    out << "<th class=\"n\">" << EscapeHtml(name) << "</th>";
  }
  out << "</tr>\n";
  for (const auto& [family, ignored] : columns.front().second->items()) {
    out << "<tr><td>" << EscapeHtml(family) << "</td>";
    for (const auto& [name, families] : columns) {
      out << "<td class=\"n\">"
          << Number(families->value(family, Json::object())
                        .value("effective_parameters", Json()),
                    1)
          << "</td>";
    }
    out << "</tr>\n";
  }
  out << "</table>\n";
}

// One picture per sweep: a bar per cross-section that shows by what it is
// known, and below it how well.
void WriteSections(const Json& report, std::ostream& out) {
  const Json* sections = nullptr;
  for (const Json& stage : report["stages"]) {
    if (stage.contains("figures") && stage["figures"].contains("sections") &&
        stage["figures"]["sections"].is_object()) {
      sections = &stage["figures"]["sections"];
    }
  }
  if (sections == nullptr || sections->empty()) return;
  std::vector<std::string> families;
  double largest = 0;
  for (const auto& [name, sweep] : sections->items()) {
    if (families.empty()) {
      for (const auto& [key, values] : sweep.items()) {
        if (key != "u" && key != "radius" && key != "sigma") {
          families.push_back(key);
        }
      }
    }
    for (const Json& sigma : sweep["sigma"]) {
      largest = std::max(largest, sigma.get<double>());
    }
  }
  out << "<h2>Cross-sections</h2>\n<p>By what the mean radius of every "
      << "cross-section is known, from the trunk's or limb's beginning to its "
      << "end; below, in grey, its standard deviation as if all measurements "
      << "were independent (the longest bar is " << Number(largest, 2, 1000)
      << " mm). Point at a bar for its numbers.</p>\n";
  WriteLegend(families, out);
  constexpr double kWidth = 12, kShares = 60, kSigmas = 30;
  out << "<div class=\"grid\">\n";
  for (const auto& [name, sweep] : sections->items()) {
    const size_t count = sweep["u"].size();
    out << "<figure><svg width=\"" << kWidth * static_cast<double>(count)
        << "\" height=\"" << kShares + kSigmas + 2 << "\" role=\"img\">";
    for (size_t i = 0; i < count; ++i) {
      const double x = kWidth * static_cast<double>(i);
      out << "<g><title>u " << Number(sweep["u"][i], 2) << ": radius "
          << Number(sweep["radius"][i], 1, 1000) << " mm, sigma "
          << Number(sweep["sigma"][i], 2, 1000) << " mm";
      for (const std::string& family : families) {
        out << ", " << EscapeHtml(family) << " "
            << Number(sweep[family][i], 0, 100) << " %";
      }
      out << "</title>";
      double y = 0;
      for (const std::string& family : families) {
        const double height = kShares * sweep[family][i].get<double>();
        WritePiece(x, y, kWidth - 1, height, FamilyColour(family), out);
        y += height;
      }
      WritePiece(x,
                 kShares + 2,
                 kWidth - 1,
                 kSigmas * sweep["sigma"][i].get<double>() / largest,
                 "#5a6572",
                 out);
      out << "</g>";
    }
    out << "</svg><figcaption>" << EscapeHtml(name)
        << "</figcaption></figure>\n";
  }
  out << "</div>\n";
}

// The families' shares as one bar.
void WriteEvidence(const Json& evidence, std::ostream& out) {
  constexpr double kWidth = 120, kHeight = 12;
  out << "<svg width=\"" << kWidth << "\" height=\"" << kHeight
      << "\" role=\"img\"><title>";
  bool any = false;
  for (const auto& [family, share] : evidence.items()) {
    out << (any ? ", " : "") << EscapeHtml(family) << " "
        << Number(share, 0, 100) << " %";
    any = true;
  }
  out << "</title>";
  double x = 0;
  for (const auto& [family, share] : evidence.items()) {
    const double width = kWidth * share.get<double>();
    WritePiece(x, 0, width, kHeight, FamilyColour(family), out);
    x += width;
  }
  out << "</svg>";
}

void WriteJoints(const Json& joints, std::ostream& out) {
  if (!joints.contains("detail") || joints["detail"].empty()) return;
  out << "<h2>Joints</h2>\n<p>Reliability is the share of what is known that "
      << "comes from the pictures: 0 is priors only. Sigma is one standard "
      << "deviation per axis. The bar says which families of residuals it "
      << "is known by.</p>\n";
  std::set<std::string> families;
  for (const auto& [pose, detail] : joints["detail"].items()) {
    for (const auto& [joint, figures] : detail.items()) {
      for (const auto& [family, share] : figures["evidence"].items()) {
        families.insert(family);
      }
    }
  }
  WriteLegend({families.begin(), families.end()}, out);
  out << "<table><tr><th>joint</th>";
  for (const auto& [pose, ignored] : joints["detail"].items()) {
    const std::string name = EscapeHtml(pose);
    out << "<th class=\"n\">" << name << ": reliability</th><th class=\"n\">"
        << "sigma, mm</th><th>evidence</th>";
  }
  out << "</tr>\n";
  for (const std::string_view joint : kJointNames) {
    const std::string name(joint);
    out << "<tr><td>" << name << "</td>";
    for (const auto& [pose, detail] : joints["detail"].items()) {
      out << "<td class=\"n\">" << Number(detail[name]["reliability"], 2)
          << "</td><td class=\"n\">" << Number(detail[name]["sigma"], 1, 1000)
          << "</td><td>";
      WriteEvidence(detail[name]["evidence"], out);
      out << "</td>";
    }
    out << "</tr>\n";
  }
  out << "</table>\n";
}

void WriteOptions(const Json& report, std::ostream& out) {
  out << "<h2>Options</h2>\n<table>\n";
  const Json flat = report["options"].flatten();
  for (const auto& [key, value] : flat.items()) {
    std::string name = key.substr(1);
    for (char& c : name) c = c == '/' ? '.' : c;
    out << "<tr><td>" << EscapeHtml(name) << "</td><td>" << Text(value)
        << "</td></tr>\n";
  }
  out << "</table>\n";
}

}  // namespace

std::string EscapeHtml(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string ReportHtml(const Json& report,
                       const Json& joints,
                       const ReportPictures& pictures) {
  std::ostringstream out;
  WriteHead(report, out);
  WriteWarnings(report, out);
  WritePictures("The fitted person", "grid renders", pictures.renders, out);
  WritePictures(
      "Silhouettes against the fitted mesh", "grid", pictures.overlays, out);
  WriteSilhouetteScores(report, out);
  WriteBody(report, out);
  WriteStages(report, out);
  WriteFamilies(report, out);
  WriteJoints(joints, out);
  WriteSections(report, out);
  if (!pictures.texture.empty()) {
    out << "<h2>Texture</h2>\n<img class=\"texture\" alt=\"texture\" src=\""
        << pictures.texture << "\">\n";
  }
  if (!pictures.silhouettes.empty()) {
    out << "<h2>All silhouettes</h2>\n<img class=\"wide\" alt=\"silhouettes\" "
        << "src=\"" << pictures.silhouettes << "\">\n";
  }
  WriteOptions(report, out);
  out << "</body></html>\n";
  return out.str();
}

}  // namespace sweepfit
