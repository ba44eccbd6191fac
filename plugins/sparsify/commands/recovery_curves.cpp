// SPDX-License-Identifier: BSD-3-Clause
#include "recovery_curves.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <fmt/core.h>

namespace cairn::app {
namespace {

using Trace = std::vector<RecoveryPoint>;

constexpr int kTimes = 60;

/// Where a run stands after so much time, or so many iterations.
double kld_at(const Trace& trace, double seconds) {
  const auto after = std::ranges::upper_bound(trace, seconds, {}, &RecoveryPoint::seconds);
  return after == trace.begin() ? trace.front().kld : std::prev(after)->kld;
}
double kld_after(const Trace& trace, std::size_t iterations) {
  return trace[std::min(iterations, trace.size() - 1)].kld;
}

template <class Value>
double mean_of(const std::vector<Trace>& traces, const Value& value) {
  double sum = 0.0;
  for (const Trace& trace : traces) sum += value(trace);
  return sum / static_cast<double>(traces.size());
}

}  // namespace

void RecoveryCurves::add(const std::string& recovery, int nodes,
                         std::span<const RecoveryPoint> trace) {
  if (trace.empty()) return;  // of a method that does not iterate
  runs_[{recovery, nodes}].emplace_back(trace.begin(), trace.end());
}

NumberTable RecoveryCurves::table() const {
  double first = std::numeric_limits<double>::infinity(), last = 0.0;  // [s]
  std::size_t most = 0;
  for (const auto& [key, traces] : runs_) {
    for (const Trace& trace : traces) {
      most = std::max(most, trace.size());
      last = std::max(last, trace.back().seconds);
      for (const RecoveryPoint& point : trace) {
        if (point.seconds > 0.0) first = std::min(first, point.seconds);
      }
    }
  }
  const bool by_time = against_ == Against::seconds;
  NumberTable table;
  NumberTable::Column x{by_time ? "seconds" : "iterations", {}};
  for (int k = 0; by_time && last > 0.0 && k < kTimes; ++k)
    x.values.push_back(first * std::pow(last / first, static_cast<double>(k) / (kTimes - 1)));
  for (std::size_t k = 0; !by_time && k < most; ++k) x.values.push_back(static_cast<double>(k));
  table.columns.push_back(x);
  for (const auto& [key, traces] : runs_) {
    NumberTable::Column column{fmt::format("{}@{}", key.first, key.second), {}};
    for (const double at : x.values) {
      column.values.push_back(mean_of(traces, [&](const Trace& trace) {
        return by_time ? kld_at(trace, at) : kld_after(trace, static_cast<std::size_t>(at));
      }));
    }
    table.columns.push_back(std::move(column));
  }
  return table;
}

}  // namespace cairn::app
