// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include <boost/json/fwd.hpp>

#include "cairn/policy/compaction.hpp"
#include "cairn/policy/uncertainty_comparison.hpp"
#include "cairn/program/results.hpp"
#include "compact.hpp"
#include "used_thresholds.hpp"

namespace cairn::app {

/// What a run of `cairn compact` came to.
struct CompactOutcome {
  const std::string& name;  ///< of the graph
  const PolicyData& data;
  const UsedThresholds& thresholds;  ///< of the run, whatever was found
  Compaction made;                   ///< what is written and shown
  /// Where that is a control, as many poses and loops at random: what it is like.
  std::optional<PolicyResult> like = {};
};

boost::json::object report_json(const CompactOptions& options, const CompactOutcome& outcome);
std::string summary_text(const CompactOptions& options, const CompactOutcome& outcome,
                         const Results& results, const Session& session);

/// A row for each pose.
std::string steps_csv(const PolicyResult& result);

}  // namespace cairn::app
