// SPDX-License-Identifier: Apache-2.0
#include "experiments/output_folder.h"

#include <unistd.h>

#include <fstream>
#include <system_error>

#include "model/input_error.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

void CheckReplaceable(const fs::path& folder, const std::string& marker) {
  std::error_code error;
  if (!fs::exists(folder, error)) return;
  if (!fs::is_directory(folder, error)) {
    throw InputError(folder.string() + ": exists and is not a folder");
  }
  const bool empty = fs::is_empty(folder, error);
  if (error) throw InputError(folder.string() + ": " + error.message());
  if (!empty && !fs::exists(folder / marker, error)) {
    throw InputError(folder.string() + ": exists and has no " + marker +
                     ", so it is not replaced; name another folder");
  }
}

void CheckWritable(const fs::path& temporary, const fs::path& folder) {
  const fs::path probe = temporary / "probe";
  std::ofstream file(probe);
  file << "probe";
  file.close();
  if (!file) throw InputError(folder.string() + ": cannot write there");
  fs::remove(probe);
}

}  // namespace

OutputFolder::OutputFolder(const fs::path& folder, const std::string& marker) {
  if (folder.empty()) throw InputError("the output folder has no name");
  std::error_code error;
  folder_ = fs::weakly_canonical(fs::absolute(folder), error);
  if (error) throw InputError(folder.string() + ": " + error.message());
  if (!folder_.has_filename()) folder_ = folder_.parent_path();
  if (!folder_.has_filename()) {
    throw InputError(folder.string() + ": cannot be an output folder");
  }
  CheckReplaceable(folder_, marker);
  temporary_ = Sibling("partial");
  fs::remove_all(temporary_, error);
  fs::create_directories(temporary_, error);
  if (error) {
    throw InputError(folder.string() +
                     ": cannot write there: " + error.message());
  }
  try {
    CheckWritable(temporary_, folder_);
  } catch (...) {
    fs::remove_all(temporary_, error);
    throw;
  }
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  if (!temporary_.empty()) fs::remove_all(temporary_, ignored);
}

fs::path OutputFolder::Sibling(const std::string& suffix) const {
  // The process id keeps two runs with the same output apart.
  return folder_.parent_path() / ("." + folder_.filename().string() + "." +
                                  suffix + "-" + std::to_string(getpid()));
}

void OutputFolder::Commit() {
  std::error_code error;
  const fs::path previous = Sibling("previous");
  const bool replaces = fs::exists(folder_, error);
  if (replaces) fs::rename(folder_, previous, error);
  if (!error) {
    fs::rename(temporary_, folder_, error);
    std::error_code ignored;
    if (error && replaces) fs::rename(previous, folder_, ignored);
  }
  if (error) {
    throw InputError(folder_.string() +
                     ": cannot be replaced: " + error.message());
  }
  temporary_.clear();
  if (replaces) fs::remove_all(previous, error);
}

}  // namespace sweepfit
