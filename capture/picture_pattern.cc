// SPDX-License-Identifier: Apache-2.0
#include "capture/picture_pattern.h"

#include <algorithm>
#include <cctype>
#include <regex>
#include <set>
#include <system_error>

#include "model/input_error.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kCamera = "{camera}";
constexpr std::string_view kPose = "{pose}";

std::string Quoted(std::string_view text) {
  std::string quoted;
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_') {
      quoted += '\\';
    }
    quoted += c;
  }
  return quoted;
}

// The pattern as a regular expression; the pose is its only group.
std::regex Compile(std::string_view pattern, const std::string& camera_id) {
  std::string text;
  bool has_pose = false;
  while (!pattern.empty()) {
    if (pattern.starts_with(kCamera)) {
      text += Quoted(camera_id);
      pattern.remove_prefix(kCamera.size());
    } else if (pattern.starts_with(kPose)) {
      text += has_pose ? "\\1" : "([^/]+)";
      has_pose = true;
      pattern.remove_prefix(kPose.size());
    } else {
      const char c = pattern.front();
      text += c == '*' ? "[^/]*" : c == '?' ? "[^/]" : Quoted({&c, 1});
      pattern.remove_prefix(1);
    }
  }
  return std::regex(text);
}

// Parts of the path that hold no sign of a pattern, and the rest.
void Split(const std::string& pattern, fs::path* base, std::string* rest) {
  const size_t sign = pattern.find_first_of("*?{");
  const size_t slash = pattern.rfind('/', sign);
  if (slash == std::string::npos) {
    *base = ".";
    *rest = pattern;
    return;
  }
  *base = slash == 0 ? "/" : pattern.substr(0, slash);
  *rest = pattern.substr(slash + 1);
}

// Files below the base, no deeper than the pattern, in order.
std::set<std::string> FilesBelow(const fs::path& base, int max_depth) {
  std::set<std::string> files;
  std::error_code error;
  fs::recursive_directory_iterator it(
      base,
      fs::directory_options::skip_permission_denied |
          fs::directory_options::follow_directory_symlink,
      error);
  for (; !error && it != fs::recursive_directory_iterator();
       it.increment(error)) {
    std::error_code ignored;
    if (it.depth() >= max_depth) it.disable_recursion_pending();
    if (it->is_regular_file(ignored)) {
      files.insert(it->path().lexically_relative(base).generic_string());
    }
  }
  return files;
}

// True when the id stands in the text as a word of its own.
bool HasWord(const std::string& text, const std::string& id) {
  const auto is_word = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0;
  };
  for (size_t at = text.find(id); at != std::string::npos;
       at = text.find(id, at + 1)) {
    const size_t end = at + id.size();
    if ((at == 0 || !is_word(text[at - 1])) &&
        (end == text.size() || !is_word(text[end]))) {
      return true;
    }
  }
  return false;
}

// How well a file's path names the camera: 0 not at all.
int NameScore(const fs::path& path, const std::string& id) {
  if (path.stem() == id) return 3;
  for (const fs::path& part : path.parent_path()) {
    if (part == id) return 2;
  }
  return HasWord(path.stem().string(), id) ? 1 : 0;
}

// The camera that the file's path names, "" for none.
std::string CameraOf(const fs::path& path,
                     const std::vector<std::string>& camera_ids) {
  int best = 0;
  std::string found;
  for (const std::string& id : camera_ids) {
    const int score = NameScore(path, id);
    if (score == 0 || score < best) continue;
    if (score == best) {
      throw InputError(path.string() + ": may be of camera " + found + " or " +
                       id + "; use {camera} in the pattern");
    }
    best = score;
    found = id;
  }
  return found;
}

}  // namespace

FoundPictures FindPictures(const std::string& pattern,
                           const std::vector<std::string>& camera_ids) {
  fs::path base;
  std::string rest;
  Split(pattern, &base, &rest);
  const int depth = static_cast<int>(std::count(rest.begin(), rest.end(), '/'));
  const std::set<std::string> files = FilesBelow(base, depth);
  FoundPictures found;
  const auto add = [&](const std::string& pose,
                       const std::string& camera,
                       const std::string& file) {
    const auto [it, is_new] = found[pose].emplace(camera, base / file);
    if (!is_new) {
      throw InputError((base / file).string() + ": the same camera " + camera +
                       (pose.empty() ? "" : " and pose " + pose) + " as " +
                       it->second.string());
    }
  };
  const bool names_camera = rest.find(kCamera) != std::string::npos;
  // Without {camera} one pass with any id will do.
  for (size_t c = 0; c < (names_camera ? camera_ids.size() : 1); ++c) {
    const std::regex expression =
        Compile(rest, names_camera ? camera_ids[c] : "");
    for (const std::string& file : files) {
      std::smatch match;
      if (!std::regex_match(file, match, expression)) continue;
      const std::string id =
          names_camera ? camera_ids[c] : CameraOf(base / file, camera_ids);
      if (id.empty()) continue;
      add(match.size() > 1 ? match[1].str() : "", id, file);
    }
  }
  if (found.empty()) {
    throw InputError(pattern + ": no picture of a camera has such a name");
  }
  return found;
}

}  // namespace sweepfit
