// SPDX-License-Identifier: Apache-2.0
#include "volume/surface_labels.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>

namespace sweepfit {
namespace {

// Directed edges by the node that they arrive at.
struct Incoming {
  std::vector<int> first;
  std::vector<int> from;     // node
  std::vector<int> reverse;  // the edge the other way
};

Incoming Direct(int num_nodes, const std::vector<std::pair<int, int>>& edges) {
  Incoming in;
  in.first.assign(num_nodes + 1, 0);
  for (const auto& [a, b] : edges) {
    ++in.first[a + 1];
    ++in.first[b + 1];
  }
  for (int v = 0; v < num_nodes; ++v) in.first[v + 1] += in.first[v];
  std::vector<int> next(in.first.begin(), in.first.end() - 1);
  in.from.resize(2 * edges.size());
  in.reverse.resize(2 * edges.size());
  for (const auto& [a, b] : edges) {
    const int to_a = next[a]++;
    const int to_b = next[b]++;
    in.from[to_a] = b;
    in.from[to_b] = a;
    in.reverse[to_a] = to_b;
    in.reverse[to_b] = to_a;
  }
  return in;
}

}  // namespace

std::vector<float> PropagateBeliefs(
    int num_labels,
    const std::vector<float>& unary,
    const std::vector<std::pair<int, int>>& edges,
    float smoothness,
    float truncation,
    int iterations) {
  const int num_nodes = static_cast<int>(unary.size()) / num_labels;
  const Incoming in = Direct(num_nodes, edges);
  std::vector<float> message(in.from.size() * num_labels, 0.f);
  std::vector<float> belief = unary;
  std::vector<float> next_message(message.size());
  std::vector<float> next_belief(belief.size());
  for (int iteration = 0; iteration < iterations; ++iteration) {
    tbb::parallel_for(
        tbb::blocked_range<int>(0, num_nodes, 512),
        [&](const tbb::blocked_range<int>& range) {
          for (int node = range.begin(); node < range.end(); ++node) {
            float* sum = &next_belief[static_cast<size_t>(node) * num_labels];
            std::copy_n(&unary[static_cast<size_t>(node) * num_labels],
                        num_labels,
                        sum);
            for (int e = in.first[node]; e < in.first[node + 1]; ++e) {
              // What the neighbour believes without what this node told it.
              const float* other =
                  &belief[static_cast<size_t>(in.from[e]) * num_labels];
              const float* told =
                  &message[static_cast<size_t>(in.reverse[e]) * num_labels];
              float* out = &next_message[static_cast<size_t>(e) * num_labels];
              float least = other[0] - told[0];
              for (int k = 0; k < num_labels; ++k) {
                out[k] = other[k] - told[k];
                least = std::min(least, out[k]);
              }
              for (int k = 1; k < num_labels; ++k) {
                out[k] = std::min(out[k], out[k - 1] + smoothness);
              }
              for (int k = num_labels - 2; k >= 0; --k) {
                out[k] = std::min(out[k], out[k + 1] + smoothness);
              }
              const float most = least + smoothness * truncation;
              for (int k = 0; k < num_labels; ++k) {
                out[k] = std::min(out[k], most) - least;
                sum[k] += out[k];
              }
            }
          }
        });
    message.swap(next_message);
    belief.swap(next_belief);
  }
  return belief;
}

}  // namespace sweepfit
