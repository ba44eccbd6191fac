// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

namespace cairn::compact {

/// How often requests for a match with each kept pose have succeeded: some places are hard to
/// recognise, and some never were.
///
/// The probability of a match is the mean of a beta distribution whose prior has the mean p of all
/// poses and the weight of `kWeight` requests, (k p + matched_i) / (k + asked_i); p itself has the
/// prior mean ½ with the weight of two requests.
class MatchRecord {
 public:
  static constexpr double kWeight = 3.0;

  void note(int pose, bool matched);
  /// A match with it, which was noted, was a false one: the request was in vain.
  void revoke(int pose);
  /// Poses have left: pose k has the number `now[k]` now, −1 if it has left.
  void renumber(std::span<const int> now);
  /// Of a match with this kept pose.
  double probability(int pose) const;

 private:
  struct Count {
    double asked = 0.0, matched = 0.0;
  };
  std::vector<Count> poses_;
  Count all_;
};

}  // namespace cairn::compact
