// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace sweepfit {

// Text of the file model/data/<name> as it was when the library was built;
// empty if there is no such file.
std::string_view EmbeddedData(std::string_view name);

}  // namespace sweepfit
