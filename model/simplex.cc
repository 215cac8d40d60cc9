// SPDX-License-Identifier: Apache-2.0
#include "model/simplex.h"

#include <algorithm>
#include <cmath>

namespace sweepfit {
namespace {

// The entries that are not at their bound.
struct FreeEntries {
  int count = 0;
  std::array<int, kMaxSimplexSize> index;
};

// Solves A z = b and A e = 1 for the free entries by a Cholesky factorisation.
void SolveFree(const SimplexMatrix& A,
               double ridge,
               const SimplexVector& b,
               const FreeEntries& free,
               SimplexVector* z,
               SimplexVector* e) {
  SimplexMatrix L;
  SimplexVector inverse;  // of the diagonal
  const int m = free.count;
  for (int r = 0; r < m; ++r) {
    for (int c = 0; c <= r; ++c) {
      double sum = A[free.index[r]][free.index[c]];
      for (int k = 0; k < c; ++k) sum -= L[r][k] * L[c][k];
      if (c < r) {
        L[r][c] = sum * inverse[c];
      } else {
        inverse[r] = 1 / std::sqrt(sum + ridge);
      }
    }
    double z_sum = b[free.index[r]], e_sum = 1;
    for (int k = 0; k < r; ++k) {
      z_sum -= L[r][k] * (*z)[k];
      e_sum -= L[r][k] * (*e)[k];
    }
    (*z)[r] = z_sum * inverse[r];
    (*e)[r] = e_sum * inverse[r];
  }
  for (int r = m - 1; r >= 0; --r) {
    for (int k = r + 1; k < m; ++k) {
      (*z)[r] -= L[k][r] * (*z)[k];
      (*e)[r] -= L[k][r] * (*e)[k];
    }
    (*z)[r] *= inverse[r];
    (*e)[r] *= inverse[r];
  }
}

// Makes `w` a point of the simplex.
void MakeFeasible(int n, const SimplexSet& allowed, SimplexVector* w) {
  double sum = 0, count = 0;
  for (int i = 0; i < n; ++i) {
    (*w)[i] = allowed[i] ? std::max(0.0, (*w)[i]) : 0;
    sum += (*w)[i];
    count += allowed[i] ? 1 : 0;
  }
  for (int i = 0; i < n; ++i) {
    if (sum > 0) {
      (*w)[i] /= sum;
    } else if (allowed[i]) {
      (*w)[i] = 1 / count;
    }
  }
}

// Gradient of f.
SimplexVector Gradient(const SimplexMatrix& A,
                       double ridge,
                       const SimplexVector& b,
                       int n,
                       const SimplexVector& w) {
  SimplexVector gradient;
  for (int i = 0; i < n; ++i) {
    gradient[i] = ridge * w[i] - b[i];
    for (int k = 0; k < n; ++k) gradient[i] += A[i][k] * w[k];
  }
  return gradient;
}

}  // namespace

double SolveOnSimplex(const SimplexMatrix& A,
                      double ridge,
                      const SimplexVector& b,
                      int n,
                      const SimplexSet& allowed,
                      SimplexVector* w) {
  MakeFeasible(n, allowed, w);
  SimplexSet is_free{};
  double scale = 0;
  for (int i = 0; i < n; ++i) {
    is_free[i] = (*w)[i] > 0;
    scale = std::max(scale, A[i][i] + ridge);
  }
  for (int iteration = 0; iteration < 8 * kMaxSimplexSize; ++iteration) {
    FreeEntries free;
    for (int i = 0; i < n; ++i) {
      if (is_free[i]) free.index[free.count++] = i;
    }
    // Minimum on the free entries with sum 1: A_ff w = b_f + nu 1.
    SimplexVector z, e;
    SolveFree(A, ridge, b, free, &z, &e);
    double z_sum = 0, e_sum = 0;
    for (int r = 0; r < free.count; ++r) {
      z_sum += z[r];
      e_sum += e[r];
    }
    const double nu = (1 - z_sum) / e_sum;
    // Go there, or to the first bound on the way.
    double step = 1;
    int blocking = -1;
    for (int r = 0; r < free.count; ++r) {
      z[r] += nu * e[r];
      const double current = (*w)[free.index[r]];
      if (z[r] < 0 && current < step * (current - z[r])) {
        step = current / (current - z[r]);
        blocking = free.index[r];
      }
    }
    for (int r = 0; r < free.count; ++r) {
      double& weight = (*w)[free.index[r]];
      weight += step * (z[r] - weight);
    }
    if (blocking >= 0) {
      (*w)[blocking] = 0;
      is_free[blocking] = false;
      continue;
    }
    // Optimal unless letting go of a bound lowers the cost.
    const SimplexVector gradient = Gradient(A, ridge, b, n, *w);
    int entering = -1;
    double most_negative = -1e-9 * scale;
    for (int i = 0; i < n; ++i) {
      if (is_free[i] || !allowed[i]) continue;
      if (gradient[i] - nu < most_negative) {
        most_negative = gradient[i] - nu;
        entering = i;
      }
    }
    if (entering < 0) break;
    is_free[entering] = true;
  }
  MakeFeasible(n, allowed, w);
  const SimplexVector gradient = Gradient(A, ridge, b, n, *w);
  double cost = 0;
  for (int i = 0; i < n; ++i) cost += 0.5 * (*w)[i] * (gradient[i] - b[i]);
  return cost;
}

}  // namespace sweepfit
