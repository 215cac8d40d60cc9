// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/joint_names.h"
#include "solver/config.h"
#include "tests/apps/command.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::SizeIs;

// The words at the beginnings of the lines below "Subcommands:".
std::vector<std::string> Subcommands(const std::string& help) {
  std::istringstream lines(help);
  std::vector<std::string> verbs;
  bool listed = false;
  for (std::string line; std::getline(lines, line);) {
    if (listed && line.size() > 2 && line.starts_with("  ") && line[2] != ' ') {
      verbs.push_back(line.substr(2, line.find(' ', 2) - 2));
    } else {
      listed = line == "Subcommands:" || (listed && line.starts_with("  "));
    }
  }
  return verbs;
}

// `verb` may be empty or of several words.
void ExpectHelpWithExample(const std::vector<std::string>& verb,
                           const TemporaryFolder& scratch) {
  std::vector<std::string> arguments = verb;
  arguments.push_back("--help");
  const CommandOutcome outcome = RunCommand(arguments, scratch.path());
  std::string example = "Example: sweepfit";
  for (const std::string& word : verb) example += " " + word;
  EXPECT_EQ(outcome.status, 0) << example;
  EXPECT_THAT(outcome.out, HasSubstr(example + " "));
  EXPECT_EQ(outcome.err, "");
  for (const std::string& word : Subcommands(outcome.out)) {
    std::vector<std::string> longer = verb;
    longer.push_back(word);
    ExpectHelpWithExample(longer, scratch);
  }
}

TEST(Usage, HelpOfEachVerbShowsAnExample) {
  TemporaryFolder scratch;
  ExpectHelpWithExample({}, scratch);
  const auto verbs = Subcommands(RunCommand({"--help"}, scratch.path()).out);
  EXPECT_THAT(verbs, IsSupersetOf({"fit", "animate", "experiment"}));
  EXPECT_THAT(verbs, SizeIs(9));
}

TEST(Usage, HelpNamesEveryPresetOfJointNames) {
  TemporaryFolder scratch;
  for (const char* verb : {"animate", "template"}) {
    const CommandOutcome help = RunCommand({verb, "--help"}, scratch.path());
    for (const JointNameMap& preset : JointNamePresets()) {
      EXPECT_THAT(help.out, HasSubstr(preset.name)) << verb;
    }
  }
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
