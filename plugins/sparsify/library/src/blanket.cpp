// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/blanket.hpp"

#include <numeric>

namespace cairn {

int DenseBlanket::size() const { return std::accumulate(node_sizes.begin(), node_sizes.end(), 0); }

std::vector<int> DenseBlanket::offsets() const {
  std::vector<int> begin{0};
  for (const int n : node_sizes) begin.push_back(begin.back() + n);
  return begin;
}

}  // namespace cairn
