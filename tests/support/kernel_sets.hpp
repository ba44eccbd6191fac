// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "block/kernels.hpp"

namespace cairn::test {

/// Names of the sets of kernels that this machine can run.
inline std::vector<std::string> kernel_sets() {
  std::vector<std::string> sets;
  for (const char* name : {"portable", "avx2", "avx512"}) {
    if (block::choose_kernels(name)) sets.emplace_back(name);
  }
  return sets;
}

}  // namespace cairn::test
