// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace sweepfit {

// Pictures of a result folder that the page shows, by relative path.
struct ReportPictures {
  struct Picture {
    std::string path;
    std::string caption;
  };
  std::vector<Picture> renders;
  std::vector<Picture> overlays;
  std::string silhouettes;  // empty: none
  std::string texture;      // empty: none
};

// The page report.html from report.json and joints.json: no scripts, no
// outside resources, readable offline.
std::string ReportHtml(const nlohmann::ordered_json& report,
                       const nlohmann::ordered_json& joints,
                       const ReportPictures& pictures);

// Text with &, <, > and quotes made harmless.
std::string EscapeHtml(const std::string& text);

}  // namespace sweepfit
