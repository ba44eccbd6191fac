// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/loss_rule.hpp"

#include <algorithm>
#include <utility>

namespace cairn {

LossRule::LossRule(std::shared_ptr<const Loss> loss, FactorSelector which, const Graph& graph)
    : loss_(std::move(loss)), which_(std::move(which)) {
  for (int v = 0; v < graph.variable_count(); ++v) added_variable(graph, v);
}

void LossRule::added_variable(const Graph& graph, int variable) {
  if (!loss_ || which_.kind() != FactorSelector::Kind::loops) return;
  std::set<Id>& ids = ids_[graph.type(variable).tag()];
  ids.insert(ids.end(), graph.id(variable));  // constant time where ids rise
}

void LossRule::removed_variable(const Graph& graph, int variable) {
  const auto ids = ids_.find(graph.type(variable).tag());
  if (ids != ids_.end()) ids->second.erase(graph.id(variable));
}

void LossRule::added_factor(Graph& graph, int position) const {
  if (!loss_ || graph.loss(position) || !selects(graph, position)) return;
  graph.set_loss(position, loss_);
}

bool LossRule::selects(const Graph& graph, int position) const {
  switch (which_.kind()) {
    case FactorSelector::Kind::all:
      return true;
    case FactorSelector::Kind::loops:
      return closes_loop(graph, position);
    case FactorSelector::Kind::tag:
      return graph.factor_type(position).tag() == which_.tag();
    case FactorSelector::Kind::predicate:
      return which_.predicate()(graph, position);
  }
  return false;
}

bool LossRule::closes_loop(const Graph& graph, int position) const {
  const auto v = graph.factor_variables(position);
  if (v.size() != 2 || graph.pool(v[0]) != graph.pool(v[1])) return false;
  const auto ids = ids_.find(graph.type(v[0]).tag());
  if (ids == ids_.end()) return true;
  const Id a = graph.id(v[0]), b = graph.id(v[1]);
  const auto next = ids->second.upper_bound(std::min(a, b));
  return next == ids->second.end() || *next != std::max(a, b);
}

}  // namespace cairn
