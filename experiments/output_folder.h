// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace sweepfit {

// A name beside `path` under which to work on it: hidden, and of this host and
// process alone, since machines may share a folder. What dead processes of this
// host have left under such names of `path` is removed.
std::filesystem::path TemporarySibling(const std::filesystem::path& path);

// A folder that appears whole or not at all. Everything is written into a
// temporary sibling, which takes the folder's name at the end. A run that dies
// leaves no half result that looks whole.
class OutputFolder {
 public:
  // Creates the temporary sibling, so that an output that cannot be written is
  // found before the work starts. A folder that exists may be replaced when it
  // is empty or holds `marker`, a file that only earlier outputs of the same
  // kind have. Throws InputError naming the folder otherwise.
  OutputFolder(const std::filesystem::path& folder, const std::string& marker);
  // Removes what was not committed.
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  // Where to write until Commit.
  const std::filesystem::path& temporary() const { return temporary_; }
  // Gives the temporary folder its final name. InputError when that fails.
  void Commit();

 private:
  std::filesystem::path folder_;
  std::filesystem::path temporary_;
};

}  // namespace sweepfit
