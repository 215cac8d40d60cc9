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
