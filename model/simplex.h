// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

namespace sweepfit {

// Few unknowns: weights of the joints that move one vertex.
inline constexpr int kMaxSimplexSize = 20;
using SimplexVector = std::array<double, kMaxSimplexSize>;
using SimplexMatrix = std::array<SimplexVector, kMaxSimplexSize>;
using SimplexSet = std::array<bool, kMaxSimplexSize>;

// Minimises f(w) = w^T (A + ridge I) w / 2 - b^T w over the first n entries,
// subject to sum w = 1, w >= 0, and w = 0 where not `allowed`, by a primal
// active-set method. A + ridge I must be symmetric positive definite.
//
// `w` holds where to start: the nearer, the faster. Any start with a positive
// sum over the allowed entries will do; with none all of them start alike.
// Returns f(w).
double SolveOnSimplex(const SimplexMatrix& A,
                      double ridge,
                      const SimplexVector& b,
                      int n,
                      const SimplexSet& allowed,
                      SimplexVector* w);

}  // namespace sweepfit
