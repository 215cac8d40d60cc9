// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "capture/silhouette.h"
#include "model/body.h"
#include "solver/joints.h"
#include "volume/volume.h"

namespace sweepfit {

struct LocalOptions {
  std::string mode = "rim";  // rim | hull | paper
  std::optional<std::string> Check() const;
};

struct RefineOptions {
  bool enabled = true;
  std::optional<std::string> Check() const;
};

}  // namespace sweepfit
