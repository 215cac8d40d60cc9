// SPDX-License-Identifier: Apache-2.0
#include "model/export_names.h"

#include <cstddef>

#include "model/input_error.h"

namespace sweepfit {
namespace {

// Names of the axis, and of one arm and one leg with %S for Left or Right, %s
// for left or right and %c for l or r.
struct Preset {
  const char* name;
  std::array<const char*, 5> axis;
  std::array<const char*, 4> arm;
  std::array<const char*, 4> leg;
};

constexpr Preset kPresets[] = {
    {"sweepfit",
     {"root", "spine", "neck", "head", "head_end"},
     {"%c_shoulder", "%c_elbow", "%c_wrist", "%c_hand_end"},
     {"%c_hip", "%c_knee", "%c_ankle", "%c_foot_end"}},
    {"mixamo",
     {"mixamorig:Hips",
      "mixamorig:Spine",
      "mixamorig:Spine2",
      "mixamorig:Head",
      "mixamorig:HeadTop_End"},
     {"mixamorig:%SArm",
      "mixamorig:%SForeArm",
      "mixamorig:%SHand",
      "mixamorig:%SHand_End"},
     {"mixamorig:%SUpLeg",
      "mixamorig:%SLeg",
      "mixamorig:%SFoot",
      "mixamorig:%SToeBase"}},
    {"unity",
     {"Hips", "Spine", "Chest", "Head", "Head_End"},
     {"%SUpperArm", "%SLowerArm", "%SHand", "%SHand_End"},
     {"%SUpperLeg", "%SLowerLeg", "%SFoot", "%SToes"}},
    {"unreal",
     {"pelvis", "spine_01", "spine_03", "head", "head_end"},
     {"upperarm_%c", "lowerarm_%c", "hand_%c", "hand_end_%c"},
     {"thigh_%c", "calf_%c", "foot_%c", "ball_%c"}},
    {"vrm",
     {"hips", "spine", "chest", "head", "headEnd"},
     {"%sUpperArm", "%sLowerArm", "%sHand", "%sHandEnd"},
     {"%sUpperLeg", "%sLowerLeg", "%sFoot", "%sToes"}},
};

std::string OnSide(const char* pattern, bool left) {
  std::string name;
  for (const char* c = pattern; *c != 0; ++c) {
    if (*c != '%') {
      name += *c;
      continue;
    }
    ++c;
    if (*c == 'S') name += left ? "Left" : "Right";
    if (*c == 's') name += left ? "left" : "right";
    if (*c == 'c') name += left ? "l" : "r";
  }
  return name;
}

}  // namespace

const std::vector<std::string>& ExportNamePresets() {
  static const auto* names = [] {
    auto* list = new std::vector<std::string>;
    for (const Preset& preset : kPresets) list->push_back(preset.name);
    return list;
  }();
  return *names;
}

std::array<std::string, kNumJoints> ExportNames(const std::string& wanted) {
  std::string known;
  for (const Preset& preset : kPresets) {
    known += std::string(known.empty() ? "" : ", ") + preset.name;
    if (wanted != preset.name) continue;
    std::array<std::string, kNumJoints> names;
    for (std::size_t i = 0; i < preset.axis.size(); ++i) {
      names[kRoot + i] = preset.axis[i];
    }
    for (std::size_t i = 0; i < preset.arm.size(); ++i) {
      names[kLShoulder + i] = OnSide(preset.arm[i], true);
      names[kRShoulder + i] = OnSide(preset.arm[i], false);
      names[kLHip + i] = OnSide(preset.leg[i], true);
      names[kRHip + i] = OnSide(preset.leg[i], false);
    }
    return names;
  }
  throw InputError("joint names '" + wanted + "' are none of " + known);
}

}  // namespace sweepfit
