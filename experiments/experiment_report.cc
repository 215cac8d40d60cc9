// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "experiments/experiment_runner.h"
#include "experiments/metrics.h"
#include "experiments/random.h"
#include "experiments/report_html.h"
#include "model/file_io.h"
#include "model/input_error.h"
#include "model/skeleton.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr int kResamples = 2000;
constexpr unsigned kBootstrapSeed = 1;

// One figure of a scored pose.
struct Metric {
  const char* name;
  const char* pointer;  // in the pose's scores; empty: of the run
  double factor;        // to the unit of the name
  int decimals;
  bool higher_is_better;
};
constexpr Metric kMetrics[] = {
    {"limb joints, mm", "/joints/limb_mpjpe", 1000, 1, false},
    {"all joints, mm", "/joints/mpjpe", 1000, 1, false},
    {"bone lengths, mm", "/joints/bone_length_mae", 1000, 1, false},
    {"fit to truth, mm", "/surface/fit_to_truth/mean", 1000, 2, false},
    {"truth to fit, mm", "/surface/truth_to_fit/mean", 1000, 2, false},
    {"p95 to truth, mm", "/surface/fit_to_truth/p95", 1000, 1, false},
    {"p95 from truth, mm", "/surface/truth_to_fit/p95", 1000, 1, false},
    {"held-out IoU", "/silhouette/holdout/iou", 1, 4, true},
    {"held-out boundary, px", "/silhouette/holdout/boundary_mean", 1, 2, false},
};
constexpr int kNumMetrics = std::size(kMetrics);

// The scores of one pose in one run.
struct Sample {
  std::string subject, pose, variant;
  std::array<double, kNumMetrics> value;
  double seconds = kNone;
  std::array<Eigen::Vector3d, kNumJoints> offset;  // metres, in the body
  bool has_offset = false;
};

struct Results {
  Json plan;
  std::vector<std::string> variants;
  std::vector<Json> rows;  // in the order of the plan
  int others = 0;          // runs of another build or of other settings
  std::vector<Sample> samples;
  std::map<std::string, int> failed;  // runs, per variant
};

Sample ReadSample(const Json& row, const std::string& pose, const Json& score) {
  Sample sample{row["subject"], pose, row["variant"], {}, kNone, {}, false};
  for (int m = 0; m < kNumMetrics; ++m) {
    const Json::json_pointer pointer(kMetrics[m].pointer);
    sample.value[m] = score.contains(pointer)
                          ? kMetrics[m].factor * score[pointer].get<double>()
                          : kNone;
  }
  sample.seconds = row["times"]["fit"].get<double>();
  const Json::json_pointer offsets("/joints/offset_in_body");
  if (score.contains(offsets)) {
    sample.has_offset = true;
    for (int j = 0; j < kNumJoints; ++j) {
      const Json& v = score[offsets][std::string(kJointNames[j])];
      sample.offset[j] = Eigen::Vector3d(
          v[0].get<double>(), v[1].get<double>(), v[2].get<double>());
    }
  }
  return sample;
}

Results ReadResults(const fs::path& folder) {
  Results results;
  results.plan =
      Json::parse(ReadWholeFile((folder / "experiment.json").string()));
  std::map<std::string, int> order;
  for (const Json& variant : results.plan["variants"]) {
    order[variant["name"]] = static_cast<int>(results.variants.size());
    results.variants.push_back(variant["name"]);
  }
  const std::set<std::string> planned(results.plan["runs"].begin(),
                                      results.plan["runs"].end());
  for (const auto& entry : fs::directory_iterator(folder / "runs")) {
    if (entry.path().extension() != ".json") continue;
    if (planned.contains(entry.path().stem().string())) {
      results.rows.push_back(Json::parse(ReadWholeFile(entry.path().string())));
    } else {
      ++results.others;
    }
  }
  const auto key = [&](const Json& row) {
    return std::tuple(row["subject"].get<std::string>(),
                      row["poses"].dump(),
                      order[row["variant"]],
                      row["id"].get<std::string>());
  };
  std::sort(results.rows.begin(),
            results.rows.end(),
            [&](const Json& a, const Json& b) { return key(a) < key(b); });
  for (const Json& row : results.rows) {
    if (row["status"] != "ok") {
      ++results.failed[row["variant"]];
      continue;
    }
    for (const auto& [pose, score] : row["scores"].items()) {
      results.samples.push_back(ReadSample(row, pose, score));
    }
  }
  return results;
}

// Mean over the poses of each subject of one variant.
using BySubject = std::map<std::string, double>;
template <typename Value>
BySubject SubjectMeans(const Results& results,
                       const std::string& variant,
                       Value value) {
  std::map<std::string, std::pair<double, int>> sums;
  for (const Sample& sample : results.samples) {
    if (sample.variant != variant) continue;
    const double v = value(sample);
    if (!std::isfinite(v)) continue;
    sums[sample.subject].first += v;
    ++sums[sample.subject].second;
  }
  BySubject means;
  for (const auto& [subject, sum] : sums) {
    means[subject] = sum.first / sum.second;
  }
  return means;
}

double Mean(const BySubject& values) {
  if (values.empty()) return kNone;
  double sum = 0;
  for (const auto& [subject, value] : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// What is left of the joints' errors when each joint's mean offset over the
// other subjects is taken off: rigs place joints apart on purpose.
double WithoutRigOffsets(const Results& results,
                         const std::string& variant,
                         const std::vector<int>& joints) {
  std::vector<const Sample*> samples;
  for (const Sample& sample : results.samples) {
    if (sample.variant == variant && sample.has_offset) {
      samples.push_back(&sample);
    }
  }
  double sum = 0;
  int count = 0;
  for (const Sample* sample : samples) {
    for (const int joint : joints) {
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      int others = 0;
      for (const Sample* other : samples) {
        if (other->subject == sample->subject) continue;
        mean += other->offset[joint];
        ++others;
      }
      if (others == 0) return kNone;
      sum += (sample->offset[joint] - mean / others).norm();
      ++count;
    }
  }
  return count == 0 ? kNone : 1000 * sum / count;
}

struct Difference {
  double mean = kNone, low = kNone, high = kNone;
  int better = 0, subjects = 0;
};

// Paired bootstrap over the subjects that both variants have.
Difference Compare(const BySubject& reference,
                   const BySubject& variant,
                   bool higher_is_better) {
  std::vector<double> differences;
  Difference result;
  for (const auto& [subject, value] : variant) {
    const auto it = reference.find(subject);
    if (it == reference.end()) continue;
    differences.push_back(value - it->second);
    const double gain =
        higher_is_better ? differences.back() : -differences.back();
    result.better += gain > 0;
  }
  const size_t n = differences.size();
  result.subjects = static_cast<int>(n);
  if (n == 0) return result;
  Random random(kBootstrapSeed);
  std::vector<double> means(kResamples);
  for (double& mean : means) {
    mean = 0;
    for (size_t i = 0; i < n; ++i) {
      mean += differences[static_cast<size_t>(random.Uniform() * n)] / n;
    }
  }
  std::sort(means.begin(), means.end());
  result.low = means[kResamples / 40];
  result.high = means[kResamples - 1 - kResamples / 40];
  result.mean = 0;
  for (const double d : differences) result.mean += d / n;
  return result;
}

std::string Number(double value, int decimals, bool sign = false) {
  if (!std::isfinite(value)) return "-";
  char text[32];
  std::snprintf(text, sizeof(text), sign ? "%+.*f" : "%.*f", decimals, value);
  return text;
}

struct Table {
  std::string title;
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
};

Table MeansTable(const Results& results) {
  const std::vector<int> limbs(kLimbJoints.begin(), kLimbJoints.end());
  std::vector<int> all(kNumJoints);
  for (int j = 0; j < kNumJoints; ++j) all[j] = j;
  Table table{"Means over the subjects", {"variant"}, {}};
  for (const Metric& metric : kMetrics) table.head.push_back(metric.name);
  for (const char* name : {"limb joints less rig offsets, mm",
                           "all joints less rig offsets, mm",
                           "seconds",
                           "subjects",
                           "failed runs"}) {
    table.head.push_back(name);
  }
  for (const std::string& variant : results.variants) {
    std::vector<std::string> row = {variant};
    size_t subjects = 0;
    for (int m = 0; m < kNumMetrics; ++m) {
      const BySubject values = SubjectMeans(
          results, variant, [m](const Sample& s) { return s.value[m]; });
      subjects = std::max(subjects, values.size());
      row.push_back(Number(Mean(values), kMetrics[m].decimals));
    }
    row.push_back(Number(WithoutRigOffsets(results, variant, limbs), 1));
    row.push_back(Number(WithoutRigOffsets(results, variant, all), 1));
    row.push_back(Number(
        Mean(SubjectMeans(
            results, variant, [](const Sample& s) { return s.seconds; })),
        1));
    row.push_back(std::to_string(subjects));
    const auto failed = results.failed.find(variant);
    row.push_back(
        std::to_string(failed == results.failed.end() ? 0 : failed->second));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table DifferencesTable(const Results& results) {
  const std::string& reference = results.variants.front();
  Table table{"Against '" + reference +
                  "': difference [95 % interval], subjects that got better",
              {"variant"},
              {}};
  for (const Metric& metric : kMetrics) table.head.push_back(metric.name);
  for (const std::string& variant : results.variants) {
    if (variant == reference) continue;
    std::vector<std::string> row = {variant};
    for (int m = 0; m < kNumMetrics; ++m) {
      const auto value = [m](const Sample& s) { return s.value[m]; };
      const Difference d = Compare(SubjectMeans(results, reference, value),
                                   SubjectMeans(results, variant, value),
                                   kMetrics[m].higher_is_better);
      const int decimals = kMetrics[m].decimals;
      row.push_back(d.subjects == 0 ? "-"
                                    : Number(d.mean, decimals, true) + " [" +
                                          Number(d.low, decimals, true) + ", " +
                                          Number(d.high, decimals, true) +
                                          "] " + std::to_string(d.better) +
                                          "/" + std::to_string(d.subjects));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table SamplesTable(const Results& results) {
  Table table{"Every fit", {"subject", "pose", "variant"}, {}};
  for (const Metric& metric : kMetrics) table.head.push_back(metric.name);
  table.head.push_back("seconds");
  for (const Sample& sample : results.samples) {
    std::vector<std::string> row = {
        sample.subject, sample.pose, sample.variant};
    for (int m = 0; m < kNumMetrics; ++m) {
      row.push_back(Number(sample.value[m], kMetrics[m].decimals));
    }
    row.push_back(Number(sample.seconds, 1));
    table.rows.push_back(std::move(row));
  }
  return table;
}

// Names of grid points hold commas.
std::string CsvCell(const std::string& text) {
  return text.find(',') == std::string::npos ? text : "\"" + text + "\"";
}

std::string ToCsv(const Table& table) {
  std::string text;
  const auto line = [&](const std::vector<std::string>& cells) {
    for (size_t i = 0; i < cells.size(); ++i) {
      text += (i > 0 ? "," : "") + CsvCell(cells[i] == "-" ? "" : cells[i]);
    }
    text += "\n";
  };
  line(table.head);
  for (const auto& row : table.rows) line(row);
  return text;
}

std::string ToMarkdown(const Table& table) {
  std::string text = "## " + table.title + "\n\n|";
  for (const std::string& cell : table.head) text += " " + cell + " |";
  text += "\n|";
  for (size_t i = 0; i < table.head.size(); ++i) text += "---|";
  text += "\n";
  for (const auto& row : table.rows) {
    text += "|";
    for (const std::string& cell : row) text += " " + cell + " |";
    text += "\n";
  }
  return text + "\n";
}

std::string ToHtml(const Table& table) {
  std::string text = "<h2>" + EscapeHtml(table.title) + "</h2>\n<table><tr>";
  for (const std::string& cell : table.head) {
    text += "<th>" + EscapeHtml(cell) + "</th>";
  }
  text += "</tr>\n";
  for (const auto& row : table.rows) {
    text += "<tr>";
    for (const std::string& cell : row) {
      text += "<td>" + EscapeHtml(cell) + "</td>";
    }
    text += "</tr>\n";
  }
  return text + "</table>\n";
}

// A line per variant: a dot per subject, a bar at the mean.
std::string DotPlot(const Results& results, int m) {
  std::vector<BySubject> values;
  double low = std::numeric_limits<double>::max(), high = -low;
  for (const std::string& variant : results.variants) {
    values.push_back(SubjectMeans(
        results, variant, [m](const Sample& s) { return s.value[m]; }));
    for (const auto& [subject, value] : values.back()) {
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  if (low > high) return "";
  const double span = std::max(high - low, 1e-9);
  constexpr int kLeft = 260, kWidth = 560, kLine = 24;
  const auto x = [&](double value) {
    return kLeft + (value - low) / span * kWidth;
  };
  std::ostringstream svg;
  const size_t lines = values.size();
  svg << "<h3>" << EscapeHtml(kMetrics[m].name) << "</h3>\n<svg width=\""
      << kLeft + kWidth + 80 << "\" height=\"" << kLine * (lines + 1)
      << "\" font-size=\"13\" font-family=\"system-ui, sans-serif\">\n";
  for (size_t v = 0; v < lines; ++v) {
    const double y = kLine * (v + 0.5);
    svg << "<text x=\"0\" y=\"" << y + 4 << "\">"
        << EscapeHtml(results.variants[v]) << "</text><line x1=\"" << kLeft
        << "\" x2=\"" << kLeft + kWidth << "\" y1=\"" << y << "\" y2=\"" << y
        << "\" stroke=\"#dde1e6\"/>\n";
    for (const auto& [subject, value] : values[v]) {
      svg << "<circle cx=\"" << Number(x(value), 1) << "\" cy=\"" << y
          << "\" r=\"4\" fill=\"#3867b0\" fill-opacity=\".55\"><title>"
          << EscapeHtml(subject) << " " << Number(value, kMetrics[m].decimals)
          << "</title></circle>\n";
    }
    const double mean = Mean(values[v]);
    if (!std::isfinite(mean)) continue;
    svg << "<line x1=\"" << Number(x(mean), 1) << "\" x2=\""
        << Number(x(mean), 1) << "\" y1=\"" << y - 9 << "\" y2=\"" << y + 9
        << "\" stroke=\"#b3261e\" stroke-width=\"2\"/><text x=\""
        << kLeft + kWidth + 10 << "\" y=\"" << y + 4 << "\">"
        << Number(mean, kMetrics[m].decimals) << "</text>\n";
  }
  svg << "<text x=\"" << kLeft << "\" y=\"" << kLine * lines + 16
      << "\" fill=\"#5a6572\">" << Number(low, kMetrics[m].decimals)
      << "</text><text x=\"" << kLeft + kWidth << "\" y=\""
      << kLine * lines + 16 << "\" text-anchor=\"end\" fill=\"#5a6572\">"
      << Number(high, kMetrics[m].decimals) << "</text>\n</svg>\n";
  return svg.str();
}

// What the figures are of.
std::string Origin(const Results& results) {
  std::string text = "sweepfit " + results.plan["version"].get<std::string>() +
                     ": " + std::to_string(results.rows.size()) + " of " +
                     std::to_string(results.plan["runs"].size()) + " runs.";
  if (results.others > 0) {
    text += " " + std::to_string(results.others) +
            " runs of another build or of other settings are left out.";
  }
  return text;
}

std::string Settings(const Json& plan) {
  std::string text;
  for (const Json& variant : plan["variants"]) {
    text += "- `" + variant["name"].get<std::string>() + "`:";
    for (const Json& setting : variant["settings"]) {
      text += " `" + setting.get<std::string>() + "`";
    }
    text += variant["settings"].empty() ? " defaults\n" : "\n";
  }
  return text;
}

}  // namespace

void ReportExperiment(const fs::path& folder) {
  if (!fs::exists(folder / "experiment.json") ||
      !fs::is_directory(folder / "runs")) {
    throw InputError(folder.string() + ": holds no experiment");
  }
  const Results results = [&] {
    try {
      return ReadResults(folder);
    } catch (const Json::exception& error) {
      throw InputError(folder.string() +
                       ": a run's file is damaged: " + error.what());
    }
  }();
  if (results.samples.empty()) {
    throw InputError(folder.string() +
                     ": no run of this build and these "
                     "settings has scores yet");
  }
  std::string lines;
  for (const Json& row : results.rows) lines += row.dump() + "\n";
  WriteWholeFile(lines, (folder / "results.jsonl").string());
  const Table samples = SamplesTable(results);
  WriteWholeFile(ToCsv(samples), (folder / "results.csv").string());

  const std::string name = results.plan["name"];
  const std::string question = results.plan["question"];
  std::string markdown = "# Experiment " + name + "\n\n";
  std::string html =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<title>" +
      EscapeHtml(name) +
      "</title><style>body{font:15px/1.5 system-ui,sans-serif;margin:2rem}"
      "table{border-collapse:collapse;font-size:13px}th,td{text-align:left;"
      "padding:.2rem .8rem .2rem 0;border-bottom:1px solid #e6e9ed;"
      "vertical-align:top}</style></head><body>\n<h1>Experiment " +
      EscapeHtml(name) + "</h1>\n<p>" + EscapeHtml(question) + "</p>\n<p>" +
      EscapeHtml(Origin(results)) + "</p>\n";
  if (!question.empty()) markdown += question + "\n\n";
  markdown += Origin(results) + "\n\n";
  markdown += Settings(results.plan) + "\n";
  std::vector<Table> tables = {MeansTable(results)};
  if (results.variants.size() > 1) tables.push_back(DifferencesTable(results));
  for (const Table& table : tables) {
    markdown += ToMarkdown(table);
    html += ToHtml(table);
  }
  for (int m = 0; m < kNumMetrics; ++m) html += DotPlot(results, m);
  markdown += ToMarkdown(samples);
  html += ToHtml(samples) + "</body></html>\n";
  WriteWholeFile(markdown, (folder / "report.md").string());
  WriteWholeFile(html, (folder / "report.html").string());
}

}  // namespace sweepfit
