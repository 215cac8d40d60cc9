// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include "model/skeleton.h"

namespace sweepfit {

// The names that another skeleton may have for each of our joints; none where a
// joint is left out.
struct JointNameMap {
  std::string name;  // of the preset or the file
  std::array<std::vector<std::string>, kNumJoints> names;
};

// The maps that come with the program (model/data/joint_names.yaml).
const std::vector<JointNameMap>& JointNamePresets();

// A map of a user: YAML with one key per joint, name or list of names. Throws
// InputError with file and line on unknown joints and on anything that is no
// name.
JointNameMap LoadJointNameMap(const std::string& path);

// Which of the other skeleton's joints are ours: an index per joint, -1: none.
struct JointMatch {
  std::string map;  // name of the map that was used
  std::array<int, kNumJoints> index;
};

// False for those that a skeleton can do without: spine and the five ends.
bool IsNeededJoint(int joint);

// Finds our joints among `names` by one map: `choice` is the name of a preset,
// the path of a map, or "auto" for the preset that finds all needed joints and
// most of the others. Throws InputError naming `source` and the joints that
// were not found.
JointMatch MatchJointNames(const std::vector<std::string>& names,
                           const std::string& choice,
                           const std::string& source);

}  // namespace sweepfit
