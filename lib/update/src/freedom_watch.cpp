// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/freedom_watch.hpp"

#include <algorithm>
#include <iterator>
#include <numeric>

namespace cairn {
namespace {

/// Some factors of a graph, and their variables, numbered from 0.
class SomeRows final : public LinearRows {
 public:
  SomeRows(const FreedomWatch::System& system, std::vector<int> factors)
      : system_(system), factors_(std::move(factors)) {
    begin_.push_back(0);
    for (const int f : factors_) {
      for (const std::int32_t v : system.graph.factor_variables(f)) {
        on_.push_back(v);
        variables_.push_back(v);
      }
      begin_.push_back(on_.size());
    }
    std::ranges::sort(variables_);
    variables_.erase(std::unique(variables_.begin(), variables_.end()), variables_.end());
    for (std::int32_t& v : on_) {
      v = static_cast<std::int32_t>(std::ranges::lower_bound(variables_, v) - variables_.begin());
    }
  }
  const std::vector<int>& graph_variables() const { return variables_; }

  std::span<const std::int32_t> variables(int factor) const override {
    const auto k = static_cast<std::size_t>(factor);
    return std::span(on_).subspan(begin_[k], begin_[k + 1] - begin_[k]);
  }
  int rows(int factor) const override {
    return system_.graph.factor_type(graph_factor(factor)).residual_size();
  }
  bool determines_each(int factor) const override {
    return cairn::determines_each(system_.graph, graph_factor(factor));
  }
  void jacobian(int factor, std::span<double> J) const override {
    system_.jacobian(graph_factor(factor), J);
  }

 private:
  int graph_factor(int factor) const { return factors_[static_cast<std::size_t>(factor)]; }

  const FreedomWatch::System& system_;
  std::vector<int> factors_, variables_;  // of the graph
  std::vector<std::int32_t> on_;
  std::vector<std::size_t> begin_;
};

/// `known`: by variable of the graph. The directions are those of the graph.
template <class Known>
FreeDirections search(const SomeRows& rows, const FreedomWatch::System& system, std::size_t count,
                      const Known& known) {
  std::vector<std::int32_t> sizes, units, factors(count);
  std::vector<bool> determined;
  for (const int v : rows.graph_variables()) {
    sizes.push_back(system.graph.type(v).tangent_size());
    units.push_back(numbers_of_one_unit(system.graph.type(v)));
    determined.push_back(known(v));
  }
  std::iota(factors.begin(), factors.end(), 0);
  FreeDirections found = find_free_directions(rows, {sizes, units, determined, factors});
  for (FreeDirection& direction : found.directions) {
    for (FreeMove& move : direction.moves)
      move.variable = rows.graph_variables()[static_cast<std::size_t>(move.variable)];
  }
  return found;
}

/// Whether each of the new factors that is on unknown variables determines them from known ones, in
/// the order of the factors: what most updates bring, without a search.
template <class Known>
bool follows_in_order(const FreedomWatch::System& system, int first, const Known& known) {
  std::vector<int> reached;
  const auto unknown = [&](int v) {
    return !known(v) && std::ranges::find(reached, v) == reached.end();
  };
  for (int f = first; f < system.graph.factor_count(); ++f) {
    if (!system.live(f)) continue;
    const auto on = system.graph.factor_variables(f);
    const auto count = std::ranges::count_if(on, unknown);
    if (count == 0) continue;
    if (count == std::ssize(on) || !determines_each(system.graph, f)) return false;
    std::ranges::copy_if(on, std::back_inserter(reached), unknown);
  }
  return true;
}

}  // namespace

const FreeDirections& FreedomWatch::look(const System& system) {
  if (given_up_ && only_added(system)) return free_;
  if (determined_ && only_added(system) && look_at_new(system)) return free_;
  look_at_all(system);
  return free_;
}

/// Whether what was determined still is: an anchor may be released when a factor joins its
/// component with another.
bool FreedomWatch::only_added(const System& system) const {
  return system.graph.factor_count() >= factors_ && system.graph.variable_count() >= variables_ &&
         std::ranges::all_of(anchors_, [&](int v) { return system.held(v); });
}

bool FreedomWatch::look_at_new(const System& system) {
  const auto is_new = [&](int v) { return v >= variables_ || idle_.contains(v); };
  const auto known = [&](int v) { return !is_new(v) || system.held(v); };
  const auto for_each = [&](const auto& what) {
    for (int f = factors_; f < system.graph.factor_count(); ++f)
      if (system.live(f)) what(f);
  };
  if (!follows_in_order(system, factors_, known)) {
    std::vector<int> factors;
    for_each([&](int f) { factors.push_back(f); });
    const std::size_t count = factors.size();
    const FreeDirections found = search(SomeRows(system, std::move(factors)), system, count, known);
    if (!found.complete || !found.empty()) return false;
  }
  for_each([&](int f) {
    for (const int v : system.graph.factor_variables(f)) {
      if (is_new(v) && system.held(v) && !system.graph.fixed(v) &&
          std::ranges::find(anchors_, v) == anchors_.end())
        anchors_.push_back(v);
    }
  });
  for (int v = variables_; v < system.graph.variable_count(); ++v) idle_.insert(idle_.end(), v);
  for_each([&](int f) {
    for (const int v : system.graph.factor_variables(f)) idle_.erase(v);
  });
  variables_ = system.graph.variable_count();
  factors_ = system.graph.factor_count();
  return true;
}

void FreedomWatch::look_at_all(const System& system) {
  forget();
  std::vector<int> factors;
  for (int f = 0; f < system.graph.factor_count(); ++f)
    if (system.live(f)) factors.push_back(f);
  const std::size_t count = factors.size();
  const SomeRows rows(system, std::move(factors));
  free_ = search(rows, system, count, system.held);
  for (int v = 0; v < system.graph.variable_count(); ++v) idle_.insert(idle_.end(), v);
  for (const int v : rows.graph_variables()) {
    idle_.erase(v);
    if (system.held(v) && !system.graph.fixed(v)) anchors_.push_back(v);
  }
  variables_ = system.graph.variable_count();
  factors_ = system.graph.factor_count();
  given_up_ = !free_.complete;
  determined_ = free_.complete && free_.empty();
}

}  // namespace cairn
