// SPDX-License-Identifier: BSD-3-Clause
#include "whole_graph.hpp"

#include <fmt/core.h>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"

namespace cairn {

double optimize_whole(Graph& graph, Optimizer& optimizer, const std::string& name,
                      const SparsifySetting& setting, const char* what, SparsifyResult& result) {
  Observer silent;
  const Summary summary =
      call_plugin([&] { return fmt::format("optimizer '{}'", name); },
                  [&] {
                    return optimizer.optimize(
                        graph, setting.stop, setting.optimisation ? *setting.optimisation : silent);
                  });
  if (result.status == Status::converged) result.status = summary.status;
  if (summary.status == Status::interrupted) {
    result.interrupted = true;
  } else if (summary.status != Status::converged) {
    if (!is_estimate(summary, setting.stop)) result.converged = false;
    result.notes.push_back(fmt::format("the optimisation of {} ended as {}: it is not at a minimum",
                                       what, to_string(summary.status)));
  }
  if (!result.interrupted) {
    for (const std::string& doubt : notes_on_estimate(graph, summary.final_chi2).notes)
      result.notes.push_back(fmt::format("{}: {}", what, doubt));
  }
  return summary.final_chi2;
}

bool measure_or_note(SparsifyResult& result, const char* otherwise,
                     const std::function<void()>& measure) {
  try {
    measure();
    return true;
  } catch (const Error& error) {
    // Graphs that cannot be compared cost the measure, not what was computed.
    if (error.code() != ErrorCode::numerical && error.code() != ErrorCode::input) throw;
    result.notes.push_back(fmt::format("{}: {}", otherwise, error.what()));
    return false;
  }
}

}  // namespace cairn
