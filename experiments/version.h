// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace sweepfit {

// Version of the program, as in CHANGELOG.md, and what it was built from: the
// commit and, where the sources differ from it, a hash of the changes. For
// instance 0.1.0+88f97af3c2.changed-5e1f0a77b3; 0.1.0 alone when it was not
// built from a repository.
extern const char* const kVersion;

}  // namespace sweepfit
