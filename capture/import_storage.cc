// SPDX-License-Identifier: Apache-2.0
#include "capture/import_storage.h"

#include <algorithm>
#include <cctype>

#include "capture/import_camera.h"
#include "model/file_io.h"

namespace sweepfit {
namespace {

// OpenCV says "... path(12): what is wrong' ..." somewhere in its message.
[[noreturn]] void FailParsing(const std::filesystem::path& path,
                              const std::string& text) {
  const std::string start = path.string() + "(";
  const size_t begin = text.find(start);
  const size_t end = text.find("): ", begin);
  if (begin == std::string::npos || end == std::string::npos) {
    FailImport(path.string(), "not well-formed");
  }
  const size_t number = begin + start.size();
  std::string what = text.substr(end + 3);
  what.resize(std::min(what.find('\n'), what.size()));
  while (what.ends_with('\'')) what.pop_back();
  FailImport(path.string() + ":" + text.substr(number, end - number),
             "not well-formed: " + what);
}

double ToNumber(const cv::FileNode& node,
                const std::string& where,
                const std::string& key) {
  if (!node.isInt() && !node.isReal()) {
    FailImport(where, "'" + key + "' must hold numbers only");
  }
  return static_cast<double>(node);
}

}  // namespace

StorageFile::StorageFile(const std::filesystem::path& path)
    : path_(path), text_(ReadWholeFile(path.string())) {
  bool is_map = false;
  try {
    is_map = storage_.open(path.string(), cv::FileStorage::READ) &&
             storage_.root().isMap();
  } catch (const std::exception& error) {  // OpenCV's own, and what it meets
    FailParsing(path_, error.what());
  }
  if (!is_map) FailImport(path_.string(), "must hold keys and values");
}

bool StorageFile::Has(const std::string& key) const {
  return !storage_[key].empty();
}

std::string StorageFile::FirstOf(
    std::initializer_list<const char*> keys) const {
  for (const char* key : keys) {
    if (Has(key)) return key;
  }
  return "";
}

std::vector<double> StorageFile::Numbers(const std::string& key) const {
  const std::string where = Where(key);
  cv::FileNode node = storage_[key];
  if (node.empty()) FailImport(where, "no '" + key + "'");
  double announced = -1;
  if (node.isMap()) {
    announced = ToNumber(node["rows"], where, key + ".rows") *
                ToNumber(node["cols"], where, key + ".cols");
    node = node["data"];
  }
  std::vector<double> values;
  if (node.isSeq()) {
    for (const cv::FileNode& item : node) {
      values.push_back(ToNumber(item, where, key));
    }
  } else {
    values.push_back(ToNumber(node, where, key));
  }
  if (announced >= 0 && announced != static_cast<double>(values.size())) {
    FailImport(where, "'" + key + "' has not rows times cols numbers");
  }
  return values;
}

std::vector<double> StorageFile::Numbers(const std::string& key,
                                         size_t count) const {
  std::vector<double> values = Numbers(key);
  if (values.size() != count) {
    FailImport(Where(key),
               "'" + key + "' must have " + std::to_string(count) +
                   " numbers, not " + std::to_string(values.size()));
  }
  return values;
}

std::optional<double> StorageFile::Number(const std::string& key) const {
  if (!Has(key)) return std::nullopt;
  return ToNumber(storage_[key], Where(key), key);
}

std::vector<std::string> StorageFile::Texts(const std::string& key) const {
  const cv::FileNode node = storage_[key];
  if (!node.isSeq()) FailImport(Where(key), "no list '" + key + "'");
  std::vector<std::string> texts;
  for (const cv::FileNode& item : node) {
    if (item.isString()) {
      texts.push_back(item.string());
    } else if (item.isInt()) {
      texts.push_back(std::to_string(static_cast<int>(item)));
    } else {
      FailImport(Where(key), "'" + key + "' must hold names");
    }
  }
  return texts;
}

std::string StorageFile::Where(const std::string& key) const {
  const auto is_word = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  };
  for (size_t at = text_.find(key); at != std::string::npos;
       at = text_.find(key, at + 1)) {
    const size_t end = at + key.size();
    if (at > 0 && is_word(text_[at - 1])) continue;
    if (end < text_.size() && is_word(text_[end])) continue;
    const auto line =
        1 + std::count(text_.begin(),
                       text_.begin() + static_cast<std::ptrdiff_t>(at),
                       '\n');
    return path_.string() + ":" + std::to_string(line);
  }
  return path_.string();
}

}  // namespace sweepfit
