// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace sweepfit {

// The upper median of values, which it reorders; 0 of none.
template <typename T>
T MedianInPlace(std::vector<T>* values) {
  if (values->empty()) return 0;
  const auto middle =
      values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

template <typename T>
T Median(std::vector<T> values) {
  return MedianInPlace(&values);
}

}  // namespace sweepfit
