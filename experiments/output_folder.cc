// SPDX-License-Identifier: Apache-2.0
#include "experiments/output_folder.h"

#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <fstream>
#include <system_error>
#include <vector>

#include "model/input_error.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

constexpr char kPartial[] = "partial";
constexpr char kPrevious[] = "previous";

// What the name of a sibling begins with; the process id follows.
std::string SiblingPrefix(const fs::path& path, const std::string& kind) {
  char host[256] = "";
  gethostname(host, sizeof(host) - 1);
  return "." + path.filename().string() + "." + kind + "-" + host + "-";
}

fs::path Sibling(const fs::path& path, const std::string& kind) {
  return path.parent_path() /
         (SiblingPrefix(path, kind) + std::to_string(getpid()));
}

bool IsDead(const std::string& process_id) {
  pid_t id = 0;
  const char* end = process_id.data() + process_id.size();
  const auto parsed = std::from_chars(process_id.data(), end, id);
  if (parsed.ec != std::errc() || parsed.ptr != end || id <= 0) return false;
  return kill(id, 0) != 0 && errno == ESRCH;
}

// Removes the siblings of dead processes.
void RemoveLeftovers(const fs::path& path, const std::string& kind) {
  const std::string prefix = SiblingPrefix(path, kind);
  std::vector<fs::path> leftovers;
  std::error_code ignored;
  for (const auto& entry :
       fs::directory_iterator(path.parent_path(), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(prefix) && IsDead(name.substr(prefix.size()))) {
      leftovers.push_back(entry.path());
    }
  }
  for (const fs::path& leftover : leftovers) fs::remove_all(leftover, ignored);
}

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

fs::path TemporarySibling(const fs::path& path) {
  RemoveLeftovers(path, kPartial);
  return Sibling(path, kPartial);
}

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
  // Without the folder its earlier content may be the only one.
  if (fs::exists(folder_, error)) RemoveLeftovers(folder_, kPrevious);
  temporary_ = TemporarySibling(folder_);
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

void OutputFolder::Commit() {
  std::error_code error;
  const fs::path previous = Sibling(folder_, kPrevious);
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
