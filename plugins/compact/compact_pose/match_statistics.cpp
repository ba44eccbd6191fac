// SPDX-License-Identifier: BSD-3-Clause
#include "match_statistics.hpp"

#include <algorithm>

#include "ways.hpp"

namespace cairn::compact {

void MatchStatistics::note_used(Id earlier, Id later, const Matrix& covariance, double gain,
                                const Dimensions* sample) {
  if (sample) thresholds_.note_loop(*sample, gain, covariance);
  latest_.push_back({earlier, later, covariance, gain, sample != nullptr});
  if (latest_.size() > Ways::kMost) latest_.pop_front();
}

void MatchStatistics::forget(Id a, Id b, const CompactGraph& graph) {
  std::erase_if(latest_, [&](const Used& match) {
    if (std::minmax(match.earlier, match.later) != std::minmax(a, b)) return false;
    typical_.forget(match.covariance);
    if (match.sampled) thresholds_.forget_loop(match.gain, match.covariance);
    if (const int pose = graph.kept().find(match.earlier); pose >= 0) record_.revoke(pose);
    return true;
  });
}

}  // namespace cairn::compact
