// SPDX-License-Identifier: BSD-3-Clause
#include "domain_entry.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/types/domain.hpp"
#include "cairn/types/factor_call.hpp"
#include "dense/cholesky.hpp"

namespace cairn {
namespace {

/// Factors with smaller squared residuals may be mirrored images that fit.
constexpr double kLarge = 2500.0;
/// So many times farther than others, a point is as good as at infinity.
constexpr double kFar = 30.0;
/// So many factors tell how far variables are from each other.
constexpr std::size_t kSampled = 1000;
constexpr int kIterations = 30;
/// Places for a variable, as shares of the distance at which others are.
constexpr double kReaches[] = {1.0, 0.3, 3.0};

using State = std::vector<double>;

template <class Values>
auto state_in(const Graph& graph, Values& values, int v) {
  const auto size = static_cast<std::size_t>(graph.type(v).ambient_size());
  auto& pool = values.pools[static_cast<std::size_t>(graph.pool(v))];
  return std::span(pool.data() + static_cast<std::size_t>(graph.slot(v)) * size, size);
}

/// The states of a factor's variables.
std::vector<const double*> states_in(const Graph& graph, const Values& values, int factor) {
  std::vector<const double*> all;
  for (const std::int32_t v : graph.factor_variables(factor))
    all.push_back(state_in(graph, values, v).data());
  return all;
}

/// One variable, all others constant.
class Alone {
 public:
  Alone(const Graph& graph, const Values& values, int variable, std::span<const int> factors)
      : graph_(graph), values_(values), variable_(variable), factors_(factors) {}

  std::span<const double> now() const { return state_in(graph_, values_, variable_); }
  std::span<const int> factors() const { return factors_; }

  /// The states of a factor's variables, this one's being `x`.
  std::vector<const double*> states(int factor, const State& x) const {
    std::vector<const double*> all = states_in(graph_, values_, factor);
    const auto on = graph_.factor_variables(factor);
    for (std::size_t k = 0; k < on.size(); ++k) {
      if (on[k] == variable_) all[k] = x.data();
    }
    return all;
  }
  double chi2(const State& x) const {
    double sum = 0.0;
    for (const int f : factors_) sum += residual(f, x, nullptr).squaredNorm();
    return sum;
  }
  bool is_inside(const State& x) const {
    return std::ranges::all_of(factors_, [&](int f) {
      const auto* domain = dynamic_cast<const Domain*>(&graph_.factor_type(f));
      return !domain || domain->outside(states(f, x).data()).empty();
    });
  }
  /// A few iterations of Levenberg-Marquardt from x; returns chi2.
  double descend(State& x) const;

 private:
  Eigen::VectorXd residual(int factor, const State& x, Eigen::MatrixXd* J) const {
    const FactorType& type = graph_.factor_type(factor);
    const auto on = graph_.factor_variables(factor);
    Eigen::VectorXd r(type.residual_size());
    std::vector<double*> jacobians(on.size(), nullptr);
    for (std::size_t k = 0; J && k < on.size(); ++k) {
      if (on[k] != variable_) continue;
      J->resize(r.size(), type.tangent_size(static_cast<int>(k)));
      jacobians[k] = J->data();
    }
    type.evaluate(states(factor, x).data(), graph_.measurement(factor).data(),
                  graph_.sqrt_information(factor).data(), r.data(), J ? jacobians.data() : nullptr);
    return r;
  }

  const Graph& graph_;
  const Values& values_;
  int variable_;
  std::span<const int> factors_;
};

double Alone::descend(State& x) const {
  const VariableType& type = graph_.type(variable_);
  const int n = type.tangent_size();
  double reached = chi2(x), lambda = 1e-4;
  State trial = x;
  Eigen::MatrixXd J;
  for (int k = 0; k < kIterations && lambda < 1e10; ++k) {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
    for (const int f : factors_) {
      const Eigen::VectorXd r = residual(f, x, &J);
      H.noalias() += J.transpose() * J;
      g.noalias() -= J.transpose() * r;
    }
    H.diagonal() *= 1.0 + lambda;
    const Eigen::VectorXd step = Eigen::LDLT<Eigen::MatrixXd>(H).solve(g);
    if (!step.allFinite()) break;
    const std::int64_t offset = 0;
    type.retract(1, x.data(), &offset, step.data(), trial.data());
    const double next = chi2(trial);
    if (next < reached) {
      const bool arrived = next > (1.0 - 1e-9) * reached;
      x = trial;
      reached = next;
      lambda *= 0.1;
      if (arrived) break;
    } else {
      lambda *= 10.0;
    }
  }
  return reached;
}

/// The factors of one type with a domain.
struct Pool {
  const Domain& domain;
  std::vector<int> large;  ///< positions in the graph
  double reach = 1.0;      ///< how far their variables are from each other, the median
};

/// Nothing where no residual is large.
std::optional<Pool> survey(const Graph& graph, int number, const Values& values) {
  const FactorPool& pool = graph.factor_pools()[static_cast<std::size_t>(number)];
  const auto* domain = dynamic_cast<const Domain*>(pool.type.get());
  if (!domain || pool.size() == 0) return std::nullopt;
  std::vector<const double*> states;
  std::vector<double> norms(pool.size());
  const FactorView view = graph.view(number, values, states);
  call_factor(*pool.type, [&] { pool.type->squared_norms(view, 0, norms.size(), norms.data()); });
  Pool found{*domain, {}};
  for (std::size_t entry = 0; entry < norms.size(); ++entry)
    if (!(norms[entry] <= kLarge)) found.large.push_back(pool.sequence[entry]);
  if (found.large.empty()) return std::nullopt;
  std::vector<double> reaches;
  for (std::size_t entry = 0; entry < norms.size(); entry += 1 + norms.size() / kSampled) {
    const double reach = domain->reach(states_in(graph, values, pool.sequence[entry]).data());
    if (reach > 0.0) reaches.push_back(reach);
  }
  if (!reaches.empty()) {
    const auto middle = reaches.begin() + std::ssize(reaches) / 2;
    std::ranges::nth_element(reaches, middle);
    found.reach = *middle;
  }
  return found;
}

/// The best state inside all domains that is found from the places that the factors give; nothing
/// if none is better than the present one, or none gives any.
std::optional<State> better_inside(const Graph& graph, const Alone& alone, int variable,
                                   double reach) {
  const State now(alone.now().begin(), alone.now().end());
  std::optional<State> best;
  double least = -1.0;  // not known yet
  for (const int f : alone.factors()) {
    const auto* domain = dynamic_cast<const Domain*>(&graph.factor_type(f));
    const auto on = graph.factor_variables(f);
    const int target = static_cast<int>(std::ranges::find(on, variable) - on.begin());
    for (const double share : kReaches) {
      State x = now;
      if (!domain || !domain->place(target, alone.states(f, now).data(),
                                    graph.measurement(f).data(), share * reach, x.data()))
        break;
      if (least < 0.0) least = alone.chi2(now);
      const double reached = alone.descend(x);
      if (!(reached < least) || !alone.is_inside(x)) continue;
      least = reached;
      best = std::move(x);
    }
  }
  return best;
}

/// Whether a factor with a large residual says nothing, or nearly nothing, of how to lower it.
bool is_astray(const Graph& graph, const Pool& pool, const Values& values, int factor) {
  const double reach = pool.domain.reach(states_in(graph, values, factor).data());
  return !(reach > 0.0 && reach <= kFar * pool.reach);
}

using FactorsOf = std::map<std::int32_t, std::vector<int>>;

/// The factors of each variable that has one with a large residual.
FactorsOf factors_of_suspects(const Graph& graph, const std::vector<Pool>& pools) {
  std::vector<bool> suspect(static_cast<std::size_t>(graph.variable_count()), false);
  for (const Pool& pool : pools)
    for (const int f : pool.large)
      for (const std::int32_t v : graph.factor_variables(f))
        suspect[static_cast<std::size_t>(v)] = true;
  FactorsOf factors;
  for (const FactorPool& pool : graph.factor_pools()) {
    const auto arity = static_cast<std::size_t>(pool.type->arity());
    for (std::size_t k = 0; k < pool.variables.size(); ++k) {
      const std::int32_t v = pool.variables[k];
      if (suspect[static_cast<std::size_t>(v)]) factors[v].push_back(pool.sequence[k / arity]);
    }
  }
  return factors;
}

/// The variables that most of their residuals, or one without a meaning, show to be misplaced, each
/// with one of these factors.
std::map<std::int32_t, int> misplaced(const Graph& graph, const Pool& pool,
                                      const FactorsOf& factors, const Values& values) {
  std::map<std::int32_t, std::size_t> large;
  std::map<std::int32_t, int> found;
  for (const int f : pool.large) {
    const bool astray = is_astray(graph, pool, values, f);
    for (const std::int32_t v : graph.factor_variables(f)) {
      if (2 * ++large[v] > factors.at(v).size() || astray) found.try_emplace(v, f);
    }
  }
  return found;
}

std::string in_words(const Graph& graph, const Pool& pool, const Values& values, int factor) {
  const std::string outside = pool.domain.outside(states_in(graph, values, factor).data());
  return fmt::format("{}: {}", graph.describe_factor(factor),
                     outside.empty() ? "its residual is large" : outside);
}

}  // namespace

std::string enter_domains(const Graph& graph, const std::vector<bool>& held, Values& values) {
  std::vector<Pool> pools;
  for (int p = 0; p < static_cast<int>(graph.factor_pools().size()); ++p)
    if (std::optional<Pool> found = survey(graph, p, values)) pools.push_back(std::move(*found));
  if (pools.empty()) return {};

  const FactorsOf factors = factors_of_suspects(graph, pools);
  std::string first;
  int moved = 0;
  for (const Pool& pool : pools) {
    for (const auto& [v, factor] : misplaced(graph, pool, factors, values)) {
      if (held[static_cast<std::size_t>(v)]) continue;
      const Alone alone(graph, values, v, factors.at(v));
      const std::optional<State> better = better_inside(graph, alone, v, pool.reach);
      if (!better) continue;
      if (moved++ == 0) first = in_words(graph, pool, values, factor);
      std::ranges::copy(*better, state_in(graph, values, v).begin());
    }
  }
  if (moved == 0) return {};
  if (moved == 1) return first + "; it began where its factors put it instead";
  return fmt::format("{}; {} variables began where their factors put them instead", first, moved);
}

}  // namespace cairn
