// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <set>
#include <string>
#include <unordered_map>

#include "cairn/graph/factor_selector.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Which loss a factor gets when it is added to a graph that grows: its own, or else that of the
/// rule if the rule selects it. The factor keeps it from then on, whatever else comes and goes.
///
/// A factor closes a loop (`FactorSelector::loops`) if at the time of its arrival some variable of
/// the type that it joins has an id between the two. Deciding that takes O(log n) for n variables.
class CAIRN_API LossRule {
 public:
  LossRule() = default;
  LossRule(std::shared_ptr<const Loss> loss, FactorSelector which, const Graph& graph);

  /// Whether it gives no factor a loss.
  bool empty() const { return !loss_; }
  /// Follow what the graph gets and loses.
  void added_variable(const Graph& graph, int variable);
  void removed_variable(const Graph& graph, int variable);
  /// Gives the factor its loss; to be called once, when it has been added.
  void added_factor(Graph& graph, int position) const;
  /// Forgets the graph, not the rule.
  void clear() { ids_.clear(); }

 private:
  bool selects(const Graph& graph, int position) const;
  bool closes_loop(const Graph& graph, int position) const;

  std::shared_ptr<const Loss> loss_;
  FactorSelector which_;
  std::unordered_map<std::string_view, std::set<Id>> ids_;  // by type; only for loops
};

}  // namespace cairn
