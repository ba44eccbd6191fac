// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// Seconds of each part of an optimisation; `total` is optimisation alone.
struct Seconds {
  double total = 0.0;
  double linearize = 0.0;
  double analyze = 0.0;
  double factorize = 0.0;
  double solve = 0.0;
  double update = 0.0;  ///< retraction and chi2 of trial steps

  CAIRN_API static ResultFields<Seconds> fields();
};

}  // namespace cairn
