// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "block/ordering.hpp"
#include "cairn/plugin/option_fields.hpp"

namespace cairn {

struct BlockCholeskyOptions {
  std::string ordering = "auto";     ///< one of `block::every_ordering_name`
  std::string precision = "double";  ///< double or mixed: `block::RefinedCholesky`
  std::int64_t last = 0;             ///< variables at the end that are eliminated last
  std::string kernels = "auto";      ///< auto, portable, avx2 or avx512

  static auto fields() {
    using O = BlockCholeskyOptions;
    return OptionFields<O>()
        .choice("ordering", &O::ordering, block::every_ordering_name(),
                "fill-reducing ordering of the block graph; auto: by predicted flops")
        .integer("last", &O::last, 0, 1e9,
                 "variables at the end that are eliminated last, as incremental solvers need; "
                 "not with metis")
        .choice("precision", &O::precision, {"double", "mixed"},
                "mixed: factors in single precision and refines each solution to what double "
                "gives; by itself double where conditioning forbids that, and for covariances")
        .choice("kernels", &O::kernels, {"auto", "portable", "avx2", "avx512"},
                "instruction set, as far as the machine has it");
  }

  /// What `block::SupernodalCholesky::analyze` takes.
  std::string ordering_text() const {
    return last > 0 ? ordering + ",last=" + std::to_string(last) : ordering;
  }
};

}  // namespace cairn
