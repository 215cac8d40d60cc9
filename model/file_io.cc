// SPDX-License-Identifier: Apache-2.0
#include "model/file_io.h"

#include <filesystem>
#include <fstream>
#include <iterator>

#include "model/input_error.h"

namespace sweepfit {

std::string ReadWholeFile(const std::string& path) {
  // A directory opens as a stream, but nothing can be read from it.
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    throw InputError(path + ": is a directory, not a file");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path + ": cannot be opened");
  std::string bytes{std::istreambuf_iterator<char>(file),
                    std::istreambuf_iterator<char>()};
  if (file.bad()) throw InputError(path + ": cannot be read");
  return bytes;
}

void WriteWholeFile(const std::string& bytes, const std::string& path) {
  std::error_code missing;
  const auto status = std::filesystem::status(path, missing);
  if (std::filesystem::is_character_file(status) ||
      std::filesystem::is_fifo(status)) {
    // A terminal or a pipe has no other name to be written under.
    std::ofstream stream(path, std::ios::binary);
    stream << bytes << std::flush;
    if (!stream) throw InputError(path + ": cannot be written");
    return;
  }
  const std::string temporary = path + ".part";
  std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(temporary, path, error);
  if (!file || error) {
    std::error_code ignored;
    std::filesystem::remove(temporary, ignored);
    throw InputError(path + ": cannot be written");
  }
}

}  // namespace sweepfit
