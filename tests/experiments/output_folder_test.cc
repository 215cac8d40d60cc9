// SPDX-License-Identifier: Apache-2.0
#include "experiments/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

constexpr char kMarker[] = "marker.json";

size_t NumEntries(const fs::path& folder) {
  return std::distance(fs::directory_iterator(folder),
                       fs::directory_iterator());
}

TEST(OutputFolder, AppearsOnCommitOnly) {
  TemporaryFolder scratch;
  const fs::path out = scratch.path() / "deep" / "out";
  {
    OutputFolder output(out, kMarker);
    WriteBytes(output.temporary() / kMarker, "new");
    EXPECT_FALSE(fs::exists(out));
    output.Commit();
    EXPECT_EQ(ReadBytes(out / kMarker), "new");
  }
  EXPECT_TRUE(fs::exists(out / kMarker));
  EXPECT_EQ(NumEntries(out.parent_path()), 1u) << "something was left behind";
}

TEST(OutputFolder, LeavesNothingWithoutCommit) {
  TemporaryFolder scratch;
  {
    OutputFolder output(scratch.path() / "out", kMarker);
    WriteBytes(output.temporary() / kMarker, "half");
  }
  EXPECT_EQ(NumEntries(scratch.path()), 0u);
}

TEST(OutputFolder, RemovesWhatDeadRunsOfThisHostLeft) {
  TemporaryFolder scratch;
  const fs::path out = scratch.path() / "out";
  const std::string ours = TemporarySibling(out).string();
  const std::string prefix = ours.substr(0, ours.rfind('-') + 1);
  const std::string previous =
      std::string(prefix).replace(prefix.find("partial"), 7, "previous");
  // No process has this id: Linux counts to four million.
  const fs::path dead = prefix + "999999999";
  const fs::path alive = prefix + "1";
  const fs::path elsewhere = scratch.path() / ".out.partial-other-999999999";
  const fs::path of_another = scratch.path() / ".out2.partial-x-999999999";
  const fs::path only_copy = previous + "999999999";
  for (const fs::path& path : {dead, alive, elsewhere, of_another, only_copy}) {
    fs::create_directory(path);
    WriteBytes(path / "half", "done");
  }
  OutputFolder(out, kMarker);  // dies without commit
  EXPECT_FALSE(fs::exists(dead));
  for (const fs::path& path : {alive, elsewhere, of_another, only_copy}) {
    EXPECT_TRUE(fs::exists(path / "half")) << path;
  }
  fs::create_directory(out);
  OutputFolder(out, kMarker);
  EXPECT_FALSE(fs::exists(only_copy));
}

TEST(OutputFolder, ReplacesEarlierOutputsAndEmptyFolders) {
  TemporaryFolder scratch;
  const fs::path out = scratch.path() / "out";
  fs::create_directories(out / "old_part");
  WriteBytes(out / kMarker, "old");
  OutputFolder(out, kMarker);  // dies without commit
  EXPECT_EQ(ReadBytes(out / kMarker), "old");
  {
    OutputFolder output(out.string() + "/", kMarker);
    WriteBytes(output.temporary() / kMarker, "new");
    output.Commit();
  }
  EXPECT_EQ(ReadBytes(out / kMarker), "new");
  EXPECT_FALSE(fs::exists(out / "old_part"));
  EXPECT_EQ(NumEntries(scratch.path()), 1u);

  const fs::path empty = scratch.path() / "empty";
  fs::create_directory(empty);
  OutputFolder output(empty, kMarker);
  WriteBytes(output.temporary() / kMarker, "new");
  output.Commit();
  EXPECT_EQ(ReadBytes(empty / kMarker), "new");
}

TEST(OutputFolder, RefusesWhatIsNotItsOwn) {
  TemporaryFolder scratch;
  const fs::path foreign = scratch.path() / "photos";
  fs::create_directory(foreign);
  WriteBytes(foreign / "holiday.jpg", "dear");
  EXPECT_THROW(OutputFolder(foreign, kMarker), InputError);
  EXPECT_EQ(ReadBytes(foreign / "holiday.jpg"), "dear");
  EXPECT_THROW(OutputFolder(foreign / "holiday.jpg", kMarker), InputError);
  EXPECT_THROW(OutputFolder(foreign / "holiday.jpg" / "out", kMarker),
               InputError);
  EXPECT_THROW(OutputFolder("", kMarker), InputError);
  EXPECT_THROW(OutputFolder("/", kMarker), InputError);
  EXPECT_EQ(NumEntries(scratch.path()), 1u);
}

}  // namespace
}  // namespace sweepfit
