// SPDX-License-Identifier: Apache-2.0
#include "model/anthropometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "model/embedded_data.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string DefaultText() {
  return std::string(EmbeddedData("anthropometry.yaml"));
}

// The default tables with one piece of text replaced.
std::string Edited(const std::string& from, const std::string& to) {
  std::string text = DefaultText();
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string ErrorOf(const std::string& text) {
  try {
    Anthropometry::Parse(text, "table.yaml");
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(AnthropometryTest, DefaultTableHasThePublishedNumbers) {
  const Anthropometry& tables = Anthropometry::Default();
  EXPECT_DOUBLE_EQ(tables.bone[kLElbow].mean_male, 0.163);
  EXPECT_DOUBLE_EQ(tables.bone[kLElbow].mean_female, 0.162);
  EXPECT_DOUBLE_EQ(tables.bone[kRKnee].Mean(0.5), 0.233);
  EXPECT_DOUBLE_EQ(tables.bone[kLAnkle].Mean(1), 0.239);
  EXPECT_DOUBLE_EQ(tables.bone[kLAnkle].Mean(0), 0.247);
  EXPECT_DOUBLE_EQ(tables.bone[kSpine].Sigma(), std::hypot(0.010, 0.012));
}

TEST(AnthropometryTest, LeftAndRightShareAnEntry) {
  const Anthropometry& tables = Anthropometry::Default();
  for (int joint = 1; joint < kNumJoints; ++joint) {
    const BoneStatistics& a = tables.bone[joint];
    const BoneStatistics& b = tables.bone[MirrorJoint(joint)];
    EXPECT_EQ(a.mean_male, b.mean_male);
    EXPECT_EQ(a.mean_female, b.mean_female);
    EXPECT_EQ(a.Sigma(), b.Sigma());
    EXPECT_GT(a.mean_male, 0);
  }
}

TEST(AnthropometryTest, HeightsAddUpToStature) {
  // Legs (ankle height .0415/.0385 of stature), trunk, neck and head.
  for (const double sex : {0.0, 1.0}) {
    const Anthropometry& tables = Anthropometry::Default();
    double height = sex == 1 ? 0.0415 : 0.0385;
    for (const int joint : {kLAnkle, kLKnee, kSpine, kNeck, kHead, kHeadEnd}) {
      height += tables.bone[joint].Mean(sex);
    }
    EXPECT_NEAR(height, 1, 0.01) << sex;
  }
}

TEST(AnthropometryTest, GirthsOfTheMeanPerson) {
  // Mean mass and stature give about the mean girths of the survey (ANSUR II).
  const Anthropometry& tables = Anthropometry::Default();
  EXPECT_NEAR(tables.chest.Girth(1, 85.5, 1.7562), 1.059, 0.011);
  EXPECT_NEAR(tables.waist.Girth(1, 85.5, 1.7562), 0.941, 0.015);
  EXPECT_NEAR(tables.buttock.Girth(0, 67.8, 1.6285), 1.021, 0.011);
  EXPECT_NEAR(tables.thigh.Girth(0, 67.8, 1.6285), 0.616, 0.011);
  EXPECT_NEAR(tables.calf.Girth(1, 85.5, 1.7562), 0.392, 0.006);
  EXPECT_NEAR(tables.neck.Girth(0, 67.8, 1.6285), 0.330, 0.006);
  EXPECT_NEAR(tables.ankle.Girth(1, 85.5, 1.7562), 0.229, 0.005);
  const double male = tables.chest.Girth(1, 70, 1.7);
  const double female = tables.chest.Girth(0, 70, 1.7);
  EXPECT_NEAR(
      tables.chest.Girth(0.5, 70, 1.7), std::sqrt(male * female), 1e-12);
}

TEST(AnthropometryTest, ErrorsNameFileLineAndKey) {
  EXPECT_EQ(ErrorOf(DefaultText()), "no error");
  EXPECT_THAT(ErrorOf(Edited("  elbow:", "  ellbow:")),
              AllOf(HasSubstr("table.yaml:"),
                    HasSubstr("bones"),
                    HasSubstr("unknown key 'ellbow'")));
  EXPECT_THAT(ErrorOf(Edited("male: 0.098, ", "")),
              AllOf(HasSubstr("bones.spine"), HasSubstr("misses 'male'")));
  EXPECT_THAT(ErrorOf(Edited("male: 0.098", "male: tall")),
              HasSubstr("'male' is not a number"));
  EXPECT_THAT(ErrorOf(Edited("male: 0.098", "male: .nan")),
              HasSubstr("'male' is not a number"));
  EXPECT_THAT(ErrorOf(Edited("male: 0.098", "male: -0.1")),
              HasSubstr("'male' is not positive"));
  EXPECT_THAT(
      ErrorOf(Edited("a: 4.983", "alpha: 4.983")),
      AllOf(HasSubstr("girths.chest.male"), HasSubstr("unknown key 'alpha'")));
  EXPECT_THAT(ErrorOf(Edited("girths:", "girth:")),
              HasSubstr("unknown key 'girth'"));
  EXPECT_THAT(ErrorOf("bones: [1, 2\n"), HasSubstr("table.yaml:"));
  EXPECT_THAT(ErrorOf(""), HasSubstr("is not a table"));
  EXPECT_THAT(ErrorOf("a: {b: 1}\na: {b: 2}\n"), HasSubstr("'a' twice"));
}

TEST(AnthropometryTest, ErrorLineIsWhereTheKeyStands) {
  const std::string text = Edited("  elbow:", "  ellbow:");
  const std::size_t at = text.find("  ellbow:");
  const auto line = 1 + std::count(text.begin(), text.begin() + at, '\n');
  EXPECT_THAT(ErrorOf(text),
              HasSubstr("table.yaml:" + std::to_string(line) + ":"));
}

}  // namespace
}  // namespace sweepfit
