// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What all measurements of a recording say, which is the measure of a map of some of them. No
/// truth is needed for that.
struct EstimateOfAll {
  /// Empty: there is an estimate. Else why not: a sentence without its full stop.
  std::string why_not = {};
  /// Where there is one: what speaks against it, a sentence without its full stop. Empty: nothing.
  std::string doubt = {};
  Graph graph = {};  ///< the recording at its minimum, without the factors that are left out
  double chi2 = 0.0;
  /// Measurements that contradict the others, by position in the recording, rising, and the ids of
  /// the variables of each.
  std::vector<int> left_out = {};
  std::vector<std::vector<Id>> left_out_on = {};
  int loops_left_out = 0;  ///< loop closures among them
};

/// Whether what matches in a run is what was recorded: its registration is `recorded`, without
/// false matches. Of others a recording is no measure.
CAIRN_API bool matches_as_recorded(const PolicyJob& job);

/// Optimises all measurements of a recording, from what the initial guess `auto` makes of it, and
/// leaves out what contradicts the others, unless factors have losses of their own.
///
/// By their covariances, where chi2 is larger than chance allows: by the loss `geman_mcclure`,
/// those to which it leaves less than one per cent of their weight and whose squared residual is
/// more than 50 times chi2 of the others per degree of freedom (where that is below one, 50). None
/// is left out where they are more than a third of the loop closures, or explain less than half of
/// what chi2 per degree of freedom is above one.
///
/// Then by each other alone, since with covariances that are too large a wrong loop closure bends
/// the map at little cost: those whose squared residual is more than 200 times chi2 of the others
/// per degree of freedom, and without which chi2 falls by as much each; at most one in twenty.
///
/// The loss is on loop closures, or on all where fewer are left out then, such as a single step of
/// odometry that contradicts many loop closures. Those come back with which chi2 hardly rises. What
/// holds the graph together stays. There is no estimate where the minimum is not found, or not
/// plausible (`is_plausible`).
CAIRN_API EstimateOfAll estimate_of_all(const PolicySetting& setting);

/// The data without what an estimate has left out, gaps in odometry bridged anew.
CAIRN_API PolicyData without_contradictions(PolicyData data, const EstimateOfAll& all);

/// "12 of 1439 loop closures contradict the others and are left out, the first of them EDGE_SE2 3
/// 507"; empty where there are none.
CAIRN_API std::string left_out_in_words(const EstimateOfAll& all, const PolicyData& data);

}  // namespace cairn
