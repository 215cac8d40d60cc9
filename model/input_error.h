// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

namespace sweepfit {

// Bad input from the outside: a file, a key or an option that cannot be used.
// The message is one line that names the file and, where there is one, the
// key, camera or line. The command ends with status 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The input was sound but no body could be fitted. The message says why. The
// command ends with status 1.
class FitError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace sweepfit
