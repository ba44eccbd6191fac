// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/step_times.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/runtime/result_fields.hpp"

namespace cairn {

StepTimes::StepTimes(std::vector<double> seconds) : sorted_(std::move(seconds)) {
  std::ranges::sort(sorted_);
}

double StepTimes::percentile(double part) const {
  if (sorted_.empty()) return 0.0;
  const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(sorted_.size())));
  return sorted_[std::clamp<std::size_t>(rank, 1, sorted_.size()) - 1];
}

ResultFields<StepTimes> StepTimes::fields() {
  const auto of = [](double part) {
    return [part](const StepTimes& times) { return times.percentile(part); };
  };
  return ResultFields<StepTimes>()
      .figure("count", &StepTimes::count, "how many there were")
      .figure("median", of(0.5), "s", "that half of them do not exceed")
      .label("median")
      .figure("p95", of(0.95), "s", "that 95 % of them do not exceed")
      .label("95 %")
      .figure("p99", of(0.99), "s", "that 99 % of them do not exceed")
      .label("99 %")
      .figure("max", of(1.0), "s", "of the longest")
      .label("longest")
      .details();
}

}  // namespace cairn
