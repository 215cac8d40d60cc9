// SPDX-License-Identifier: Apache-2.0
#include "model/file_io.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <future>

#include "model/input_error.h"
#include "tests/support/temporary_folder.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

TEST(FileIo, ReplacesAFileAndLeavesNoOther) {
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "a.txt").string();
  WriteWholeFile("first", path);
  WriteWholeFile("second", path);
  EXPECT_EQ(ReadWholeFile(path), "second");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(FileIo, WritesIntoAPipeInsteadOfReplacingIt) {
  const TemporaryFolder folder;
  const std::string pipe = (folder.path() / "pipe").string();
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  auto read =
      std::async(std::launch::async, [&] { return ReadWholeFile(pipe); });
  WriteWholeFile("{}\n", pipe);
  EXPECT_EQ(read.get(), "{}\n");
  EXPECT_TRUE(fs::is_fifo(pipe));
}

TEST(FileIo, WhatCannotBeReadOrWrittenIsNamed) {
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "none" / "a.txt").string();
  EXPECT_THROW(ReadWholeFile(path), InputError);
  EXPECT_THROW(WriteWholeFile("x", path), InputError);
  EXPECT_THROW(ReadWholeFile(folder.path().string()), InputError);
}

}  // namespace
}  // namespace sweepfit
