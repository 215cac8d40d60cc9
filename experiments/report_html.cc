// SPDX-License-Identifier: Apache-2.0
#include "experiments/report_html.h"

#include <cmath>
#include <cstdio>
#include <sstream>

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

void WriteJoints(const Json& joints, std::ostream& out) {
  if (!joints.contains("detail") || joints["detail"].empty()) return;
  out << "<h2>Joints</h2>\n<p>Reliability is the share of what is known that "
      << "comes from the pictures: 0 is priors only. Sigma is one standard "
      << "deviation per axis.</p>\n<table><tr><th>joint</th>";
  for (const auto& [pose, ignored] : joints["detail"].items()) {
    const std::string name = EscapeHtml(pose);
    out << "<th class=\"n\">" << name << ": reliability</th><th class=\"n\">"
        << "sigma, mm</th>";
  }
  out << "</tr>\n";
  for (const std::string_view joint : kJointNames) {
    const std::string name(joint);
    out << "<tr><td>" << name << "</td>";
    for (const auto& [pose, detail] : joints["detail"].items()) {
      out << "<td class=\"n\">" << Number(detail[name]["reliability"], 2)
          << "</td><td class=\"n\">" << Number(detail[name]["sigma"], 1, 1000)
          << "</td>";
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
  WriteJoints(joints, out);
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
