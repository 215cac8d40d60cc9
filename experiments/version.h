// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace sweepfit {

// Version of the program, as in CHANGELOG.md.
inline constexpr char kVersion[] = "0.1.0";

}  // namespace sweepfit
