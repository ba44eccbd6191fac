// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cairn/geometry/pose_chain.hpp"
#include "cairn/policy/map_check.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/selection_check.hpp"
#include "cairn/policy/threshold_search.hpp"
#include "cairn/policy/whole_map.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// The strategy that no policy has by itself: few poses, with all measurements (`take_whole_map`).
inline constexpr const char* kWholeStrategy = "whole";

/// How a compact graph is made of a recording.
struct CompactionJob {
  PolicyJob job;
  /// `whole` or one of the policy's; empty: that of the policy's options, and else `whole` where it
  /// can be (`why_no_whole_map`), `fpfl` where not.
  std::string strategy = {};
  OptionValues thresholds = {};  ///< of the policy, where its options do not say: of another run
  /// Whether thresholds are found in a sample of the recording; none: where the policy finds some,
  /// its options give none (`gives_thresholds`), and there is something to find them in.
  std::optional<bool> find = {};
  double sample = 0.6;                       ///< the part of the poses that is the sample
  double error_ratio = 2.5;                  ///< see `find_thresholds`; of no effect for `whole`
  int keep = 0;                              ///< most poses; 0: any number
  Recovery recovery = Recovery::distribute;  ///< of poses left out
  const Graph* map = nullptr;                ///< that the trajectory continues; or null
};

/// What has become of a recording.
struct Compaction {
  PolicyJob job;         ///< with all options
  std::string strategy;  ///< that was followed; empty: the policy has none
  ThresholdSample sample = {};
  FoundThresholds found = {};
  PolicyResult result = {};  ///< without poses where it was interrupted before the policy ran
  std::optional<WholeMap> whole = {};  ///< `result` is of all measurements
  /// Measurements that contradict the others and have left the recording: the ids of each.
  std::vector<std::vector<Id>> left_out = {};
  int loops_left_out = 0;              ///< loop closures among them
  double estimate_seconds = 0.0;       ///< that finding them and the estimate of all others took
  std::optional<MapCheck> check = {};  ///< how far the map is from that of all measurements
  std::vector<SelectionCheck::Advice> advice = {};  ///< where more could be had, or less is lost

  CAIRN_API static ResultFields<Compaction> fields();
};

/// What follows a compaction; each may be empty.
struct CompactionWatch {
  std::function<void(const std::string&)> note = {};  ///< a sentence without its full stop
  std::function<void(bool done)> optimising = {};     ///< before and after all measurements are
  std::function<void()> selecting = {};  ///< before the policy runs over the whole recording
  /// After each pose of that run, with its number.
  std::function<void(std::size_t, PosePolicy&)> pose = {};
  std::function<void(const SparsifyProgress&)> removing = {};
};

/// Makes a compact graph of a recording, as `cairn compact` and Python's `cairn.compact` do: finds
/// thresholds, lets the policy choose, and with the strategy `whole` gives the poses chosen the
/// information of all measurements, without those that contradict the others, which leave `data`.
/// Where that cannot be in the end, the policy's own map stands, with a note. `setting` is of
/// `data`. Throws `Error` (usage) for strategies and options that there are not or that contradict
/// each other, and what `find_thresholds` and `PolicyRun` throw.
CAIRN_API Compaction compact_recording(const CompactionJob& job, PolicyData& data,
                                       const PolicySetting& setting,
                                       const CompactionWatch& watch = {});

}  // namespace cairn
