// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cairn::incremental {

/// Which variables the next measurements will probably join: a robot that comes along where it has
/// been observes one earlier pose after the other.
///
/// This follows runs of such observations. Variables are numbered as they were added; each of a run
/// is at most `kStep` from the one before, always in the same direction, and came at most `kPause`
/// solutions after it. A run is expected to go on for half as many steps as it has had. Times are
/// those of solutions: what came since the one before counts as one step.
class Revisits {
 public:
  static constexpr std::int32_t kStep = 2;
  static constexpr std::int64_t kPause = 3;
  /// At most so many runs are returned, the longest.
  static constexpr int kMostRuns = 16;
  /// So many variables are expected at most.
  static constexpr std::int32_t kFarthest = 20;

  struct Run {
    std::int32_t variable;              ///< the last one
    std::int32_t direction = 0;         ///< 1 or -1; 0 where there is only one
    std::int32_t length = 0;            ///< steps so far
    std::int64_t time = 0;              ///< of the last one
    std::int32_t prepared_to = 0;       ///< the variables up to this one have been prepared for …
    std::int64_t prepared_at = kNever;  ///< … at this time

    /// How many variables more are expected, `direction` apart.
    std::int32_t expected() const;
    static constexpr std::int64_t kNever = -1;
    /// Whether what has now come was prepared for at an earlier time.
    bool was_prepared() const {
      return prepared_at != kNever && prepared_at != time &&
             direction * (prepared_to - variable) >= 0;
    }
  };

  /// A variable that no factor had joined for a while has got one.
  void note(std::int32_t variable) { noted_.push_back(variable); }
  /// The runs that have begun or gone on at `time` (rising, from 0), the longest first; what was
  /// noted since the last call has come then.
  std::span<Run> at(std::int64_t time);
  void clear() {
    noted_.clear();
    runs_.clear();
  }

 private:
  std::vector<std::int32_t> noted_;
  std::vector<Run> runs_;                 // those of the last time first, the longest first
  std::vector<std::size_t> by_variable_;  // places in runs_
};

}  // namespace cairn::incremental
