// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cmath>

#include "cairn/runtime/timed.hpp"

namespace cairn::exploration {

/// The time budget of a decision, from here on.
class DecisionTime {
 public:
  explicit DecisionTime(double budget)
      : budget_(budget), begin_(std::chrono::steady_clock::now()) {}

  double passed() const { return seconds_since(begin_); }
  /// Of a part of the budget [s]; below zero: more has passed. Infinite without a budget.
  double left(double part = 1.0) const {
    return std::isfinite(budget_) ? part * budget_ - passed() : budget_;
  }

 private:
  double budget_;
  std::chrono::steady_clock::time_point begin_;
};

}  // namespace cairn::exploration
