// SPDX-License-Identifier: BSD-3-Clause
#include "match_record.hpp"

namespace cairn::compact {

void MatchRecord::note(int pose, bool matched) {
  if (poses_.size() <= static_cast<std::size_t>(pose))
    poses_.resize(static_cast<std::size_t>(pose) + 1);
  for (Count* count : {&poses_[static_cast<std::size_t>(pose)], &all_}) {
    count->asked += 1.0;
    count->matched += matched ? 1.0 : 0.0;
  }
}

void MatchRecord::revoke(int pose) {
  const auto at = static_cast<std::size_t>(pose);
  if (at >= poses_.size() || poses_[at].matched < 1.0) return;
  poses_[at].matched -= 1.0;
  all_.matched -= 1.0;
}

void MatchRecord::renumber(std::span<const int> now) {
  std::size_t left = 0;
  for (std::size_t k = 0; k < poses_.size(); ++k) {
    if (now[k] >= 0) poses_[left++] = poses_[k];
  }
  poses_.resize(left);
}

double MatchRecord::probability(int pose) const {
  const double mean = (1.0 + all_.matched) / (2.0 + all_.asked);
  const auto at = static_cast<std::size_t>(pose);
  const Count one = at < poses_.size() ? poses_[at] : Count();
  return (kWeight * mean + one.matched) / (kWeight + one.asked);
}

}  // namespace cairn::compact
