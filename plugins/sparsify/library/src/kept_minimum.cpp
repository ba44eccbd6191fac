// SPDX-License-Identifier: BSD-3-Clause
#include "kept_minimum.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "cairn/geometry/correlated_pair.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/linear/normal_equations.hpp"

namespace cairn {
namespace {

constexpr int kRounds = 30;
/// Of gᵀδ at first: less is rounding, and where it does not fall below the other, all stays.
constexpr double kSettled = 1e-16, kFarLess = 1e-2;
/// Parts of δ that are tried where a residual is too large for the whole of it.
constexpr double kParts[] = {1.0, 0.3, 0.1, 0.03};

/// A relative pose that a factor measures: between which of its variables, and where in its
/// measurement.
struct MeasuredPair {
  std::array<int, 2> between;
  int begin;
};

/// Those of a factor type, all that it measures; empty where it measures anything else.
std::vector<MeasuredPair> measured_pairs(const FactorType& type) {
  if (type.is_relative()) return {{{0, 1}, 0}};
  const auto* pair = dynamic_cast<const CorrelatedPair*>(&type);
  if (!pair) return {};
  return {{pair->between()[0], 0}, {pair->between()[1], type.measurement_size() / 2}};
}

/// The sparse graph, and the new factors that can be changed, alone.
class Balance {
 public:
  Balance(const Graph& original, const Sparsification& change, LinearSolver& of_all,
          LinearSolver& of_new)
      : all_(original.clone()), solver_(of_new) {
    apply(change, all_);
    for (int v = 0; v < all_.variable_count(); ++v) {
      new_.add_variable(all_.type_of(v), all_.id(v), all_.state(v));
      new_.set_fixed(v, all_.fixed(v));
    }
    const int first = all_.factor_count() - static_cast<int>(std::ssize(change.factors));
    for (int f = first; f < all_.factor_count(); ++f) {
      if (!is_adjustable(f)) continue;
      positions_.push_back(f);
      new_.add(all_.factor(f));
    }
    // Beside new factors of other kinds the gradient would not become zero.
    if (positions_.empty() || positions_.size() != change.factors.size()) return;
    equations_of_all_.emplace(all_, of_all);
    equations_.emplace(new_, of_new);
  }

  /// Whether there is anything to change.
  bool possible() const { return equations_ && equations_->size() > 0; }
  const std::vector<int>& positions() const { return positions_; }
  const Graph& all() const { return all_; }

  /// δ, and gᵀδ; infinite where Λ is singular.
  double solve() {
    equations_of_all_->linearize(all_.values());
    equations_->linearize(new_.values());
    const Linearizer& of_all = equations_of_all_->linearizer();
    const Linearizer& of_new = equations_->linearizer();
    std::vector<double> g(static_cast<std::size_t>(equations_->size()));
    for (int v = 0; v < all_.variable_count(); ++v) {
      const int from = of_all.block_of(v), to = of_new.block_of(v);
      if (from < 0 || to < 0) continue;
      const std::int64_t at = of_all.structure().offsets()[from];
      for (std::int64_t k = 0; k < of_all.structure().block_size(from); ++k)
        g[of_new.structure().offsets()[to] + k] = equations_of_all_->g()[at + k];
    }
    if (!equations_->factorize().ok) return std::numeric_limits<double>::infinity();
    step_.resize(g.size());
    solver_.solve(g, step_);
    double product = 0.0;
    for (std::size_t k = 0; k < g.size(); ++k) product += g[k] * step_[k];
    return std::isfinite(product) ? product : std::numeric_limits<double>::infinity();
  }

  /// What the new factors measure.
  std::vector<std::vector<double>> measurements() const {
    std::vector<std::vector<double>> all;
    for (std::size_t k = 0; k < positions_.size(); ++k) {
      const auto z = new_.measurement(static_cast<int>(k));
      all.emplace_back(z.begin(), z.end());
    }
    return all;
  }

  /// The δ of the last `solve`.
  const std::vector<double>& step() const { return step_; }

  /// What the new factors are to measure, instead of `measured`, for residuals that are those at
  /// x ⊕ step.
  std::vector<std::vector<double>> adjusted(const std::vector<std::vector<double>>& measured,
                                            std::span<const double> step) const {
    Values moved = new_.values();
    equations_->linearizer().retract(new_.values(), step, moved);
    std::vector<std::vector<double>> all = measured;
    for (std::size_t k = 0; k < positions_.size(); ++k) {
      const auto on = new_.factor_variables(static_cast<int>(k));
      const StateGroup group(new_.type(on[0]));
      for (const MeasuredPair& pair : measured_pairs(new_.factor_type(static_cast<int>(k)))) {
        const int i = on[static_cast<std::size_t>(pair.between[0])];
        const int j = on[static_cast<std::size_t>(pair.between[1])];
        const auto now = group.between(new_.state(i), new_.state(j));
        const auto then = group.between(state_in(moved, i), state_in(moved, j));
        const std::span<double> z(all[k].data() + pair.begin, now.size());
        const auto changed = group.normalized(
            group.compose(group.compose(now, group.inverse(then)), std::span<const double>(z)));
        std::ranges::copy(changed, z.begin());
      }
    }
    return all;
  }

  void measure(const std::vector<std::vector<double>>& all) {
    for (std::size_t k = 0; k < positions_.size(); ++k) {
      new_.set_measurement(static_cast<int>(k), all[k], {});
      all_.set_measurement(positions_[k], all[k], {});
    }
  }

 private:
  bool is_adjustable(int factor) const {
    const FactorType& type = all_.factor_type(factor);
    const auto pairs = static_cast<int>(std::ssize(measured_pairs(type)));
    const VariableType& pose = all_.type(all_.factor_variables(factor)[0]);
    return pairs > 0 && pose.lie_group() &&
           type.measurement_size() == pairs * pose.ambient_size() &&
           std::ranges::all_of(all_.factor_variables(factor),
                               [&](int v) { return &all_.type(v) == &pose; });
  }

  std::span<const double> state_in(const Values& values, int v) const {
    const auto size = static_cast<std::size_t>(new_.type(v).ambient_size());
    return {values.pools[static_cast<std::size_t>(new_.pool(v))].data() +
                static_cast<std::size_t>(new_.slot(v)) * size,
            size};
  }

  Graph all_, new_;
  LinearSolver& solver_;
  std::vector<int> positions_;  ///< in `all_`, of each factor of `new_`
  std::optional<NormalEquations> equations_of_all_, equations_;
  std::vector<double> step_;
};

}  // namespace

void keep_minimum(const Graph& original, Sparsification& change,
                  const std::function<std::unique_ptr<LinearSolver>()>& make_solver) {
  const std::unique_ptr<LinearSolver> of_all = make_solver(), of_new = make_solver();
  Balance balance(original, change, *of_all, *of_new);
  if (!balance.possible()) return;
  const double at_first = balance.solve();
  double reached = at_first;
  const bool possible = std::isfinite(reached);
  for (int round = 0; possible && round < kRounds && reached > kSettled * at_first; ++round) {
    const auto measured = balance.measurements();
    const std::vector<double> whole = balance.step();
    const double before = reached;
    for (std::size_t k = 0; k < std::size(kParts) && !(reached < before); ++k) {
      std::vector<double> step = whole;
      for (double& entry : step) entry *= kParts[k];
      balance.measure(balance.adjusted(measured, step));
      reached = balance.solve();
    }
    if (reached < before) continue;
    balance.measure(measured);
    reached = before;
    break;
  }
  if (!(reached < kFarLess * at_first)) return;
  const int first = balance.all().factor_count() - static_cast<int>(std::ssize(change.factors));
  const auto measured = balance.measurements();
  for (std::size_t k = 0; k < measured.size(); ++k)
    change.factors[static_cast<std::size_t>(balance.positions()[k] - first)].measurement =
        measured[k];
}

}  // namespace cairn
