// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

namespace sweepfit {

// One of `num_labels` labels for every node of a graph: approximately least
//   sum_nodes unary[node][label]
//   + sum_edges smoothness * min(|label difference|, truncation),
// by synchronous min-sum belief propagation. unary is row-major; the result are
// the beliefs (unary plus all messages), row-major as well.
std::vector<float> PropagateBeliefs(
    int num_labels,
    const std::vector<float>& unary,
    const std::vector<std::pair<int, int>>& edges,
    float smoothness,
    float truncation,
    int iterations);

}  // namespace sweepfit
