// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <optional>
#include <span>

#include "compact_graph.hpp"
#include "match_record.hpp"
#include "threshold_finder.hpp"

namespace cairn::compact {

/// What is learnt from matches: how often they succeed, how accurate they are, and which thresholds
/// they call for. What was learnt from one that was false is forgotten.
class MatchStatistics {
 public:
  /// A kept pose was to be matched with the newest.
  void note_answer(int pose, bool matched) { record_.note(pose, matched); }
  void note_measured(const Matrix& covariance) { typical_.note(covariance); }
  void note_silence() { typical_.note_silence(); }
  /// A match that is linked, or waits. `sample`: its displacement before, if it is part of what
  /// thresholds are found from.
  void note_used(Id earlier, Id later, const Matrix& covariance, double gain,
                 const Dimensions* sample);
  /// What was learnt from the matches of two poses.
  void forget(Id a, Id b, const CompactGraph& graph);
  void renumber(std::span<const int> now) { record_.renumber(now); }

  const TypicalMatch& typical() const { return typical_; }
  /// Of a match with this kept pose.
  double probability(int pose) const { return record_.probability(pose); }
  ThresholdFinder& thresholds() { return thresholds_; }
  const ThresholdFinder& thresholds() const { return thresholds_; }

 private:
  struct Used {
    Id earlier = 0, later = 0;
    Matrix covariance;
    double gain = 0.0;
    bool sampled = false;
  };

  TypicalMatch typical_;
  MatchRecord record_;
  ThresholdFinder thresholds_;
  std::deque<Used> latest_;  ///< of those that may be revoked
};

}  // namespace cairn::compact
