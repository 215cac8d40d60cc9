// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace sweepfit {

// Receives what a long run is doing. Stages call it from one thread; a null
// pointer means that nobody listens.
class Progress {
 public:
  virtual ~Progress() = default;
  // A stage begins, e.g. Stage("volume", "A").
  virtual void Stage(const std::string& stage, const std::string& detail) = 0;
  // Something that a person should know although the run goes on.
  virtual void Warning(const std::string& text) = 0;
};

}  // namespace sweepfit
