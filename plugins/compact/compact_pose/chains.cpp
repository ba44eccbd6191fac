// SPDX-License-Identifier: BSD-3-Clause
#include "chains.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace cairn::compact {
namespace {

/// Appends what follows a pose that has left to what led there. Where the pose was not reached but
/// matched, the way there from the pose that was matched and back is no part of the trajectory.
void append(OdometryChain&& next, OdometryChain& chain) {
  auto first = next.steps.begin();
  if (!chain.steps.empty() && chain.steps.back().matched && first != next.steps.end() &&
      first->matched) {
    chain.steps.pop_back();
    ++first;
  }
  chain.steps.insert(chain.steps.end(), std::make_move_iterator(first),
                     std::make_move_iterator(next.steps.end()));
  chain.to = next.to;
}

/// What a match at the end of a way takes of its information.
Motion end_of(const WayPart& match) {
  return match.divided ? part_of(match.motion, match.of_way) : match.motion;
}
/// … and at the beginning of the next.
Motion start_of(const WayPart& match) {
  return match.divided ? part_of(match.motion, 1.0 - match.of_way) : match.motion;
}

/// The chain of a way, which takes its poses from the next steps.
OdometryChain chain_of(const Way& way, bool last, const MotionGroup& motions,
                       std::vector<ChainStep>::iterator& next,
                       std::vector<ChainStep>::iterator end) {
  OdometryChain chain{way.from, way.to, {}};
  if (way.start) {
    const Motion start = start_of(*way.start);
    chain.steps.push_back({way.start->pose, start.mean, start.covariance, true});
  }
  const bool all = !way.end && last;
  const bool none = way.end && way.start && way.end->pose == way.start->pose;
  for (bool more = !none; more && next != end; ++next) {
    more = all || next->pose != (way.end ? way.end->pose : way.to);
    chain.steps.push_back(std::move(*next));
  }
  if (way.end) {
    const Motion back = motions.inverse(end_of(*way.end));
    chain.steps.push_back({way.to, back.mean, back.covariance, true});
  }
  return chain;
}

}  // namespace

void Chains::step(Id pose, const Motion& motion, bool matched) {
  if (keeps_) open_.push_back({pose, motion.mean, motion.covariance, matched});
}

void Chains::end(Id from, Id to) {
  if (keeps_) all_.push_back({from, to, std::move(open_)});
  open_.clear();
}

/// The chains of ways that follow each other do so, too; the first is found by its ends.
std::size_t Chains::find(const Way& way) const {
  const auto is_of = [&](const OdometryChain& chain) {
    if (chain.from != way.from || chain.to != way.to) return false;
    const std::size_t steps = chain.steps.size();
    if (!way.end) return steps > 0 && !chain.steps.back().matched;
    return steps > 1 && chain.steps.back().matched && chain.steps[steps - 2].pose == way.end->pose;
  };
  const auto found = std::find_if(all_.rbegin(), all_.rend(), is_of);
  return static_cast<std::size_t>(found == all_.rend() ? std::ssize(all_)
                                                       : all_.rend() - found - 1);
}

void Chains::divide(const Ways::Change& change, const Way* first, const MotionGroup& motions) {
  if (!keeps_) return;
  const std::size_t begin = first ? find(*first) : all_.size();
  if (first && begin == all_.size()) return;
  std::vector<ChainStep> steps;
  const auto gather = [&](std::vector<ChainStep>& some) {
    std::erase_if(some, [](const ChainStep& step) { return step.matched; });
    std::ranges::move(some, std::back_inserter(steps));
  };
  const std::size_t end = std::min(begin + change.count, all_.size());
  for (std::size_t k = begin; k < end; ++k) gather(all_[k].steps);
  if (change.open) gather(open_);
  std::vector<OdometryChain> now;
  auto next = steps.begin();
  for (const Way& way : change.now)
    now.push_back(chain_of(way, &way == &change.now.back(), motions, next, steps.end()));
  if (change.open) {
    open_ = std::move(now.back().steps);
    now.pop_back();
  }
  const auto at = [&](std::size_t place) {
    return all_.begin() + static_cast<std::ptrdiff_t>(place);
  };
  all_.erase(at(begin), at(end));
  all_.insert(at(begin), std::make_move_iterator(now.begin()), std::make_move_iterator(now.end()));
}

bool Chains::end_at(Id pose) const {
  return std::ranges::find(all_, pose, &OdometryChain::to) != all_.end();
}

void Chains::recast(Id leaving, Id cover, const Displacement& there, const RigidGroup& group) {
  const auto end = std::find_if(all_.rbegin(), all_.rend(),
                                [&](const OdometryChain& chain) { return chain.to == leaving; });
  if (end == all_.rend()) return;
  const auto mean = group.view(there.mean);
  const Motion way{{mean.begin(), mean.end()},
                   {there.covariance.data(), there.covariance.data() + there.covariance.size()}};
  const Motion back = group.motions().inverse(way);
  end->steps.push_back({cover, back.mean, back.covariance, true});
  end->to = cover;
  for (auto next = end.base(); next != all_.end(); ++next) {
    if (next->from != leaving) continue;
    next->steps.insert(next->steps.begin(), {leaving, way.mean, way.covariance, true});
    next->from = cover;
  }
}

void Chains::join(const std::unordered_set<Id>& gone) {
  std::vector<OdometryChain> joined;
  joined.reserve(all_.size());
  for (OdometryChain& chain : all_) {
    if (!joined.empty() && gone.contains(chain.from)) {
      append(std::move(chain), joined.back());
    } else {
      joined.push_back(std::move(chain));
    }
  }
  all_ = std::move(joined);
}

}  // namespace cairn::compact
