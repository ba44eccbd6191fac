// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/report/scene.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// The covariance of one variable, as a report has it.
struct ReportedCovariance {
  Id id = 0;
  std::vector<double> covariance;  ///< row by row; as many numbers as the report gives
};

/// What the report of `cairn optimize --json` says of a run and its files.
struct RunReport {
  SceneRun run;
  std::string graph;             ///< the graph that was optimised, as it was named; or empty
  std::string output;            ///< the file of the estimate; or empty
  bool has_covariances = false;  ///< `covariances` were asked for, and could be computed
  std::vector<ReportedCovariance> covariances;
};

/// The report of `cairn bench --json`.
struct BenchReport {
  std::string text;                 ///< as it is
  std::vector<std::string> graphs;  ///< that were compared on, as they were named
};

/// Reads a report; one of `cairn bench` is known by its "command". Throws `Error` (input), naming
/// `where`, for text that is no such report.
CAIRN_API std::variant<RunReport, BenchReport> read_report(std::string_view text,
                                                           const std::string& where);

}  // namespace cairn
