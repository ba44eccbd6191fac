// SPDX-License-Identifier: BSD-3-Clause
#include "propagate.hpp"

#include <algorithm>
#include <functional>
#include <limits>
#include <queue>
#include <tuple>
#include <vector>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/factors_by_variable.hpp"
#include "cairn/update/placement.hpp"

namespace cairn::formats {
namespace {

class Propagator {
 public:
  explicit Propagator(Graph& graph)
      : graph_(graph), known_(graph.variable_count(), false), factors_(graph) {}

  Propagation run() {
    start_from([this](int v) { return has_prior(v) && determine(v); });
    // Poses before points: a point tells nothing about its neighbours.
    start_from([this](int v) { return !is_point(graph_.type(v)) && start_at_identity(v); });
    start_from([this](int v) { return start_at_identity(v); });
    return result_;
  }

 private:
  const FactorType& type_of(int f) const { return graph_.factor_type(f); }
  bool has_prior(int v) const {
    return std::ranges::any_of(factors_[v], [this](int f) { return type_of(f).arity() == 1; });
  }

  /// Tries `start` on every variable that is not known yet, in order, and spreads from where it
  /// works.
  void start_from(const std::function<bool(int)>& start) {
    for (int v = 0; v < graph_.variable_count(); ++v) {
      if (known_[v] || !start(v)) continue;
      ++result_.roots;
      accept(v);
      spread();
    }
  }
  bool start_at_identity(int v) {
    std::vector<double> state = identity(v);
    for (const int f : factors_[v]) {
      const double* const own = state.data();
      if (type_of(f).arity() == 1) {
        place_in_part(type_of(f), graph_.type(v), graph_.sqrt_information(f), 0, {&own, 1},
                      graph_.measurement(f).data(), state);
      }
    }
    graph_.set_state(v, state);
    return true;
  }
  std::vector<double> identity(int v) const {
    std::vector<double> state(static_cast<std::size_t>(graph_.type(v).ambient_size()));
    graph_.type(v).identity(state.data());
    return state;
  }

  /// By measurements that determine a variable wholly as far as they reach; only then by one that
  /// has no information in some directions.
  void spread() {
    do {
      while (!frontier_.empty()) {
        const int v = frontier_.top();
        frontier_.pop();
        if (known_[v]) continue;
        if (determine(v)) {
          accept(v);
        } else if (!candidates_.empty()) {
          in_part_.push(v);
        }
      }
    } while (spread_in_part());
  }
  bool spread_in_part() {
    while (!in_part_.empty()) {
      const int v = in_part_.top();
      in_part_.pop();
      if (known_[v] || !determine_in_part(v)) continue;
      accept(v);
      return true;
    }
    return false;
  }
  void accept(int v) {
    known_[v] = true;
    for (const int f : factors_[v]) {
      for (const int other : graph_.factor_variables(f)) {
        if (!known_[other]) frontier_.push(other);
      }
    }
  }

  /// How good a factor is for determining v, smaller is better: relative measurements first, from
  /// the nearest variable before v, then after it; then others; each by its place in the file.
  using Rank = std::tuple<int, int, int>;
  Rank rank(int f, int v) const {
    if (!type_of(f).is_relative()) return {2, 0, f};
    const auto ends = graph_.factor_variables(f);
    const int other = ends[0] == v ? ends[1] : ends[0];
    return other < v ? Rank{0, v - other, f} : Rank{1, other - v, f};
  }
  bool others_known(int f, int v) const {
    return std::ranges::all_of(graph_.factor_variables(f),
                               [&](int other) { return other == v || known_[other]; });
  }

  /// The factors on v whose other variables are known, the best first.
  void find_candidates(int v) {
    candidates_.clear();
    for (const int f : factors_[v]) {
      if (others_known(f, v)) candidates_.push_back(rank(f, v));
    }
    std::sort(candidates_.begin(), candidates_.end());
  }
  /// Sets the state of v from the best factor that determines it.
  bool determine(int v) {
    find_candidates(v);
    return std::ranges::any_of(candidates_,
                               [&](const Rank& r) { return propagate(std::get<2>(r), v, true); });
  }
  /// The same from one that determines it but for directions without information, in which v stays
  /// beside the variable that it is seen from, or at the identity.
  bool determine_in_part(int v) {
    find_candidates(v);
    return std::ranges::any_of(candidates_,
                               [&](const Rank& r) { return propagate(std::get<2>(r), v, false); });
  }
  bool propagate(int f, int v, bool wholly) {
    const auto ends = graph_.factor_variables(f);
    std::vector<const double*> states;
    int target = 0;
    for (std::size_t k = 0; k < ends.size(); ++k) {
      states.push_back(graph_.state(ends[k]).data());
      if (ends[k] == v) target = static_cast<int>(k);
    }
    const FactorType& type = type_of(f);
    const std::span<const double> root = graph_.sqrt_information(f);
    const double* const z = graph_.measurement(f).data();
    std::vector<double> state = identity(v);
    const bool placed = wholly ? place_wholly(type, root, target, states.data(), z, state.data())
                               : place_beside(type, graph_.type(v), root, target, states, z, state);
    if (!placed) return false;
    graph_.set_state(v, state);
    return true;
  }

  Graph& graph_;
  std::vector<bool> known_;
  FactorsByVariable factors_;  // in the order of the file
  std::priority_queue<int, std::vector<int>, std::greater<>> frontier_, in_part_;
  std::vector<Rank> candidates_;
  Propagation result_;
};

}  // namespace

Propagation propagate_states(Graph& graph) { return Propagator(graph).run(); }

}  // namespace cairn::formats
