// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/selection_check.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include "cairn/policy/threshold_search.hpp"

namespace cairn {
namespace {

/// Fewer poses show nothing.
constexpr std::int64_t kLeastPoses = 10;
/// With more of the poses, a graph is not compact.
constexpr double kNotCompact = 0.9;
/// A threshold below the largest information gain by this factor, as `refine_thresholds` steps.
const double kBelow = 1.0 / std::sqrt(2.0);

std::string nats(double gain) { return fmt::format("{:.3g}", gain); }

/// Of a sum of gains per step, the threshold that section 5.2 of IJRR makes of it.
double threshold_of_poses(double gain) { return std::pow(gain + 1.0, 1.7) - 1.0; }

/// Of the trials of a search that keep clearly fewer poses, the one with the least error.
const ThresholdTrial* smaller_trial(const FoundThresholds& found) {
  const ThresholdTrial* best = nullptr;
  const ThresholdTrial& chosen = found.trials[found.chosen];
  for (const ThresholdTrial& trial : found.trials) {
    if (static_cast<double>(trial.poses_kept) > kNotCompact * chosen.poses_kept) continue;
    if (!best || trial.error() < best->error()) best = &trial;
  }
  return best;
}

/// The largest information gain among what a pose measured of landmarks and was used [nats], but
/// for that of landmarks which it alone determines; 0: there is none.
double most_informative(Id pose, const std::vector<LandmarkReport>& landmarks) {
  double most = 0.0;
  for (const LandmarkReport& landmark : landmarks) {
    if (landmark.pose == pose && landmark.verdict == LinkVerdict::linked && !landmark.added)
      most = std::max(most, landmark.gain);
  }
  return most;
}

/// What a trial has otherwise.
OptionValues changed(const ThresholdTrial& trial, const OptionValues& from) {
  OptionValues others;
  for (const auto& [name, value] : trial.options) {
    const auto before = from.find(name);
    if (before == from.end() || before->second != value) others[name] = value;
  }
  for (const char* gain : {"loop_gain", "pose_gain"}) {
    if (const auto at = others.find(gain); at != others.end())
      at->second = nats(std::stod(at->second));
  }
  return others;
}

}  // namespace

void SelectionCheck::add(const PoseReport& pose) {
  ++poses_;
  kept_ += pose.kept;
  candidates_ += std::max(0, pose.candidates - 1);
  most_gain_ = std::max(most_gain_, pose.most_gain);
  for (const LinkReport& link : pose.links) {
    ++proposed_;
    matched_ += link.verdict != LinkVerdict::unmatched;
    inconsistent_ += link.verdict == LinkVerdict::inconsistent;
    waiting_ += link.verdict == LinkVerdict::waiting;
    if (link.verdict == LinkVerdict::uninformative) {
      ++uninformative_;
      most_uninformative_ = std::max(most_uninformative_, link.gain);
    }
    if (link.verdict != LinkVerdict::linked) continue;
    ++linked_;
    if (!std::isfinite(link.gain)) continue;  // the first match with a map
    gain_of_links_ += link.gain;
    ++gains_of_links_;
  }
  if (!pose.kept || poses_ == 1) return;
  if (pose.closed_loop) {
    ++kept_by_loop_;
  } else if (const double gain = most_informative(pose.id, pose.landmarks); gain > 0.0) {
    ++kept_by_landmark_;
    gain_of_landmarks_ += gain;
  } else if (!std::isfinite(pose.least_gain)) {
    ++kept_alone_;
  } else {
    ++steps_;
    gain_of_steps_ += pose.least_gain;
  }
}

double SelectionCheck::mean_gain_of_steps() const {
  return steps_ > 0 ? gain_of_steps_ / static_cast<double>(steps_) : 0.0;
}

std::optional<SelectionCheck::Advice> SelectionCheck::too_many_poses(
    const FoundThresholds* found) const {
  const double part = static_cast<double>(kept_) / static_cast<double>(poses_);
  if (part < kNotCompact) return std::nullopt;
  const std::string begin = fmt::format("{:.0f} % of the poses are kept: ", 100.0 * part);
  if (found && !found->trials.empty()) {
    if (const ThresholdTrial* trial = smaller_trial(*found)) {
      const ThresholdTrial& chosen = found->trials[found->chosen];
      return Advice{begin + fmt::format("with the {} poses that other thresholds keep of the "
                                        "sample instead of {}, its error is estimated at {:.3g} m, "
                                        "and at most {:.3g} m was asked for",
                                        trial->poses_kept, chosen.poses_kept, trial->error(),
                                        found->tolerance),
                    changed(*trial, found->options), "keep as many as that, with this error"};
    }
  }
  if (kept_by_loop_ > std::max(kept_alone_, steps_)) {
    Advice advice{begin +
                      "most of them have a loop closure, which keeps a pose unless it is "
                      "relocated",
                  {{"reuse", "true"}},
                  "relocates poses that have a loop closure instead of keeping them"};
    if (gains_of_links_ > 0) {
      advice.options["loop_gain"] = nats(gain_of_links_ / static_cast<double>(gains_of_links_));
      advice.effect += ", and uses about half of the loop closures";
    }
    return advice;
  }
  if (kept_by_landmark_ > std::max(kept_alone_, steps_)) {
    return Advice{
        begin + "most of them have an informative measurement of a landmark",
        {{"landmark_gain", nats(gain_of_landmarks_ / static_cast<double>(kept_by_landmark_))}},
        "uses about half of these, with a larger error"};
  }
  if (kept_alone_ > steps_) {
    return Advice{begin +
                      "the pose before is out of the sensor's range, so that each is in a new "
                      "place",
                  {{"range", ""}, {"angle", ""}},
                  "let poses count as near; both must exceed a step of odometry"};
  }
  const double gain = mean_gain_of_steps();
  return Advice{begin + fmt::format("the information gain of linking a pose to the one before is "
                                    "{} nats in the mean, which is more than pose_gain, since "
                                    "odometry is as uncertain as a match",
                                    nats(gain)),
                {{"pose_gain", nats(threshold_of_poses(gain))}},
                "keeps a pose every few steps, with a larger error"};
}

std::optional<SelectionCheck::Advice> SelectionCheck::no_loops(
    std::optional<std::int64_t> loops) const {
  if (linked_ > 0 || loops == 0) return std::nullopt;
  if (!loops && proposed_ == 0) return std::nullopt;  // the robot may have seen no place twice
  const std::string begin = "no loop closure is used: ";
  if (matched_ == 0 && proposed_ > 0) {
    const std::string finding =
        begin + fmt::format("none of the {} pairs of poses that were asked for matched{}",
                            proposed_,
                            loops ? "; the recording's loop closures are of other pairs" : "");
    if (most_gain_ > 0.0)
      return Advice{finding, {{"loop_gain", nats(kBelow * most_gain_)}}, "asks for more pairs"};
    return Advice{finding,
                  {{"pose_gain", nats(0.5 * mean_gain_of_steps())}},
                  "keeps more poses, which more pairs are of"};
  }
  if (matched_ == 0 && candidates_ == 0) {
    return Advice{begin +
                      "no pose is within the sensor's range of an earlier one with a "
                      "probability above s (probability)",
                  {{"range", ""}, {"angle", ""}},
                  "let more pairs count as near; they are those of the sensor, and must cover the "
                  "drift as well"};
  }
  if (matched_ == 0) {
    return Advice{begin + fmt::format("of {} pairs of poses within range none has an expected "
                                      "information gain above loop_gain; the largest is {} nats",
                                      candidates_, nats(most_gain_)),
                  {{"loop_gain", nats(kBelow * most_gain_)}},
                  "asks for the best of them"};
  }
  // Of those that wait the oldest are given up as inconsistent, which they are not.
  if (waiting_ > uninformative_ && waiting_ >= inconsistent_) {
    return Advice{begin + fmt::format("{} matches wait for another that agrees with them, since a "
                                      "false one would be as consistent with the estimate",
                                      waiting_),
                  {{"trust", "1"}},
                  "uses each that is consistent by itself"};
  }
  if (inconsistent_ > uninformative_) {
    return Advice{begin + fmt::format("{} of {} matches contradict the estimate: either they are "
                                      "false, or odometry is worse than its covariances",
                                      inconsistent_, matched_),
                  {{"gate", "0"}},
                  "uses them all the same: check the map then"};
  }
  return Advice{begin + fmt::format("the {} that matched have an information gain below loop_gain, "
                                    "at most {} nats, with the covariance that they came with",
                                    matched_, nats(most_uninformative_)),
                {{"loop_gain", nats(kBelow * most_uninformative_)}},
                "uses the best of them"};
}

std::vector<SelectionCheck::Advice> SelectionCheck::advice(
    const FoundThresholds* found, std::optional<std::int64_t> loops) const {
  std::vector<Advice> all;
  if (poses_ < kLeastPoses) return all;
  if (auto poses = too_many_poses(found)) all.push_back(std::move(*poses));
  if (auto links = no_loops(loops)) all.push_back(std::move(*links));
  return all;
}

std::string to_string(const SelectionCheck::Advice& advice) {
  std::string options;
  for (const auto& [name, value] : advice.options) {
    options += options.empty() ? "" : " and ";
    options += value.empty() ? "a larger " + name : name + "=" + value;
  }
  return fmt::format("{}; {} {}", advice.finding, options, advice.effect);
}

}  // namespace cairn
