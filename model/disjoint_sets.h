// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace sweepfit {

// Sets of numbers that grow together (union-find with path halving); the
// smallest of a set stands for it.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  int Find(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }

  void Unite(int a, int b) {
    a = Find(a);
    b = Find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

  int Count() const {
    int count = 0;
    for (std::size_t i = 0; i < parent_.size(); ++i) {
      count += parent_[i] == static_cast<int>(i);
    }
    return count;
  }

 private:
  std::vector<int> parent_;
};

}  // namespace sweepfit
