// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

namespace sweepfit {

// FNV-1a, 64 bit, over the bytes: the same on every machine. `basis` selects
// one of several hash functions.
inline constexpr std::uint64_t kFnvBasis = 0xcbf29ce484222325ULL;
inline std::uint64_t FnvHash(std::string_view bytes,
                             std::uint64_t basis = kFnvBasis) {
  std::uint64_t hash = basis;
  for (const char c : bytes) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  }
  return hash;
}

}  // namespace sweepfit
