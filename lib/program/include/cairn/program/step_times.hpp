// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <boost/json/fwd.hpp>

namespace cairn::app {

/// How long the steps of a run took.
class StepTimes {
 public:
  explicit StepTimes(std::vector<double> seconds);
  std::size_t count() const { return sorted_.size(); }
  /// The smallest that a part of the steps does not exceed [s]; 0 without steps.
  double percentile(double part) const;
  /// "1000: median 12.3 µs, 95 % …, 99 % …, longest …"
  std::string text() const;

 private:
  std::vector<double> sorted_;
};

/// {"count", "median", "p95", "p99", "max"}
boost::json::object step_times_json(const StepTimes& times);

}  // namespace cairn::app
