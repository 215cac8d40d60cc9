// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "solver/config.h"
#include "tests/apps/command.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

TEST(Usage, HelpOfEachVerbShowsAnExample) {
  TemporaryFolder scratch;
  for (const char* verb :
       {"fit", "synth", "demo", "evaluate", "import", "check", "template"}) {
    const CommandOutcome outcome = RunCommand({verb, "--help"}, scratch.path());
    EXPECT_EQ(outcome.status, 0) << verb;
    EXPECT_THAT(outcome.out,
                HasSubstr(std::string("Example: sweepfit ") + verb));
    EXPECT_EQ(outcome.err, "");
  }
  const CommandOutcome outcome = RunCommand({"--help"}, scratch.path());
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.out, HasSubstr("evaluate"));
}

TEST(Usage, HelpOfFitListsEveryConfigurationKey) {
  TemporaryFolder scratch;
  const std::string help = RunCommand({"fit", "--help"}, scratch.path()).out;
  for (const ConfigKey& key : ConfigKeys()) {
    EXPECT_THAT(help, HasSubstr(key.key + "=" + key.default_value));
  }
}

TEST(Usage, BadUsageIsOneLineAndStatusTwo) {
  TemporaryFolder scratch;
  struct Case {
    std::vector<std::string> arguments;
    const char* word;
  };
  for (const Case& bad :
       {Case{{}, "subcommand"},
        Case{{"fly"}, "fly"},
        Case{{"fit"}, "CAPTURE"},
        Case{{"fit", "a"}, "--out"},
        Case{{"fit", "a", "--out", "b", "--bogus"}, "bogus"},
        Case{{"fit", "a", "--out", "b", "--threads", "0"}, "--threads"},
        Case{{"fit", "a", "--out", "b", "--threads", "x"}, "--threads"},
        Case{{"evaluate", "a"}, "--capture"},
        Case{{"synth"}, "DIR"},
        Case{{"import", "colmap", "a"}, "DIR"},
        Case{{"import", "alien", "/", "b"}, "no calibration format"}}) {
    const CommandOutcome outcome = RunCommand(bad.arguments, scratch.path());
    SCOPED_TRACE(outcome.err);
    EXPECT_EQ(outcome.status, 2);
    ASSERT_THAT(outcome.ErrorLines(), SizeIs(1));
    EXPECT_THAT(outcome.ErrorLines()[0], HasSubstr(bad.word));
    EXPECT_EQ(outcome.err, outcome.ErrorLines()[0] + "\n");
  }
}

TEST(Usage, SynthRefusesBadOptionsAndForeignFolders) {
  TemporaryFolder scratch;
  const std::string folder = (scratch.path() / "synthetic").string();
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"synth", folder, "--cameras", "1"},
        {"synth", folder, "--poses", "Q"},
        {"synth", folder, "--size", "0"},
        {"synth", scratch.path().string()}}) {
    const CommandOutcome outcome = RunCommand(arguments, scratch.path());
    EXPECT_EQ(outcome.status, 2) << outcome.err;
    EXPECT_THAT(outcome.ErrorLines(), SizeIs(1));
    EXPECT_FALSE(std::filesystem::exists(folder));
  }
}

TEST(Usage, EvaluateNamesWhatIsMissing) {
  TemporaryFolder scratch;
  const CommandOutcome outcome = RunCommand(
      {"evaluate", "no_result", "--capture", "no_capture"}, scratch.path());
  EXPECT_EQ(outcome.status, 2);
  ASSERT_THAT(outcome.ErrorLines(), SizeIs(1));
  EXPECT_THAT(outcome.ErrorLines()[0], HasSubstr("no_capture"));
}

}  // namespace
}  // namespace sweepfit
