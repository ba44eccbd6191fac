// SPDX-License-Identifier: BSD-3-Clause
#include "stationary_factors.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <utility>

#include <Eigen/Core>

#include "cairn/graph/factors_by_variable.hpp"
#include "cairn/graph/free_directions.hpp"
#include "cairn/types/factor_call.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// So many factors are looked at more closely, those with the largest residuals.
constexpr std::size_t kMost = 500;
/// Directions in which a residual changes by less than this part of the most have no influence.
constexpr double kInfluence = 1e-6;
/// A factor is stationary if its variables' small motions can lower its squared residual by no more
/// than this part of it.
constexpr double kLowered = 0.5;
/// What a motion must lower it by to show that it is no minimum.
constexpr double kShown = 1e-3;
/// So often an optimisation goes on from beside; if chi2 has fallen by this part; and so near to
/// the one that it left it has come back.
constexpr unsigned kMostDepartures = 5;
constexpr double kBetter = 1e-6;
constexpr double kReturned = 1e-3;
/// So many motions are tried for each of a variable's degrees of freedom.
constexpr int kProbes = 6;
/// How far at random, as a part of the residual, and of one radian.
constexpr double kAside = 0.1;

using State = std::vector<double>;

/// Numbers from -1 to 1. Not by `uniform_real_distribution`, whose numbers the standard leaves
/// open.
VectorXd at_random(int size, std::mt19937& random) {
  return VectorXd::NullaryExpr(size, [&] {
    return 2.0 * static_cast<double>(random()) / static_cast<double>(std::mt19937::max()) - 1.0;
  });
}

std::span<double> state_in(const Graph& graph, Values& values, int v) {
  const auto size = static_cast<std::size_t>(graph.type(v).ambient_size());
  auto& pool = values.pools[static_cast<std::size_t>(graph.pool(v))];
  return std::span(pool.data() + static_cast<std::size_t>(graph.slot(v)) * size, size);
}

/// One factor at some states, in the units of its error: each row of its residual divided by the
/// norm of that row of the root of the information, rows that measure nothing being zero.
class OneFactor {
 public:
  OneFactor(const Graph& graph, const std::vector<bool>& held, Values& values, int factor)
      : graph_(graph), held_(held), values_(values), factor_(factor) {
    const std::span<const double> root = graph.sqrt_information(factor);
    const int rows = type().residual_size();
    std::size_t at = 0;
    for (int row = 0; row < rows; ++row) {
      double sum = 0.0;
      for (int column = row; column < rows; ++column, ++at) sum += root[at] * root[at];
      weights_.push_back(std::sqrt(sum));
    }
  }

  const FactorType& type() const { return graph_.factor_type(factor_); }
  std::span<const std::int32_t> variables() const { return graph_.factor_variables(factor_); }
  bool held(std::int32_t v) const { return held_[static_cast<std::size_t>(v)]; }

  VectorXd residual() const { return evaluate(nullptr); }

  /// Whether small motions lower the residual by little, and larger ones by more.
  bool is_stationary() const {
    MatrixXd J;
    const VectorXd r = evaluate(&J);
    const double all = r.squaredNorm();
    if (J.cols() == 0 || !(all > 0.0) || !std::isfinite(all) || !J.allFinite()) return false;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(MatrixXd(J * J.transpose()));
    const double least = kInfluence * kInfluence * eigen.eigenvalues().maxCoeff();
    double lowered = 0.0;
    for (Eigen::Index k = 0; k < r.size(); ++k) {
      if (!(eigen.eigenvalues()[k] > least)) continue;
      const double part = eigen.eigenvectors().col(k).dot(r);
      lowered += part * part;
    }
    return lowered < kLowered * all && is_no_minimum(all);
  }

  /// Which numbers of a variable's tangent space the residual depends on.
  std::vector<bool> influence(std::int32_t v) const {
    const int n = graph_.type(v).tangent_size();
    const VectorXd before = residual();
    std::vector<bool> has(static_cast<std::size_t>(n));
    for (int k = 0; k < n; ++k) {
      const VectorXd change = residual_after(v, kAside * VectorXd::Unit(n, k)) - before;
      has[static_cast<std::size_t>(k)] = change.norm() > kInfluence * before.norm();
    }
    return has;
  }

  /// Where a variable has moved by that; it is back afterwards.
  VectorXd residual_after(std::int32_t v, const VectorXd& delta) const {
    const std::span<double> x = state_in(graph_, values_, v);
    const State before(x.begin(), x.end());
    retract(v, delta);
    VectorXd r = residual();
    std::ranges::copy(before, x.begin());
    return r;
  }

  void retract(std::int32_t v, const VectorXd& delta) const {
    const std::span<double> x = state_in(graph_, values_, v);
    const State before(x.begin(), x.end());
    const std::int64_t offset = 0;
    graph_.type(v).retract(1, before.data(), &offset, delta.data(), x.data());
  }

  /// Puts a variable where the measurement sees it from the others; false if it does not say.
  bool place(int target) const {
    const std::span<double> x = state_in(graph_, values_, variables()[target]);
    State placed(x.begin(), x.end());
    const bool can = call_factor(type(), [&] {
      return type().propagate(target, states().data(), graph_.measurement(factor_).data(),
                              placed.data());
    });
    if (can) std::ranges::copy(placed, x.begin());
    return can;
  }

 private:
  std::vector<const double*> states() const {
    std::vector<const double*> all;
    for (const std::int32_t v : variables()) all.push_back(state_in(graph_, values_, v).data());
    return all;
  }

  /// J, unless null, gets the columns of the variables that are not held.
  VectorXd evaluate(MatrixXd* J) const {
    const auto on = variables();
    VectorXd r(type().residual_size());
    int columns = 0;
    for (std::size_t k = 0; k < on.size(); ++k)
      if (!held(on[k])) columns += type().tangent_size(static_cast<int>(k));
    std::vector<double*> blocks(on.size(), nullptr);
    if (J) {
      J->resize(r.size(), columns);
      double* next = J->data();
      for (std::size_t k = 0; k < on.size(); ++k) {
        if (held(on[k])) continue;
        blocks[k] = next;
        next += r.size() * type().tangent_size(static_cast<int>(k));
      }
    }
    call_factor(type(), [&] {
      type().evaluate(states().data(), graph_.measurement(factor_).data(),
                      graph_.sqrt_information(factor_).data(), r.data(),
                      J ? blocks.data() : nullptr);
    });
    for (Eigen::Index row = 0; row < r.size(); ++row) {
      const double weight = weights_[static_cast<std::size_t>(row)];
      const double scale = weight > 0.0 ? 1.0 / weight : 0.0;
      r[row] *= scale;
      if (J && columns > 0) J->row(row) *= scale;
    }
    return r;
  }

  /// Whether some motion of one of its variables, of the size of the residual, lowers it.
  bool is_no_minimum(double now) const {
    std::mt19937 random;
    const double size = std::min(1.0, std::sqrt(now));
    for (const std::int32_t v : variables()) {
      if (held(v)) continue;
      for (int k = 0; k < kProbes * graph_.type(v).tangent_size(); ++k) {
        const VectorXd delta = size * at_random(graph_.type(v).tangent_size(), random);
        if (residual_after(v, delta).squaredNorm() < (1.0 - kShown) * now) return true;
      }
    }
    return false;
  }

  const Graph& graph_;
  const std::vector<bool>& held_;
  Values& values_;
  int factor_;
  std::vector<double> weights_;
};

/// Whether no factor of a pool is worth a look: in relative poses that are wholly measured every
/// residual answers to small motions, but for half a turn in some metrics, which leaves large
/// residuals.
bool is_regular(const FactorPool& pool, double chi2_per_residual) {
  const int n = pool.type->residual_size();
  return pool.type->is_relative() && pool.type->tangent_size(0) == n && chi2_per_residual <= 1.0;
}

/// The factors whose residuals are above the mean, the largest first and not more than `kMost`.
std::vector<int> large_ones(const Graph& graph, const Values& values, double chi2_per_residual) {
  std::vector<std::pair<double, int>> all;
  double sum = 0.0;
  std::vector<double> norms;
  std::vector<const double*> states;
  for (std::size_t p = 0; p < graph.factor_pools().size(); ++p) {
    const FactorPool& pool = graph.factor_pools()[p];
    if (pool.size() == 0 || is_regular(pool, chi2_per_residual)) continue;
    norms.resize(pool.size());
    const FactorView view = graph.view(static_cast<int>(p), values, states);
    call_factor(*pool.type, [&] { pool.type->squared_norms(view, 0, pool.size(), norms.data()); });
    for (std::size_t f = 0; f < norms.size(); ++f) {
      if (!std::isfinite(norms[f])) continue;
      sum += norms[f];
      all.emplace_back(norms[f], pool.sequence[f]);
    }
  }
  const double mean = sum / static_cast<double>(std::max<std::size_t>(all.size(), 1));
  std::erase_if(all, [&](const auto& each) { return !(each.first > 0.5 * mean); });
  const std::size_t count = std::min(all.size(), kMost);
  std::ranges::partial_sort(all, all.begin() + static_cast<std::ptrdiff_t>(count),
                            std::ranges::greater());
  std::vector<int> factors;
  for (std::size_t k = 0; k < count; ++k) factors.push_back(all[k].second);
  return factors;
}

double squared_norms(const Graph& graph, Values& values, std::span<const int> factors) {
  double sum = 0.0;
  for (const int f : factors) {
    const FactorType& type = graph.factor_type(f);
    std::vector<const double*> x;
    for (const std::int32_t v : graph.factor_variables(f))
      x.push_back(state_in(graph, values, v).data());
    VectorXd r(type.residual_size());
    call_factor(type, [&] {
      type.evaluate(x.data(), graph.measurement(f).data(), graph.sqrt_information(f).data(),
                    r.data(), nullptr);
    });
    sum += r.squaredNorm();
  }
  return sum;
}

/// Whether one of its variables could go where the measurement puts it.
bool place_one(const Graph& graph, Values& values, const FactorsByVariable& factors_of,
               const OneFactor& factor) {
  const auto on = factor.variables();
  for (int k = static_cast<int>(on.size()); k-- > 0;) {
    if (factor.held(on[k])) continue;
    const std::span<double> x = state_in(graph, values, on[k]);
    const State before(x.begin(), x.end());
    const std::span<const int> factors = factors_of[on[k]];
    const double chi2 = squared_norms(graph, values, factors);
    if (factor.place(k) && squared_norms(graph, values, factors) < (1.0 - kShown) * chi2)
      return true;
    std::ranges::copy(before, x.begin());
  }
  return false;
}

/// Moves the smallest variable, of these the last one, aside.
void push_aside(const Graph& graph, const OneFactor& factor, std::mt19937& random) {
  std::int32_t moved = -1;
  for (const std::int32_t v : factor.variables()) {
    if (factor.held(v)) continue;
    if (moved < 0 || graph.type(v).tangent_size() <= graph.type(moved).tangent_size()) moved = v;
  }
  const int n = graph.type(moved).tangent_size(),
            positions = numbers_of_one_unit(graph.type(moved));
  const double size = factor.residual().norm();
  const std::vector<bool> counts = factor.influence(moved);
  VectorXd delta = kAside * at_random(n, random);
  for (int k = 0; k < n; ++k) {
    if (!counts[static_cast<std::size_t>(k)]) delta[k] = 0.0;
    delta[k] *= k < positions ? size : std::min(size, 1.0);
  }
  factor.retract(moved, delta);
}

}  // namespace

std::optional<int> leave_stationary_factors(const Graph& graph, const std::vector<bool>& held,
                                            double chi2, unsigned attempt, Values& values) {
  const double per_residual =
      chi2 / static_cast<double>(std::max<std::int64_t>(graph.residual_size(), 1));
  std::optional<int> first;
  FactorsByVariable factors_of;
  std::mt19937 random(attempt + 1);
  for (const int f : large_ones(graph, values, per_residual)) {
    const OneFactor factor(graph, held, values, f);
    if (!factor.is_stationary()) continue;
    if (!first) {
      first = f;
      factors_of = FactorsByVariable(graph);
    }
    if (!place_one(graph, values, factors_of, factor)) push_aside(graph, factor, random);
  }
  return first;
}

bool Departures::depart(const Graph& graph, const std::vector<bool>& held, double chi2,
                        Values& values) {
  if (count_ == kMostDepartures) return false;
  if (count_ > 0 && !(chi2 < (1.0 - kBetter) * last_)) return false;
  const std::optional<int> factor = leave_stationary_factors(graph, held, chi2, count_, values);
  if (!factor) return false;
  if (count_++ == 0) {
    factor_ = *factor;
    first_ = chi2;
  }
  last_ = chi2;
  return true;
}

std::string Departures::conclude(const Graph& graph, double best_chi2, double chi2,
                                 Status& status) const {
  if (count_ == 0) return {};
  const std::string where = graph.describe_factor(factor_);
  if (best_chi2 < (1.0 - kBetter) * first_) {
    return where +
           " was where no small motion lowers its residual, which is no minimum; the optimisation "
           "went on from beside it";
  }
  if (status == Status::interrupted) return {};
  if (status == Status::converged && chi2 <= (1.0 + kReturned) * best_chi2) return {};
  status = Status::converged;
  return where +
         " is where no small motion lowers its residual, though larger ones do: the estimate may "
         "be no minimum; try another initial guess";
}

}  // namespace cairn
