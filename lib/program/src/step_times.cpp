// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/step_times.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/core.h>
#include <boost/json/object.hpp>

#include "cairn/program/table.hpp"

namespace cairn::app {

StepTimes::StepTimes(std::vector<double> seconds) : sorted_(std::move(seconds)) {
  std::ranges::sort(sorted_);
}

double StepTimes::percentile(double part) const {
  if (sorted_.empty()) return 0.0;
  const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(sorted_.size())));
  return sorted_[std::clamp<std::size_t>(rank, 1, sorted_.size()) - 1];
}

std::string StepTimes::text() const {
  return fmt::format("{}: median {}, 95 % {}, 99 % {}, longest {}", sorted_.size(),
                     seconds_text(percentile(0.5)), seconds_text(percentile(0.95)),
                     seconds_text(percentile(0.99)), seconds_text(percentile(1.0)));
}

boost::json::object step_times_json(const StepTimes& times) {
  return {{"count", times.count()},
          {"median", times.percentile(0.5)},
          {"p95", times.percentile(0.95)},
          {"p99", times.percentile(0.99)},
          {"max", times.percentile(1.0)}};
}

}  // namespace cairn::app
