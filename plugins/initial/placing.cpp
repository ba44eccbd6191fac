// SPDX-License-Identifier: BSD-3-Clause
#include "placing.hpp"

#include <algorithm>
#include <utility>

#include "alignment.hpp"
#include "cairn/update/placement.hpp"

namespace cairn::initial {

Placing::Placing(Graph& graph)
    : graph_(graph),
      factors_(graph),
      placed_(static_cast<std::size_t>(graph.variable_count()), false) {}

int Placing::find_ends(int variable, int factor) {
  ends_.clear();
  int target = -1;
  for (const int v : graph_.factor_variables(factor)) {
    if (v == variable) {
      target = static_cast<int>(std::ssize(ends_));
    } else if (!placed_[v]) {
      return -1;
    }
    ends_.push_back(graph_.state(v).data());
  }
  return target;
}

bool Placing::place(int variable, int factor) {
  const int target = find_ends(variable, factor);
  if (target < 0) return false;
  place_.assign(static_cast<std::size_t>(graph_.type(variable).ambient_size()), 0.0);
  if (!place_wholly(graph_.factor_type(factor), graph_.sqrt_information(factor), target,
                    ends_.data(), graph_.measurement(factor).data(), place_.data()))
    return false;
  graph_.set_state(variable, place_);
  placed_[variable] = true;
  return true;
}

bool Placing::place_in_part(int variable, int factor) {
  if (graph_.information_rank(factor) == graph_.factor_type(factor).residual_size())
    return false;  // all of it is measured: it was tried
  const int target = find_ends(variable, factor);
  if (target < 0 || ends_.size() < 2) return false;
  const FactorType& type = graph_.factor_type(factor);
  const double* const z = graph_.measurement(factor).data();
  std::vector<double> state(graph_.state(variable).begin(), graph_.state(variable).end());
  if (!place_beside(type, graph_.type(variable), graph_.sqrt_information(factor), target, ends_, z,
                    state))
    return false;
  graph_.set_state(variable, state);
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

std::vector<int> Placing::spread(std::vector<int> start) {
  std::vector<int>& queue = start;
  for (std::size_t head = 0; head < queue.size(); ++head) {
    for (int f : factors_[queue[head]]) {
      for (int v : graph_.factor_variables(f)) {
        if (!placed_[v] && place(v, f)) queue.push_back(v);
      }
    }
  }
  return start;
}

std::vector<int> Placing::all_placed() const {
  std::vector<int> all;
  for (int v = 0; v < graph_.variable_count(); ++v) {
    if (placed_[v]) all.push_back(v);
  }
  return all;
}

void Placing::spread() { spread(all_placed()); }

std::vector<int> Placing::spread_in_part(std::vector<int> start) {
  std::vector<int> in_part;
  std::vector<int>& queue = start;
  for (std::size_t head = 0; head < queue.size(); ++head) {
    for (int f : factors_[queue[head]]) {
      for (int v : graph_.factor_variables(f)) {
        if (placed_[v] || !place_in_part(v, f)) continue;
        in_part.push_back(v);
        const std::vector<int> reached = spread({v});
        queue.insert(queue.end(), reached.begin(), reached.end());
      }
    }
  }
  return in_part;
}

void Placing::finish(std::vector<std::string>& notes) {
  if (std::ranges::find(placed_, false) != placed_.end()) place_the_rest(notes);
  align_with_positions(graph_);
}

void Placing::place_the_rest(std::vector<std::string>& notes) {
  std::vector<int> in_part = spread_in_part(all_placed());
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
    const std::vector<int> from_it = spread_in_part(spread({v}));
    in_part.insert(in_part.end(), from_it.begin(), from_it.end());
  }
  if (!in_part.empty()) {
    notes.push_back(counted(std::ssize(in_part), "variable is", "variables are") +
                    " placed by a measurement without information in some directions, where it "
                    "stays beside the variable that it is seen from (first: " +
                    graph_.describe_variable(in_part.front()) + ")");
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
