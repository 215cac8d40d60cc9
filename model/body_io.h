// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "model/body.h"

namespace sweepfit {

// body.json: the whole Body, doubles with 17 digits, so that a body that was
// saved and loaded again poses to the same bytes. Throws InputError with file
// and key.
void SaveBody(const Body& body, const std::string& path);
Body LoadBody(const std::string& path);

}  // namespace sweepfit
