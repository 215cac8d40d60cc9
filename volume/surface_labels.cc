// SPDX-License-Identifier: Apache-2.0
#include "volume/surface_labels.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

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

// Lowers f to min_j f(j) + slope |i - j|, where |i - j| <= reach and perhaps
// farther, by steps of 1, 2, 4, ...: any distance is a sum of some of them.
class LowerEnvelope {
 public:
  LowerEnvelope(int num_labels, float slope, int reach)
      : n_(num_labels), slope_(slope) {
    reach = std::min(reach, num_labels - 1);
    for (int step = 1, covered = 0; covered < reach; step *= 2) {
      steps_.push_back(step);
      covered += step;
    }
    margin_ = steps_.empty() ? 0 : steps_.back();
    for (auto& buffer : buffers_) {
      buffer.assign(n_ + 2 * margin_, std::numeric_limits<float>::infinity());
    }
  }
  // Where to put f.
  Eigen::Map<Eigen::ArrayXf> Values() { return At(0, 0); }
  Eigen::Map<Eigen::ArrayXf> Lower() {
    int now = 0;
    for (const int step : steps_) {
      At(1 - now, 0) = At(now, 0).min(At(now, -step).min(At(now, step)) +
                                      slope_ * static_cast<float>(step));
      now = 1 - now;
    }
    return At(now, 0);
  }

 private:
  Eigen::Map<Eigen::ArrayXf> At(int buffer, int shift) {
    return {&buffers_[buffer][margin_ + shift], n_};
  }

  int n_;
  float slope_;
  std::vector<int> steps_;
  int margin_ = 0;
  std::array<std::vector<float>, 2> buffers_;
};

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
  // The labels of a node or an edge.
  const auto row = [num_labels](std::vector<float>& values, int i) {
    return Eigen::Map<Eigen::ArrayXf>(
        &values[static_cast<size_t>(i) * num_labels], num_labels);
  };
  const auto read = [num_labels](const std::vector<float>& values, int i) {
    return Eigen::Map<const Eigen::ArrayXf>(
        &values[static_cast<size_t>(i) * num_labels], num_labels);
  };
  const int reach = static_cast<int>(std::ceil(truncation));
  for (int iteration = 0; iteration < iterations; ++iteration) {
    tbb::parallel_for(
        tbb::blocked_range<int>(0, num_nodes, 512),
        [&](const tbb::blocked_range<int>& range) {
          LowerEnvelope envelope(num_labels, smoothness, reach);
          for (int node = range.begin(); node < range.end(); ++node) {
            auto sum = row(next_belief, node);
            sum = read(unary, node);
            for (int e = in.first[node]; e < in.first[node + 1]; ++e) {
              // What the neighbour believes without what this node told it.
              auto values = envelope.Values();
              values = read(belief, in.from[e]) - read(message, in.reverse[e]);
              const float least = values.minCoeff();
              const float most = smoothness * truncation;
              auto out = row(next_message, e);
              out = (envelope.Lower() - least).min(most);
              sum += out;
            }
          }
        });
    message.swap(next_message);
    belief.swap(next_belief);
  }
  return belief;
}

}  // namespace sweepfit
