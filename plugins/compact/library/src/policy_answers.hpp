// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/policy/pose_policy.hpp"

namespace cairn {

/// What a session has to say of its policy's decisions in the next answer, and how many of each
/// there were.
class PolicyAnswers {
 public:
  std::int64_t poses = 0;                        ///< that came
  std::int64_t proposed = 0;                     ///< pairs to be matched
  std::int64_t registered = 0;                   ///< pairs that were measured
  std::int64_t linked = 0;                       ///< links that were used
  std::int64_t revoked = 0;                      ///< REMOVE LINK
  std::int64_t priors = 0;                       ///< absolute measurements that are in the graph
  std::int64_t landmarks = 0, observations = 0;  ///< likewise; measurements of landmarks

  /// Lines that are ready.
  void add(std::string_view lines) { text_ += lines; }
  void note(std::string_view sentence);
  static std::string match_line(const MatchProposal& match, int tangent);
  void link(const LinkReport& link);
  void prior(const PriorReport& prior);
  /// `in_graph`: how many landmarks that came are in the graph now, which is asked where one left.
  void landmark(const LandmarkReport& landmark, const std::function<std::int64_t()>& in_graph);

  /// All of it, which is said then.
  std::string take() { return std::exchange(text_, {}); }
  /// For what was taken to answer a question meanwhile.
  void put_back(std::string text) { text_ = std::move(text); }
  /// The sentences of its notes.
  std::vector<std::string> notes() const;

 private:
  std::string text_;
};

}  // namespace cairn
