// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/plugin/options.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

struct FoundThresholds;

/// What a policy has selected, counted pose by pose; memory does not grow with the trajectory.
class CAIRN_API SelectionCheck {
 public:
  void add(const PoseReport& pose);
  std::int64_t poses() const { return poses_; }

  /// Why a selection is of no use, and which option of the policy helps.
  struct Advice {
    std::string finding;  ///< a sentence without its full stop
    /// Options of the policy with values; an empty value: larger than it is.
    OptionValues options;
    std::string effect;  ///< of these options: "keep about every third pose"
  };

  /// Where the policy has kept at least nine of ten poses, or has used no loop closure: for that
  /// reason of several which the reports show. Of poses kept: thresholds that a search has lowered
  /// to reach its tolerance, poses that stay since they close a loop or measure a landmark, steps
  /// longer than the sensor's range, and steps of odometry whose information gain exceeds the
  /// threshold of poses. Of loop closures: no pose within range of another, information gains below
  /// the threshold before or after the match, pairs that do not match, matches that contradict the
  /// estimate, and matches that wait for another which agrees.
  ///
  /// `found` are the thresholds that were found for the run, if they were; `loops` is how many loop
  /// closures a recording has, if it is one. Nothing where the selection is as it should be, or of
  /// fewer than ten poses, which show nothing.
  std::vector<Advice> advice(const FoundThresholds* found = nullptr,
                             std::optional<std::int64_t> loops = {}) const;

 private:
  std::optional<Advice> too_many_poses(const FoundThresholds* found) const;
  double mean_gain_of_steps() const;
  std::optional<Advice> no_loops(std::optional<std::int64_t> loops) const;

  std::int64_t poses_ = 0, kept_ = 0;
  std::int64_t kept_by_loop_ = 0, kept_alone_ = 0;  ///< of those kept
  std::int64_t kept_by_landmark_ = 0;               ///< likewise
  double gain_of_landmarks_ = 0.0;  ///< sum over the most informative of each [nats]
  std::int64_t steps_ = 0;          ///< poses kept for their information gain
  double gain_of_steps_ = 0.0;      ///< sum over these [nats]
  std::int64_t candidates_ = 0;     ///< besides the pose before
  double most_gain_ = 0.0;          ///< expected of a pair that was not proposed [nats]
  std::int64_t proposed_ = 0, matched_ = 0, linked_ = 0;
  std::int64_t uninformative_ = 0, inconsistent_ = 0, waiting_ = 0;
  double most_uninformative_ = 0.0;  ///< [nats]
  double gain_of_links_ = 0.0;       ///< sum over those linked, where finite [nats]
  std::int64_t gains_of_links_ = 0;
};

/// A sentence with the options as `name=value`, as they follow the name of a policy.
CAIRN_API std::string to_string(const SelectionCheck::Advice& advice);

}  // namespace cairn
