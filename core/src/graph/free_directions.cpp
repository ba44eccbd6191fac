// SPDX-License-Identifier: BSD-3-Clause
// What the factors of a graph leave free.
#include "cairn/graph/free_directions.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "cairn/graph/disjoint_sets.hpp"
#include "cairn/types/factor_call.hpp"
#include "free_alone.hpp"

namespace cairn {

namespace {

bool is_whole_relative_pose(const Graph& graph, int factor) {
  const FactorType& type = graph.factor_type(factor);
  const int n = type.residual_size();
  return type.is_relative() && type.tangent_size(0) == n && graph.information_rank(factor) == n;
}

/// A graph's factors at some states.
class GraphRows final : public LinearRows {
 public:
  GraphRows(const Graph& graph, const Values& values) : graph_(graph), values_(values) {}

  std::span<const std::int32_t> variables(int factor) const override {
    return graph_.factor_variables(factor);
  }
  int rows(int factor) const override { return graph_.factor_type(factor).residual_size(); }
  bool constant() const override { return !graph_.has_losses(); }
  bool determines_each(int factor) const override {
    const FactorType& type = graph_.factor_type(factor);
    if (!is_whole_relative_pose(graph_, factor)) return false;
    if (!graph_.loss(factor)) return true;
    std::vector<double> r(static_cast<std::size_t>(type.residual_size()));
    call_factor(type, [&] { evaluate(type, factor, r.data(), nullptr); });
    return weight(factor, r) > 0.0;
  }
  void jacobian(int factor, std::span<double> J) const override {
    const FactorType& type = graph_.factor_type(factor);
    std::vector<double> r(static_cast<std::size_t>(type.residual_size()));
    std::vector<double*> blocks;
    double* next = J.data();
    for (int k = 0; k < type.arity(); ++k) {
      blocks.push_back(next);
      next += r.size() * static_cast<std::size_t>(type.tangent_size(k));
    }
    call_factor(type, [&] { evaluate(type, factor, r.data(), blocks.data()); });
    if (!std::ranges::all_of(r, [](double each) { return std::isfinite(each); }))
      std::ranges::fill(J, std::numeric_limits<double>::quiet_NaN());
    if (!graph_.loss(factor)) return;
    const double root = std::sqrt(weight(factor, r));
    for (double& entry : J) entry *= root;
  }

 private:
  void evaluate(const FactorType& type, int factor, double* r, double* const* J) const {
    std::vector<const double*> x;
    for (const std::int32_t v : graph_.factor_variables(factor)) {
      x.push_back(values_.pools[static_cast<std::size_t>(graph_.pool(v))].data() +
                  std::ptrdiff_t{graph_.slot(v)} * graph_.type(v).ambient_size());
    }
    type.evaluate(x.data(), graph_.measurement(factor).data(),
                  graph_.sqrt_information(factor).data(), r, J);
  }
  double weight(int factor, std::span<const double> r) const {
    const double norm = std::inner_product(r.begin(), r.end(), r.begin(), 0.0);
    double weight = 1.0;
    const FactorRef at = graph_.ref(factor);
    graph_.weigh(at.pool, static_cast<std::size_t>(at.entry), {&norm, 1}, {}, {&weight, 1});
    return weight;
  }

  const Graph& graph_;
  const Values& values_;
};

/// The weights that losses give the factors of a pool at some states; empty: it has no losses.
std::vector<double> weights_of(const Graph& graph, std::size_t pool, const Values& values) {
  const FactorPool& factors = graph.factor_pools()[pool];
  if (std::ranges::all_of(factors.losses, [](int loss) { return loss == 0; })) return {};
  std::vector<double> norms(factors.size()), weights(factors.size());
  std::vector<const double*> states;
  const FactorView view = graph.view(static_cast<int>(pool), values, states);
  call_factor(*factors.type,
              [&] { factors.type->squared_norms(view, 0, norms.size(), norms.data()); });
  graph.weigh(static_cast<int>(pool), 0, norms, {}, weights);
  return weights;
}

/// What hangs together with a constant variable by fully measured relative poses that have weight:
/// in most graphs all poses.
std::vector<bool> determined_by_whole_relative_poses(const Graph& graph,
                                                     const std::vector<bool>& held,
                                                     const Values& values) {
  DisjointSets sets(static_cast<int>(held.size()));
  for (std::size_t p = 0; p < graph.factor_pools().size(); ++p) {
    const FactorPool& pool = graph.factor_pools()[p];
    const int n = pool.type->residual_size();
    if (!pool.type->is_relative() || pool.type->tangent_size(0) != n) continue;
    const std::vector<double> weights = weights_of(graph, p, values);
    for (std::size_t f = 0; f < pool.size(); ++f) {
      if (pool.ranks[static_cast<std::size_t>(pool.noises[f])] < n) continue;
      if (!weights.empty() && !(weights[f] > 0.0)) continue;
      sets.join(pool.variables[2 * f], pool.variables[2 * f + 1]);
    }
  }
  std::vector<bool> determined(held.size(), false);
  for (std::size_t v = 0; v < held.size(); ++v)
    if (held[v]) determined[static_cast<std::size_t>(sets.find(static_cast<int>(v)))] = true;
  for (std::size_t v = 0; v < held.size(); ++v)
    determined[v] = held[v] || determined[static_cast<std::size_t>(sets.find(static_cast<int>(v)))];
  return determined;
}

/// Whether all factors are fully measured relative poses without a loss.
bool all_are_whole_relative_poses(const Graph& graph) {
  if (graph.has_losses()) return false;
  for (const FactorPool& pool : graph.factor_pools()) {
    const int n = pool.type->residual_size();
    if (pool.size() > 0 && (!pool.type->is_relative() || pool.type->tangent_size(0) != n ||
                            std::ranges::any_of(pool.ranks, [n](int rank) { return rank < n; })))
      return false;
  }
  return true;
}

/// And whether every component has a constant variable: then nothing is free, as in most graphs of
/// poses.
bool all_are_whole_relative_poses(const Graph& graph, const Gauge& gauge) {
  if (!all_are_whole_relative_poses(graph)) return false;
  std::vector<bool> has_constant(static_cast<std::size_t>(gauge.components), false);
  for (std::size_t v = 0; v < gauge.held.size(); ++v)
    if (gauge.held[v]) has_constant[static_cast<std::size_t>(gauge.component[v])] = true;
  return std::ranges::find(has_constant, false) == has_constant.end();
}

/// Positions of the factors that have a variable which is not determined, rising.
std::vector<std::int32_t> factors_on_others(const Graph& graph,
                                            const std::vector<bool>& determined) {
  std::vector<std::int32_t> factors;
  for (const FactorPool& pool : graph.factor_pools()) {
    const auto arity = static_cast<std::size_t>(pool.type->arity());
    for (std::size_t f = 0; f < pool.size(); ++f) {
      for (std::size_t k = f * arity; k < (f + 1) * arity; ++k) {
        if (determined[static_cast<std::size_t>(pool.variables[k])]) continue;
        factors.push_back(pool.sequence[f]);
        break;
      }
    }
  }
  std::ranges::sort(factors);
  return factors;
}

}  // namespace

int numbers_of_one_unit(const VariableType& type) {
  const Placement* placement = type.placement();
  return placement ? std::min(placement->dimension(), type.tangent_size()) : 1;
}

bool determines_each(const Graph& graph, int factor) {
  return is_whole_relative_pose(graph, factor) && !graph.loss(factor);
}

namespace {

/// Cameras with unknown intrinsics and the points that they see: pixels, metres and coefficients of
/// distortion span so many orders of magnitude that what is free cannot be told from what is weak,
/// but of each variable alone.
bool has_cameras(const Graph& graph) {
  return std::ranges::any_of(graph.variable_pools(), [](const VariablePool& pool) {
    const Placement* placement = pool.type->placement();
    if (pool.variables.empty() || !placement || !placement->has_orientation()) return false;
    const int rigid = placement->dimension() == 2 ? 3 : 6;
    return pool.type->lie_group() == nullptr && pool.type->tangent_size() > rigid;
  });
}

}  // namespace

FreeDirections find_free_directions(const Graph& graph, const Gauge& gauge, const Values& values) {
  if (has_cameras(graph)) return free_alone(graph, gauge, values, GraphRows(graph, values));
  if (all_are_whole_relative_poses(graph, gauge)) return {};
  const std::vector<bool> determined =
      determined_by_whole_relative_poses(graph, gauge.held, values);
  const std::vector<std::int32_t> factors = factors_on_others(graph, determined);
  if (factors.empty()) {
    FreeDirections nothing;
    nothing.everywhere = !graph.has_losses();  // a factor without weight is none
    return nothing;
  }
  std::vector<std::int32_t> sizes, units;
  for (int v = 0; v < graph.variable_count(); ++v) {
    sizes.push_back(graph.type(v).tangent_size());
    units.push_back(numbers_of_one_unit(graph.type(v)));
  }
  return find_free_directions(GraphRows(graph, values), {sizes, units, determined, factors});
}

FreeDirections find_free_directions(const Graph& graph) {
  // Of relative poses alone the gauge holds one in every component.
  if (all_are_whole_relative_poses(graph)) return {};
  return find_free_directions(graph, resolve_gauge(graph), graph.values());
}

}  // namespace cairn
