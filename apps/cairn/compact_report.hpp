// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <boost/json/fwd.hpp>

#include "cairn/policy/map_check.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/threshold_search.hpp"
#include "cairn/policy/uncertainty_comparison.hpp"
#include "cairn/sparsification/whole_map.hpp"
#include "compact.hpp"
#include "results.hpp"
#include "used_thresholds.hpp"

namespace cairn::app {

/// What a run of `cairn compact` came to.
struct CompactOutcome {
  const std::string& name;      ///< of the graph
  const std::string& strategy;  ///< empty: the policy has none
  const PolicyData& data;
  const FoundThresholds& found;      ///< by a search; none: there was none
  const UsedThresholds& thresholds;  ///< of the run, whatever was found
  PolicyResult result;
  std::optional<PolicyResult> control;  ///< as many poses and loops at random
  std::optional<WholeMap> whole = {};   ///< `result` is of all measurements
  /// Those that contradict the others and have left the recording: the ids of each.
  std::vector<std::vector<Id>> left_out = {};
  int loops_left_out = 0;              ///< loop closures among them
  std::optional<MapCheck> check = {};  ///< of what is shown

  /// What is written and shown.
  const PolicyResult& shown() const { return control ? *control : result; }
};

boost::json::object report_json(const CompactOptions& options, const CompactOutcome& outcome);
std::string summary_text(const CompactOptions& options, const CompactOutcome& outcome,
                         const Results& results, const Session& session);

/// A row for each pose.
std::string steps_csv(const PolicyResult& result);

boost::json::object comparison_json(const std::vector<UncertaintyStep>& steps);
std::string comparison_csv(const std::vector<UncertaintyStep>& steps);

}  // namespace cairn::app
