// SPDX-License-Identifier: BSD-3-Clause
// Which poses of an estimate and of the truth belong together: pair_by_id and pair_by_stamp of
// trajectory.hpp.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>

#include <fmt/core.h>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

void count_the_others(const Trajectory& estimate, const Trajectory& truth, TrajectoryPairs& pairs) {
  pairs.only_in_estimate = static_cast<std::int64_t>(estimate.size() - pairs.estimate.size());
  pairs.only_in_truth = static_cast<std::int64_t>(truth.size() - pairs.truth.size());
}

// By stamp ----------------------------------------------------------------------------------------

/// A pose on the time line that both trajectories share.
struct Moment {
  double stamp;  // [s]
  const TrajectoryPose* pose;
  bool estimated;
};

std::vector<Moment> time_line(const Trajectory& estimate, const Trajectory& truth, double offset) {
  std::vector<Moment> moments;
  for (const TrajectoryPose& pose : estimate) {
    moments.push_back({*pose.stamp + offset, &pose, true});
  }
  for (const TrajectoryPose& pose : truth) moments.push_back({*pose.stamp, &pose, false});
  std::stable_sort(moments.begin(), moments.end(),
                   [](const Moment& a, const Moment& b) { return a.stamp < b.stamp; });
  return moments;
}

/// Neighbours on the time line, one estimated and one true.
struct Candidate {
  std::size_t moment;  // and the one after
  double difference;   // [s]
};

/// By rising difference. Neighbours are enough: whatever stands between two others is nearer to one
/// of them, and once it has a partner, pairing those two would break the order of time.
std::vector<Candidate> candidates(const std::vector<Moment>& moments) {
  std::vector<Candidate> found;
  for (std::size_t k = 0; k + 1 < moments.size(); ++k) {
    if (moments[k].estimated == moments[k + 1].estimated) continue;
    found.push_back({k, moments[k + 1].stamp - moments[k].stamp});
  }
  std::stable_sort(found.begin(), found.end(), [](const Candidate& a, const Candidate& b) {
    return a.difference < b.difference;
  });
  return found;
}

struct Times {
  double first, last;  // [s]
};

Times times(const Trajectory& poses, double offset = 0.0) {
  const auto [first, last] = std::minmax_element(
      poses.begin(), poses.end(),
      [](const TrajectoryPose& a, const TrajectoryPose& b) { return *a.stamp < *b.stamp; });
  return {*first->stamp + offset, *last->stamp + offset};
}

/// Why so little matches, and what would help.
std::string diagnosis(const Trajectory& estimate, const Trajectory& truth, double offset,
                      double nearest) {
  const Times ours = times(estimate, offset), theirs = times(truth);
  const std::string found = fmt::format(
      "stamps of the estimate{} go from {:.15g} to {:.15g} s, of the truth from {:.15g} to "
      "{:.15g} s",
      offset == 0.0 ? "" : fmt::format(", shifted by {:.15g} s,", offset), ours.first, ours.last,
      theirs.first, theirs.last);
  if (ours.last < theirs.first || theirs.last < ours.first) {
    const double microseconds = std::round(1e6 * (offset + theirs.first - ours.first));
    return fmt::format("{}; StampMatching::offset {:.15g} would let both begin together", found,
                       1e-6 * microseconds);
  }
  return fmt::format(
      "{}, and the nearest two are {:.6g} s apart; allow more with StampMatching::max_difference, "
      "or shift those of the estimate with StampMatching::offset",
      found, nearest);
}

[[noreturn]] void fail_to_match(const Trajectory& estimate, const Trajectory& truth,
                                const StampMatching& matching, std::size_t pairs,
                                const std::vector<Candidate>& nearest) {
  throw Error(
      ErrorCode::input,
      fmt::format("cannot compare trajectories: of {} estimated and {} true poses only {} match "
                  "within {} s, and at least two are needed{}",
                  estimate.size(), truth.size(), pairs, matching.max_difference,
                  nearest.empty() ? ""
                                  : "; " + diagnosis(estimate, truth, matching.offset,
                                                     nearest.front().difference)));
}

bool has_stamps(const Trajectory& poses) {
  return std::all_of(poses.begin(), poses.end(),
                     [](const TrajectoryPose& pose) { return pose.stamp.has_value(); });
}

bool stamps_are_ids(const Trajectory& poses) {
  return std::all_of(poses.begin(), poses.end(), [](const TrajectoryPose& pose) {
    return *pose.stamp == static_cast<double>(pose.id);
  });
}

}  // namespace

TrajectoryPairs pair_by_id(const Trajectory& estimate, const Trajectory& truth) {
  TrajectoryPairs pairs;
  auto e = estimate.begin();
  auto t = truth.begin();
  while (e != estimate.end() && t != truth.end()) {
    if (e->id < t->id) {
      ++e;
    } else if (t->id < e->id) {
      ++t;
    } else {
      pairs.estimate.push_back(*e++);
      pairs.truth.push_back(*t++);
    }
  }
  if (pairs.truth.size() < 2) {
    throw Error(ErrorCode::input,
                fmt::format("cannot compare trajectories: of {} estimated and {} true poses only "
                            "{} have an id in both; at least two are needed",
                            estimate.size(), truth.size(), pairs.truth.size()));
  }
  count_the_others(estimate, truth, pairs);
  return pairs;
}

TrajectoryPairs pair_by_stamp(const Trajectory& estimate, const Trajectory& truth,
                              const StampMatching& matching) {
  assert(has_stamps(estimate) && has_stamps(truth));
  const std::vector<Moment> moments = time_line(estimate, truth, matching.offset);
  const std::vector<Candidate> nearest = candidates(moments);
  TrajectoryPairs pairs;
  std::vector<bool> taken(moments.size()), begins_pair(moments.size());
  for (const Candidate& candidate : nearest) {
    const std::size_t k = candidate.moment;
    if (candidate.difference > matching.max_difference) break;
    if (taken[k] || taken[k + 1]) continue;
    taken[k] = taken[k + 1] = begins_pair[k] = true;
    pairs.largest_difference = candidate.difference;
  }
  for (std::size_t k = 0; k + 1 < moments.size(); ++k) {
    if (!begins_pair[k]) continue;
    const Moment &one = moments[k], &other = moments[k + 1];
    pairs.estimate.push_back(*(one.estimated ? one : other).pose);
    pairs.truth.push_back(*(one.estimated ? other : one).pose);
  }
  if (pairs.truth.size() < 2) {
    fail_to_match(estimate, truth, matching, pairs.truth.size(), nearest);
  }
  count_the_others(estimate, truth, pairs);
  return pairs;
}

bool stamps_tell_more(const Trajectory& estimate, const Trajectory& truth) {
  return has_stamps(estimate) && has_stamps(truth) &&
         !(stamps_are_ids(estimate) && stamps_are_ids(truth));
}

}  // namespace cairn
