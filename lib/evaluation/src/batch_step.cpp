// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/batch_step.hpp"

#include <iterator>

#include <fmt/core.h>

#include "cairn/evaluation/optimization.hpp"

namespace cairn {

std::string report_batch_step(const Summary& summary, const Stop& stop,
                              const UpdateOptions& options, int factors, UpdateReport& report) {
  const bool converged = summary.status == Status::converged;
  report.ok = summary.status != Status::not_positive_definite;
  report.iterations = static_cast<int>(std::ssize(summary.iterations));
  report.owed = converged || !(options.max_seconds > 0.0) ? 0 : factors;
  const bool goes_on = report.owed > 0 && summary.status == Status::max_iterations;
  report.converged = converged || (!options.full && (goes_on || is_estimate(summary, stop)));
  if (report.converged) return {};
  return fmt::format(
      "not converged: {} after {}", to_string(summary.status),
      report.iterations == 1 ? "1 iteration" : fmt::format("{} iterations", report.iterations));
}

}  // namespace cairn
