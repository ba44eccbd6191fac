// SPDX-License-Identifier: BSD-3-Clause
#include "pending_poses.hpp"

#include <algorithm>
#include <utility>

namespace cairn::incremental {

void PendingPoses::note(const Problem& problem, int f, const StateOf& x) {
  const Graph& graph = problem.graph();
  const auto variables = problem.models.variables(f);
  const auto is_placed = [&](std::int32_t v) {
    return !problem.factors_of(v).empty() || graph.fixed(v) || contains(v);
  };
  for (const std::int32_t v : variables) {
    if (is_placed(v)) continue;
    const VariableType& type = problem.states.type(v);
    const LieGroup* group = type.lie_group();
    const auto reference = std::ranges::find_if(variables, [&](std::int32_t other) {
      return other != v && graph.pool(other) == graph.pool(v) && is_placed(other);
    });
    if (!group || reference == variables.end()) continue;
    const std::vector<double> own = x(v);
    std::vector<double> relative(own.size());
    group->inverse(x(*reference).data(), relative.data());
    group->compose(relative.data(), own.data(), relative.data());
    type.normalize(relative.data());
    pending_.push_back({v, *reference, std::move(relative)});
  }
}

bool PendingPoses::contains(std::int32_t v) const {
  return std::ranges::find(pending_, v, &Pending::variable) != pending_.end();
}

void PendingPoses::place(Problem& problem) const {
  States& states = problem.states;
  for (const Pending& one : pending_) {
    const VariableType& type = states.type(one.variable);
    const LieGroup& group = *type.lie_group();
    problem.settle(one.reference);
    std::vector<double> motion(one.relative.size());
    group.inverse(states.x(one.variable), motion.data());
    group.compose(one.relative.data(), motion.data(), motion.data());
    group.compose(states.x(one.reference), motion.data(), motion.data());
    // Or rounding would multiply from one pose to the next, and from one time to the next.
    type.normalize(motion.data());
    states.lead(one.variable, motion.data());
    states.put_frame_here(one.variable);
  }
}

}  // namespace cairn::incremental
