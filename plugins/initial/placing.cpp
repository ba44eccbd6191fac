// SPDX-License-Identifier: BSD-3-Clause
#include "placing.hpp"

#include <algorithm>
#include <utility>

namespace cairn::initial {

FactorsOfVariables::FactorsOfVariables(const Graph& graph)
    : begin_(static_cast<std::size_t>(graph.variable_count()) + 1, 0) {
  const int n = graph.factor_count();
  for (int f = 0; f < n; ++f) {
    for (int v : graph.factor_variables(f)) ++begin_[v + 1];
  }
  for (std::size_t v = 1; v < begin_.size(); ++v) begin_[v] += begin_[v - 1];
  factors_.resize(static_cast<std::size_t>(begin_.back()));
  std::vector<std::int64_t> next(begin_.begin(), begin_.end() - 1);
  for (int f = 0; f < n; ++f) {
    for (int v : graph.factor_variables(f)) factors_[next[v]++] = f;
  }
}

Placing::Placing(Graph& graph)
    : graph_(graph),
      factors_(graph),
      placed_(static_cast<std::size_t>(graph.variable_count()), false) {}

bool Placing::place(int variable, int factor) {
  const auto variables = graph_.factor_variables(factor);
  std::vector<const double*> x(variables.size());
  int target = -1;
  for (std::size_t k = 0; k < variables.size(); ++k) {
    if (variables[k] == variable) {
      target = static_cast<int>(k);
    } else if (!placed_[variables[k]]) {
      return false;
    }
    x[k] = graph_.state(variables[k]).data();
  }
  const FactorType& type = graph_.factor_type(factor);
  std::vector<double> out(static_cast<std::size_t>(graph_.type(variable).ambient_size()));
  if (!type.propagate(target, x.data(), graph_.measurement(factor).data(), out.data()))
    return false;
  graph_.set_state(variable, out);
  placed_[variable] = true;
  return true;
}

std::vector<int> Placing::place_roots(const Gauge& gauge) {
  std::vector<int> largest(static_cast<std::size_t>(gauge.components), 0);
  for (int v = 0; v < graph_.variable_count(); ++v) {
    int& size = largest[gauge.component[v]];
    size = std::max(size, graph_.type(v).tangent_size());
  }
  const auto is_pose = [&](int v) {
    return graph_.type(v).tangent_size() == largest[gauge.component[v]];
  };
  std::vector<bool> has_root(static_cast<std::size_t>(gauge.components), false);
  for (int v = 0; v < graph_.variable_count(); ++v) {
    placed_[v] = gauge.held[v];
    if (gauge.held[v] && is_pose(v)) has_root[gauge.component[v]] = true;
  }
  std::vector<int> roots;
  for (int v = 0; v < graph_.variable_count(); ++v) {
    if (!has_root[gauge.component[v]] && is_pose(v)) {
      for (int f : factors_[v]) {
        if (graph_.factor_variables(f).size() == 1 && place(v, f)) break;
      }
      has_root[gauge.component[v]] = placed_[v];
    }
    if (placed_[v]) roots.push_back(v);
  }
  return roots;
}

void Placing::spread(std::vector<int> start) {
  std::vector<int>& queue = start;
  for (std::size_t head = 0; head < queue.size(); ++head) {
    for (int f : factors_[queue[head]]) {
      for (int v : graph_.factor_variables(f)) {
        if (!placed_[v] && place(v, f)) queue.push_back(v);
      }
    }
  }
}

void Placing::spread() {
  std::vector<int> all;
  for (int v = 0; v < graph_.variable_count(); ++v) {
    if (placed_[v]) all.push_back(v);
  }
  spread(std::move(all));
}

void Placing::finish(std::vector<std::string>& notes) {
  std::vector<int> left;
  for (int v = 0; v < graph_.variable_count(); ++v) {
    if (!placed_[v]) left.push_back(v);
  }
  std::stable_sort(left.begin(), left.end(), [&](int a, int b) {
    return graph_.type(a).tangent_size() > graph_.type(b).tangent_size();
  });
  std::int64_t kept = 0;
  int first = -1;
  for (int v : left) {
    if (placed_[v]) continue;
    if (kept++ == 0) first = v;
    placed_[v] = true;
    spread({v});
  }
  if (kept == 0) return;
  notes.push_back(counted(kept, "variable keeps its state", "variables keep their states") +
                  ": no factor determines their states from those initialised (first: " +
                  graph_.describe_variable(first) + ")");
}

std::string counted(std::int64_t count, const std::string& singular, const std::string& plural) {
  return std::to_string(count) + " " + (count == 1 ? singular : plural);
}

}  // namespace cairn::initial
