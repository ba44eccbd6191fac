// SPDX-License-Identifier: BSD-3-Clause
// What comes while a solution is not finished, and what is to be seen of the estimate meanwhile.
#include <algorithm>
#include <utility>
#include <vector>

#include "engine.hpp"

namespace cairn::incremental {

/// A pose that waits is placed beside the first other pose that a factor joins it with.
void Engine::note_follower(int f) {
  const auto variables = models_.variables(f);
  for (const std::int32_t v : variables) {
    if (!factors_of_[v].empty() || graph_.fixed(v) || follows(v)) continue;
    const LieGroup* group = states_.type(v).lie_group();
    const auto leader = std::ranges::find_if(variables, [&](std::int32_t other) {
      return other != v && graph_.pool(other) == graph_.pool(v) &&
             (!factors_of_[other].empty() || graph_.fixed(other) || follows(other));
    });
    if (!group || leader == variables.end()) continue;
    std::vector<double> relative(x(v).size());
    group->inverse(x(*leader).data(), relative.data());
    group->compose(relative.data(), x(v).data(), relative.data());
    states_.type(v).normalize(relative.data());
    followers_.push_back({v, *leader, std::move(relative)});
  }
}

bool Engine::follows(std::int32_t v) const {
  return std::ranges::any_of(followers_, [&](const Follower& one) { return one.variable == v; });
}

void Engine::place_followers() {
  for (const Follower& one : followers_) {
    const LieGroup& group = *states_.type(one.variable).lie_group();
    settle(one.leader);
    std::vector<double> motion(one.relative.size());
    group.inverse(states_.x(one.variable), motion.data());
    group.compose(one.relative.data(), motion.data(), motion.data());
    group.compose(states_.x(one.leader), motion.data(), motion.data());
    // Or rounding would multiply from one pose to the next, and from one time to the next.
    states_.type(one.variable).normalize(motion.data());
    states_.lead(one.variable, motion.data());
    states_.put_frame_here(one.variable);
  }
}

/// Whether any factors have waited.
bool Engine::admit_waiting() {
  place_followers();
  followers_.clear();
  const bool any = admitted_ < models_.size();
  while (admitted_ < models_.size()) admit();
  return any;
}

/// Keeps the estimate from before a step that has not been evaluated.
void Engine::show_what_is_proven() {
  if (!job_.unproven || shown_) return;
  Leads leads;
  Estimate before = states_.before([&](std::int32_t node, std::span<const double> lead) {
    leads[node].assign(lead.begin(), lead.end());
  });
  shown_ = settled(tree_, states_, std::move(before), leads);
}

}  // namespace cairn::incremental
