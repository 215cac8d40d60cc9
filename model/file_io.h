// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace sweepfit {

// All bytes of a file. Throws InputError with the path.
std::string ReadWholeFile(const std::string& path);

// Writes a file under a temporary name beside it and renames it, so that no
// half file ever bears the name; into a terminal or a pipe (/dev/stdout) as it
// is. Throws InputError with the path.
void WriteWholeFile(const std::string& bytes, const std::string& path);

}  // namespace sweepfit
