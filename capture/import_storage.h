// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <initializer_list>
#include <opencv2/core/persistence.hpp>
#include <optional>
#include <string>
#include <vector>

namespace sweepfit {

// A file of cv::FileStorage (YAML, XML or JSON) whose top level is a map, read
// strictly. Sizes that a matrix announces are believed only when its data are
// there. Errors are InputErrors with file, line and key.
class StorageFile {
 public:
  explicit StorageFile(const std::filesystem::path& path);

  bool Has(const std::string& key) const;
  // The first of the keys that the file has, or "".
  std::string FirstOf(std::initializer_list<const char*> keys) const;
  // Numbers of a matrix, row by row, or of a list.
  std::vector<double> Numbers(const std::string& key) const;
  std::vector<double> Numbers(const std::string& key, size_t count) const;
  std::optional<double> Number(const std::string& key) const;
  std::vector<std::string> Texts(const std::string& key) const;
  // "file:line" of a key, "file" where it is not there.
  std::string Where(const std::string& key) const;

 private:
  std::filesystem::path path_;
  std::string text_;
  cv::FileStorage storage_;
};

}  // namespace sweepfit
