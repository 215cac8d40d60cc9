// SPDX-License-Identifier: Apache-2.0
#include "solver/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/input_error.h"

namespace sweepfit {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

std::string ParseError(const std::string& text) {
  FitConfig config;
  try {
    ParseFitConfig(text, "my.yaml", &config);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

std::string SettingError(const std::string& setting) {
  FitConfig config;
  try {
    ApplySetting(setting, &config);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Config, EmptyFileKeepsDefaults) {
  FitConfig config;
  ParseFitConfig("", "my.yaml", &config);
  ParseFitConfig("# nothing\n", "my.yaml", &config);
  EXPECT_EQ(FitConfigToYaml(config), FitConfigToYaml(FitConfig()));
}

TEST(Config, ReadsNestedKeysAndLeavesOthersAlone) {
  FitConfig config;
  ParseFitConfig(
      "joints:\n  weights: {anthropometric: 0.3}\n  mode: simplex\n"
      "refine: {enabled: false}\ntexture:\n  size: 512\n"
      "poses: [A, T]\ncameras: [cam00]\n",
      "my.yaml",
      &config);
  EXPECT_EQ(config.options.joints.weights.anthropometric, 0.3);
  EXPECT_EQ(config.options.joints.weights.landmark, 1);
  EXPECT_EQ(config.options.joints.mode, "simplex");
  EXPECT_FALSE(config.options.refine.enabled);
  EXPECT_EQ(config.options.texture.size, 512);
  EXPECT_THAT(*config.poses, ElementsAre("A", "T"));
  EXPECT_THAT(*config.cameras, ElementsAre("cam00"));
}

TEST(Config, WrittenConfigReadsBackExactly) {
  FitConfig config;
  config.options.volume.voxel_size = 1.0 / 3.0;
  config.options.joints.template_sigma = 1e-17;
  config.options.segment.grow_ratio = 123456789.125;
  config.options.until = "local";
  config.options.refine.enabled = false;
  config.poses = {"A", "odd: name", "123"};
  const std::string text = FitConfigToYaml(config);
  FitConfig again;
  ParseFitConfig(text, "my.yaml", &again);
  EXPECT_EQ(again.options.volume.voxel_size, 1.0 / 3.0);
  EXPECT_EQ(again.options.joints.template_sigma, 1e-17);
  EXPECT_EQ(again.options.until, "local");
  EXPECT_EQ(again.poses, config.poses);
  EXPECT_FALSE(again.cameras.has_value());
  EXPECT_EQ(FitConfigToYaml(again), text);
}

TEST(Config, EveryKeyCanBeSetToItsDefault) {
  const std::vector<ConfigKey> keys = ConfigKeys();
  ASSERT_GT(keys.size(), 10u);
  FitConfig config;
  for (const ConfigKey& key : keys) {
    EXPECT_NO_THROW(ApplySetting(key.key + "=" + key.default_value, &config))
        << key.key;
    EXPECT_FALSE(key.meaning.empty()) << key.key;
  }
  EXPECT_EQ(FitConfigToYaml(config), FitConfigToYaml(FitConfig()));
}

TEST(Config, ErrorsNameFileLineAndKey) {
  EXPECT_THAT(ParseError("until: local\njoints:\n  wieghts: 3\n"),
              AllOf(HasSubstr("my.yaml:3:"), HasSubstr("'joints.wieghts'")));
  EXPECT_THAT(ParseError("volume: 4\n"),
              AllOf(HasSubstr("my.yaml:1:"), HasSubstr("'volume'")));
  EXPECT_THAT(ParseError("volume:\n  voxel_size: 4 mm\n"),
              AllOf(HasSubstr("my.yaml:2:"),
                    HasSubstr("'volume.voxel_size'"),
                    HasSubstr("4 mm")));
  EXPECT_THAT(ParseError("volume: {voxel_size: [1]}\n"),
              HasSubstr("single value"));
  EXPECT_THAT(ParseError("texture: {size: 10.5}\n"), HasSubstr("whole number"));
  EXPECT_THAT(ParseError("refine: {enabled: 1}\n"), HasSubstr("true or false"));
  EXPECT_THAT(ParseError("volume: {voxel_size: .nan}\n"),
              HasSubstr("must be a number"));
  EXPECT_THAT(ParseError("volume: {voxel_size: inf}\n"),
              HasSubstr("must be a number"));
  EXPECT_THAT(ParseError("until: local\nuntil: joints\n"),
              AllOf(HasSubstr("my.yaml:2:"), HasSubstr("twice")));
  EXPECT_THAT(ParseError("joints: {mode: [\n"),
              AllOf(HasSubstr("my.yaml"), HasSubstr("malformed")));
  EXPECT_THAT(ParseError("- a\n- b\n"), HasSubstr("my.yaml"));
  EXPECT_THAT(ParseError("poses: {A: 1}\n"), HasSubstr("'poses'"));
  EXPECT_THAT(ParseError("until: local\nvolume: {voxel_size: x}\n"),
              Not(HasSubstr("\n")));
}

TEST(Config, SettingsOverrideOneKey) {
  FitConfig config;
  ApplySetting("joints.weights.anthropometric=0.25", &config);
  ApplySetting("until=joints", &config);
  ApplySetting("cameras=cam00,cam02", &config);
  EXPECT_EQ(config.options.joints.weights.anthropometric, 0.25);
  EXPECT_EQ(config.options.until, "joints");
  EXPECT_THAT(*config.cameras, ElementsAre("cam00", "cam02"));
}

TEST(Config, BadSettingsAreNamed) {
  EXPECT_THAT(
      SettingError("joints.weight.landmark=1"),
      AllOf(HasSubstr("unknown key"), HasSubstr("joints.weight.landmark")));
  EXPECT_THAT(SettingError("until"), HasSubstr("key=value"));
  EXPECT_THAT(SettingError("=3"), HasSubstr("key=value"));
  EXPECT_THAT(SettingError("volume.voxel_size="), HasSubstr("key=value"));
  EXPECT_THAT(SettingError("volume.voxel_size=big"),
              HasSubstr("must be a number"));
  EXPECT_THAT(SettingError("volume=3"), HasSubstr("group"));
}

TEST(Config, MissingFileIsAnInputError) {
  FitConfig config;
  EXPECT_THROW(LoadFitConfig("no/such/fit.yaml", &config), InputError);
  EXPECT_THROW(LoadFitConfig(testing::TempDir(), &config), InputError);
}

TEST(Config, StagesAreOrdered) {
  EXPECT_EQ(FindFitStage("segment"), 0);
  EXPECT_EQ(FindFitStage("nonsense"), -1);
  FitOptions options;
  options.until = "joints";
  EXPECT_TRUE(RunsStage(options, "volume"));
  EXPECT_TRUE(RunsStage(options, "joints"));
  EXPECT_FALSE(RunsStage(options, "global"));
}

}  // namespace
}  // namespace sweepfit
