// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// How long the steps of a run took.
class CAIRN_API StepTimes {
 public:
  explicit StepTimes(std::vector<double> seconds);
  std::size_t count() const { return sorted_.size(); }
  /// The smallest that a part of the steps does not exceed [s]; 0 without steps.
  double percentile(double part) const;

  static ResultFields<StepTimes> fields();

 private:
  std::vector<double> sorted_;
};

}  // namespace cairn
