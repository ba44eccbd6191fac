// SPDX-License-Identifier: BSD-3-Clause
// Which poses of an estimate and of the truth belong together: pair_by_id and pair_by_stamp of
// trajectory.hpp.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>
#include <utility>

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

/// The middle one of the times from each pose to the next [s].
double median_step(const Trajectory& poses) {
  std::vector<double> stamps;
  for (const TrajectoryPose& pose : poses) stamps.push_back(*pose.stamp);
  std::ranges::sort(stamps);
  for (std::size_t k = stamps.size() - 1; k > 0; --k) stamps[k] -= stamps[k - 1];
  const auto middle = stamps.begin() + std::ssize(stamps) / 2;
  std::nth_element(stamps.begin() + 1, middle, stamps.end());
  return *middle;
}

/// Whether two poses or more would be near each other with this offset: within half a step of the
/// faster of the two.
bool offset_helps(const Trajectory& estimate, const Trajectory& truth, double offset,
                  double max_difference) {
  if (estimate.size() < 2 || truth.size() < 2) return true;
  const double near =
      std::max(max_difference, 0.5 * std::min(median_step(estimate), median_step(truth)));
  const std::vector<Candidate> all = candidates(time_line(estimate, truth, offset));
  return all.size() > 1 && all[1].difference <= near;
}

/// Whether a ratio is about 10^3, 10^6 or 10^9.
bool is_about(double ratio, double factor) { return ratio > 0.1 * factor && ratio < 10.0 * factor; }

/// "; its stamps may be milliseconds" where one of the two lasts, and steps, about so many times as
/// long as the other; else empty.
std::string other_unit(const Trajectory& estimate, const Trajectory& truth, const Times& ours,
                       const Times& theirs) {
  if (estimate.size() < 2 || truth.size() < 2) return "";
  const double lasts = (ours.last - ours.first) / (theirs.last - theirs.first);
  const double steps = median_step(estimate) / median_step(truth);
  for (const auto& [factor, name] :
       {std::pair{1e3, "milliseconds"}, {1e6, "microseconds"}, {1e9, "nanoseconds"}}) {
    const bool longer = is_about(lasts, factor) && is_about(steps, factor);
    const bool shorter = is_about(1.0 / lasts, factor) && is_about(1.0 / steps, factor);
    if (!longer && !shorter) continue;
    return fmt::format(
        "; the {} lasts about {:.0e} times as long as the {}: its stamps may be {}, and are to be "
        "seconds",
        longer ? "estimate" : "truth", factor, longer ? "truth" : "estimate", name);
  }
  return "";
}

/// Why so little matches, and what would help.
std::string diagnosis(const Trajectory& estimate, const Trajectory& truth,
                      const StampMatching& matching, double nearest) {
  const double offset = matching.offset;
  const Times ours = times(estimate, offset), theirs = times(truth);
  const std::string found = fmt::format(
      "stamps of the estimate{} go from {:.15g} to {:.15g} s, of the truth from {:.15g} to "
      "{:.15g} s",
      offset == 0.0 ? "" : fmt::format(", shifted by {:.15g} s,", offset), ours.first, ours.last,
      theirs.first, theirs.last);
  if (const std::string unit = other_unit(estimate, truth, ours, theirs); !unit.empty())
    return found + unit;
  if (ours.last < theirs.first || theirs.last < ours.first) {
    const double advised = 1e-6 * std::round(1e6 * (offset + theirs.first - ours.first));
    return offset_helps(estimate, truth, advised, matching.max_difference)
               ? fmt::format("{}; StampMatching::offset {:.15g} would let both begin together",
                             found, advised)
               : fmt::format(
                     "{}; no offset lets both begin together and go on so: the steps are "
                     "about {:.3g} and {:.3g} s",
                     found, median_step(estimate), median_step(truth));
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
                  nearest.empty()
                      ? ""
                      : "; " + diagnosis(estimate, truth, matching, nearest.front().difference)));
}

bool has_stamps(const Trajectory& poses) {
  return std::all_of(poses.begin(), poses.end(),
                     [](const TrajectoryPose& pose) { return pose.stamp.has_value(); });
}

/// Where one of the two has time stamps and the other has not: "; the truth has time stamps …".
std::string times_of_one(const Trajectory& estimate, const Trajectory& truth) {
  if (estimate.empty() || truth.empty() || has_stamps(estimate) == has_stamps(truth)) return "";
  const bool estimated = has_stamps(estimate);
  return fmt::format(
      "; the {} has time stamps: with those of the {} as well, poses can be paired "
      "by time",
      estimated ? "estimate" : "truth", estimated ? "truth" : "estimate");
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
                            "{} have an id in both; at least two are needed{}",
                            estimate.size(), truth.size(), pairs.truth.size(),
                            times_of_one(estimate, truth)));
  }
  count_the_others(estimate, truth, pairs);
  return pairs;
}

RowPairing row_pairing(const TrajectoryPairs& pairs, bool estimate_rows, bool truth_rows) {
  if (!estimate_rows && !truth_rows) return RowPairing::none;
  if (pairs.only_in_estimate == 0 && pairs.only_in_truth == 0) return RowPairing::complete;
  return has_stamps(pairs.estimate) || has_stamps(pairs.truth) ? RowPairing::unfounded
                                                               : RowPairing::partial;
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
