// SPDX-License-Identifier: Apache-2.0
#include "model/joint_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "model/file_io.h"
#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::vector<std::string> NamesOf(const std::string& preset,
                                 const std::string& prefix = "") {
  std::vector<std::string> names = {"Armature"};
  for (const JointNameMap& map : JointNamePresets()) {
    if (map.name != preset) continue;
    for (const auto& wanted : map.names) {
      if (!wanted.empty()) names.push_back(prefix + wanted.front());
    }
  }
  return names;
}

std::string ErrorOf(const std::vector<std::string>& names,
                    const std::string& choice) {
  try {
    MatchJointNames(names, choice, "walk.bvh");
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(JointNamesTest, EveryPresetFindsItsOwnNames) {
  ASSERT_GE(JointNamePresets().size(), 4u);
  for (const JointNameMap& map : JointNamePresets()) {
    for (const std::string& choice : {std::string("auto"), map.name}) {
      const std::vector<std::string> names = NamesOf(map.name);
      const JointMatch match = MatchJointNames(names, choice, "walk.bvh");
      for (int joint = 0; joint < kNumJoints; ++joint) {
        if (map.names[joint].empty()) continue;
        ASSERT_GE(match.index[joint], 0) << map.name << kJointNames[joint];
        EXPECT_EQ(names[match.index[joint]], map.names[joint].front());
      }
    }
  }
}

TEST(JointNamesTest, PrefixesAndSpellingDoNotMatter) {
  const auto plain = MatchJointNames(NamesOf("mixamo"), "mixamo", "").index;
  for (const char* prefix :
       {"mixamorig:", "mixamorig1:", "mixamorig", "a|b:", "Character1_"}) {
    EXPECT_EQ(MatchJointNames(NamesOf("mixamo", prefix), "auto", "").index,
              plain)
        << prefix;
  }
  std::vector<std::string> names = NamesOf("unreal");
  for (std::string& name : names) {
    for (char& c : name) c = c == '_' ? ' ' : std::toupper(c);
  }
  EXPECT_EQ(MatchJointNames(names, "auto", "").map, "unreal");
}

TEST(JointNamesTest, UnmappedJointsAreListed) {
  std::vector<std::string> names = NamesOf("makehuman");
  std::erase(names, "lowerarm01.L");
  std::erase(names, "head");
  EXPECT_THAT(ErrorOf(names, "auto"),
              AllOf(HasSubstr("walk.bvh"),
                    HasSubstr("'makehuman'"),
                    HasSubstr("l_elbow (sought as lowerarm01.L)"),
                    HasSubstr("head (sought as head)")));
}

TEST(JointNamesTest, UnknownPresetListsThoseThereAre) {
  EXPECT_THAT(ErrorOf(NamesOf("cmu"), "acclaim"),
              AllOf(HasSubstr("'acclaim'"), HasSubstr("makehuman")));
}

class JointNameFileTest : public ::testing::Test {
 protected:
  std::string ErrorOfFile(const std::string& text) const {
    WriteWholeFile(text, path_);
    return ErrorOf(NamesOf("sweepfit"), path_);
  }
  TemporaryFolder folder_;
  std::string path_ = (folder_.path() / "map.yaml").string();
};

TEST_F(JointNameFileTest, MapsAsItSays) {
  std::string text;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    const std::string ours(kJointNames[joint]);
    text += ours + ": [nobody, bone_" + ours + "]\n";
  }
  WriteWholeFile(text, path_);
  std::vector<std::string> names;
  for (const std::string_view joint : kJointNames) {
    names.push_back("bone_" + std::string(joint));
  }
  const JointMatch match = MatchJointNames(names, path_, "walk.bvh");
  for (int joint = 0; joint < kNumJoints; ++joint) {
    EXPECT_EQ(match.index[joint], joint);
  }
}

TEST_F(JointNameFileTest, FaultsAreNamedWithFileAndLine) {
  EXPECT_THAT(ErrorOfFile("root: root\ntail: x\n"),
              HasSubstr(path_ + ":2: no joint is called 'tail'"));
  EXPECT_THAT(ErrorOfFile("root: {}\n"),
              HasSubstr(path_ + ":1: 'root' needs a name"));
  EXPECT_THAT(ErrorOfFile("root: []\n"), HasSubstr("has no name"));
  EXPECT_THAT(ErrorOfFile("root: a\nroot: b\n"), HasSubstr("twice"));
  EXPECT_THAT(ErrorOfFile("- root\n"), HasSubstr("a line per joint"));
  EXPECT_THAT(ErrorOfFile("root: [a\n"), HasSubstr("not YAML"));
  EXPECT_THAT(ErrorOfFile("root: root\n"), HasSubstr("unmapped: neck"));
  EXPECT_THAT(ErrorOf(NamesOf("cmu"), "./nowhere.yaml"),
              HasSubstr("./nowhere.yaml"));
}

TEST_F(JointNameFileTest, OneJointCannotBeTwo) {
  std::string text;
  for (const std::string_view joint : kJointNames) {
    text += std::string(joint) + ": " +
            (joint == "l_knee" ? "l_hip" : std::string(joint)) + "\n";
  }
  EXPECT_THAT(ErrorOfFile(text), HasSubstr("'l_hip' is mapped to both"));
}

}  // namespace
}  // namespace sweepfit
