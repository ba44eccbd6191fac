// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/gauge.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "cairn/graph/disjoint_sets.hpp"

namespace cairn {

Gauge resolve_gauge(const Graph& graph) {
  const int n = graph.variable_count();
  Gauge gauge;
  gauge.held.assign(n, false);
  gauge.component.assign(n, -1);

  DisjointSets sets(n);
  std::vector<char> touched(n, false);
  std::vector<std::int64_t> prior_size(n, 0);
  for (const FactorPool& pool : graph.factor_pools()) {
    const std::size_t arity = static_cast<std::size_t>(pool.type->arity());
    const bool absolute = pool.type->absolute_size() > 0;
    for (std::size_t k = 0; k < pool.variables.size(); k += arity) {
      const int first = pool.variables[k];
      touched[first] = true;
      for (std::size_t a = 1; a < arity; ++a) {
        touched[pool.variables[k + a]] = true;
        sets.join(first, pool.variables[k + a]);
      }
      if (absolute) prior_size[first] += graph.absolute_size(pool.sequence[k / arity]);
    }
  }

  struct Anchoring {
    int largest_tangent = 0;
    int first_largest = -1;
    bool fixed = false;
    std::int64_t prior_size = 0;
  };
  std::vector<Anchoring> components;
  for (int v = 0; v < n; ++v) {
    gauge.held[v] = graph.fixed(v);
    if (!touched[v]) {
      gauge.unconstrained.push_back(v);
      gauge.held[v] = true;
    }
    const int root = sets.find(v);
    if (root == v) {
      gauge.component[v] = static_cast<int>(components.size());
      components.emplace_back();
    }
    gauge.component[v] = gauge.component[root];
    Anchoring& c = components[gauge.component[v]];
    if (const int size = graph.type(v).tangent_size(); size > c.largest_tangent) {
      c.largest_tangent = size;
      c.first_largest = v;
    }
    c.fixed = c.fixed || graph.fixed(v);
    c.prior_size += prior_size[v];
  }
  gauge.components = static_cast<int>(components.size());
  for (const Anchoring& c : components) {
    gauge.components_with_fixed += c.fixed;
    if (c.fixed || c.prior_size >= c.largest_tangent || gauge.held[c.first_largest]) continue;
    if (!graph.type(c.first_largest).lie_group() || c.prior_size > 0) {
      gauge.left_free.push_back(c.first_largest);
      continue;
    }
    gauge.held[c.first_largest] = true;
    gauge.anchored.push_back(c.first_largest);
  }
  return gauge;
}

std::string Gauge::describe(const Graph& graph) const {
  std::string text;
  if (anchored.size() == 1) {
    text = fmt::format(
        "{}: anchored {}",
        components_with_fixed ? "a component has no fixed variable" : "no variable is fixed",
        graph.describe_variable(anchored.front()));
  } else if (anchored.size() > 1) {
    std::vector<std::string> names;
    for (std::size_t k = 0; k < std::min<std::size_t>(anchored.size(), 5); ++k) {
      names.push_back(graph.describe_variable(anchored[k]));
    }
    text = fmt::format(
        "{} components without a fixed variable or enough priors: anchored one variable of each "
        "({}{})",
        anchored.size(), fmt::join(names, ", "), anchored.size() > 5 ? ", …" : "");
  }
  if (!left_free.empty()) {
    text += fmt::format(
        "{}the gauge of {} is left free: anchoring {} would constrain more, or contradict its "
        "priors",
        text.empty() ? "" : "; ",
        left_free.size() == 1 ? "a component" : fmt::format("{} components", left_free.size()),
        graph.describe_variable(left_free.front()));
  }
  if (!unconstrained.empty()) {
    text += fmt::format(
        "{}{} {} no factor and {} constant, the first is {}", text.empty() ? "" : "; ",
        unconstrained.size(), unconstrained.size() == 1 ? "variable has" : "variables have",
        unconstrained.size() == 1 ? "is" : "are", graph.describe_variable(unconstrained.front()));
  }
  return text;
}

}  // namespace cairn
