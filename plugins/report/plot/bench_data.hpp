// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cairn::plot {

/// The part of the report of `cairn bench --json` that plots need.
struct BenchConfiguration {
  std::string name;
  double median = 0, low = 0, high = 0;  ///< [s]
  double initial_chi2 = 0;
  std::vector<double> chi2, seconds;  ///< of each iteration
  double memory = 0;                  ///< peak [bytes]; NaN: not measured
  bool ran = false;
};
struct BenchGraph {
  std::string name;
  double variables = 0;
  std::vector<BenchConfiguration> configurations;
};

/// Throws `Error` (input) for text that is no such report, as where there is none.
std::vector<BenchGraph> read_bench(std::string_view json);

}  // namespace cairn::plot
