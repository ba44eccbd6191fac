// SPDX-License-Identifier: BSD-3-Clause
#include "followers.hpp"

#include <algorithm>
#include <utility>

namespace cairn::incremental {

void Followers::note(const Problem& problem, int f, const StateOf& x) {
  const Graph& graph = problem.graph();
  const auto variables = problem.models.variables(f);
  const auto is_placed = [&](std::int32_t v) {
    return !problem.factors_of(v).empty() || graph.fixed(v) || contain(v);
  };
  for (const std::int32_t v : variables) {
    if (is_placed(v)) continue;
    const VariableType& type = problem.states.type(v);
    const LieGroup* group = type.lie_group();
    const auto leader = std::ranges::find_if(variables, [&](std::int32_t other) {
      return other != v && graph.pool(other) == graph.pool(v) && is_placed(other);
    });
    if (!group || leader == variables.end()) continue;
    const std::vector<double> own = x(v);
    std::vector<double> relative(own.size());
    group->inverse(x(*leader).data(), relative.data());
    group->compose(relative.data(), own.data(), relative.data());
    type.normalize(relative.data());
    followers_.push_back({v, *leader, std::move(relative)});
  }
}

bool Followers::contain(std::int32_t v) const {
  return std::ranges::find(followers_, v, &Follower::variable) != followers_.end();
}

void Followers::place(Problem& problem) const {
  States& states = problem.states;
  for (const Follower& one : followers_) {
    const VariableType& type = states.type(one.variable);
    const LieGroup& group = *type.lie_group();
    problem.settle(one.leader);
    std::vector<double> motion(one.relative.size());
    group.inverse(states.x(one.variable), motion.data());
    group.compose(one.relative.data(), motion.data(), motion.data());
    group.compose(states.x(one.leader), motion.data(), motion.data());
    // Or rounding would multiply from one pose to the next, and from one time to the next.
    type.normalize(motion.data());
    states.lead(one.variable, motion.data());
    states.put_frame_here(one.variable);
  }
}

}  // namespace cairn::incremental
