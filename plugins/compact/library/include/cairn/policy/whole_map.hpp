// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cairn/policy/estimate_of_all.hpp"
#include "cairn/policy/map_check.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/selection_check.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"
#include "cairn/sparsification/sparsify_graph.hpp"

namespace cairn {

/// The map of a recording that is known as a whole: the poses that a policy has kept, with the
/// information of all measurements, those that it has left out among them.
struct WholeMap {
  /// Empty: the result of the run has been replaced. Else a sentence without its full stop: why the
  /// run's own map is all there is.
  std::string why_not = {};
  /// How far the poses of the compact graph are, at its own minimum, from the estimate of all
  /// measurements; without alignment where absolute measurements say where the graph is.
  MapCheck check = {};
  /// Where that is far: a threshold with which less is lost.
  std::optional<SelectionCheck::Advice> advice = {};
  double kld = 0.0;  ///< from that estimate, of the poses of both [nats]; NaN: not known
  std::int64_t factors_in = 0, factors_out = 0;  ///< of the recording and of the compact graph
  double seconds = 0.0;
  std::vector<std::string> notes = {};

  CAIRN_API static ResultFields<WholeMap> fields();
};

/// Why a run of `job` cannot end in such a map, whatever is measured: matches are not those of the
/// recording (`matches_as_recorded`), or the recording has poses of earlier sessions. Empty: it
/// can.
CAIRN_API std::string why_no_whole_map(const PolicyJob& job, const PolicySetting& setting);

/// Replaces what a run has found by what all measurements say: takes the poses that the policy has
/// not kept out of their estimate, by factors that stand for theirs (`sparsify_whole`); all
/// landmarks stay. The compact
/// graph of `result` is then what is left, at its minimum; the trajectory is the estimate of all
/// measurements; chi2 is that of all measurements, of which all are kept; errors are under the name
/// "whole". Nothing is replaced where `why_not` says why. `all` is of the same recording
/// (`estimate_of_all`), without what it leaves out (`without_contradictions`). Robust losses, which
/// files do not hold, become weights that the information of each factor is multiplied by.
/// `progress` may be empty.
CAIRN_API WholeMap take_whole_map(
    const PolicyJob& job, const PolicySetting& setting, const EstimateOfAll& all,
    PolicyResult& result, const std::function<void(const SparsifyProgress&)>& progress = {});

}  // namespace cairn
