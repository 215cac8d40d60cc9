// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "model/body.h"

namespace sweepfit {

// body.json: the whole Body, numbers with as many digits as it takes to read
// the same double (up to 17), so that a body that was saved and loaded again
// poses to the same bytes. Members are those of Body by name; bones are keyed
// by the joint that ends them; `binding` has per vertex one to three rows
// [sweep, weight, u, theta, rho, tau]; `uv` has per quad u0 v0 .. u3 v3.
// Throws InputError with file and key.
void SaveBody(const Body& body, const std::string& path);
Body LoadBody(const std::string& path);

}  // namespace sweepfit
