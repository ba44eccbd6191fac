// SPDX-License-Identifier: BSD-3-Clause
#include "recovery_problem.hpp"

namespace cairn::sparsify {

std::vector<int> offsets(const DenseBlanket& blanket) {
  std::vector<int> begin{0};
  for (const int n : blanket.node_sizes) begin.push_back(begin.back() + n);
  return begin;
}

}  // namespace cairn::sparsify
