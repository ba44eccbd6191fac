// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/elimination.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <unordered_map>
#include <utility>

#include <fmt/core.h>

#include "cairn/graph/disjoint_sets.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/factor_call.hpp"
#include "cairn/types/loss.hpp"
#include "cairn/update/marginal_prior.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/products.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Pivots of the scaled H_mm below this are what rounding left of a zero.
constexpr double kZeroPivot = 1e-12;

/// The variables of a group of factors that move: those that leave, then those that stay.
struct Columns {
  std::vector<int> variables;
  std::vector<int> offsets{0};
  std::size_t leaving = 0;  ///< the first so many variables leave
  std::unordered_map<int, int> place;

  void add(const Graph& graph, int variable) {
    place.emplace(variable, static_cast<int>(variables.size()));
    variables.push_back(variable);
    offsets.push_back(offsets.back() + graph.type(variable).tangent_size());
  }
};

/// H δ = g of a few factors.
struct Quadratic {
  MatrixXd H;
  VectorXd g;
};

class Eliminator {
 public:
  Eliminator(const Graph& graph, std::span<const int> variables, const std::vector<bool>& held,
             std::span<const int> factors)
      : graph_(graph),
        held_(held),
        factors_(factors),
        leaves_(static_cast<std::size_t>(graph.variable_count()), false) {
    for (const int v : variables) leaves_[v] = true;
  }

  Elimination run() const {
    Elimination result;
    result.replaced.assign(factors_.begin(), factors_.end());
    for (const std::vector<int>& group : groups()) {
      if (std::optional<Factor> prior = prior_of(group)) result.priors.push_back(*prior);
    }
    return result;
  }

 private:
  bool is_eliminated(int variable) const { return leaves_[variable] && !held_[variable]; }
  /// Has no columns: held for good, as far as this elimination goes.
  bool is_given(int variable) const {
    return leaves_[variable] ? held_[variable] : graph_.fixed(variable);
  }

  /// Factors that share a variable to be eliminated, together; in the order of their first.
  std::vector<std::vector<int>> groups() const {
    DisjointSets sets(static_cast<int>(factors_.size()));
    std::unordered_map<int, int> first;  // by eliminated variable: the first factor on it
    for (int k = 0; k < std::ssize(factors_); ++k) {
      for (const std::int32_t v : graph_.factor_variables(factors_[k])) {
        if (!is_eliminated(v)) continue;
        sets.join(first.try_emplace(v, k).first->second, k);
      }
    }
    std::vector<std::vector<int>> result;
    std::vector<int> group(factors_.size(), -1);
    for (int k = 0; k < std::ssize(factors_); ++k) {
      int& g = group[sets.find(k)];
      if (g < 0) {
        g = static_cast<int>(result.size());
        result.emplace_back();
      }
      result[g].push_back(factors_[k]);
    }
    return result;
  }

  std::optional<Factor> prior_of(const std::vector<int>& group) const {
    const Columns columns = columns_of(group);
    const int m = columns.offsets[columns.leaving], n = columns.offsets.back() - m;
    if (n == 0) return std::nullopt;
    Quadratic all = sum(group, columns);
    const VectorXd diagonal = all.H.diagonal().tail(n);
    if (m > 0) all = schur_complement(all, m);
    const VectorXd scale = (diagonal.array() > 0.0).select(diagonal, 1.0);
    LinearResidual residual = square_root({all.H.data(), static_cast<std::size_t>(n * n)},
                                          {all.g.data(), static_cast<std::size_t>(n)},
                                          {scale.data(), static_cast<std::size_t>(n)});
    if (residual.rows == 0) return std::nullopt;

    Factor factor;
    std::vector<MarginalPrior::Variable> variables;
    for (std::size_t k = columns.leaving; k < columns.variables.size(); ++k) {
      const int v = columns.variables[k];
      const std::span<const double> x = graph_.state(v);
      variables.push_back({graph_.type_of(v), {x.begin(), x.end()}});
      factor.variables.push_back(graph_.id(v));
    }
    const auto type = std::make_shared<MarginalPrior>(std::move(variables), std::move(residual),
                                                      absolute_size(group));
    factor.information = type->unit_information();
    factor.type = type;
    return factor;
  }

  Columns columns_of(const std::vector<int>& group) const {
    std::vector<int> touched;
    for (const int f : group) {
      for (const std::int32_t v : graph_.factor_variables(f)) {
        if (!is_given(v)) touched.push_back(v);
      }
    }
    std::ranges::sort(touched);
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
    std::stable_partition(touched.begin(), touched.end(), [&](int v) { return leaves_[v]; });
    Columns columns;
    for (const int v : touched) {
      columns.add(graph_, v);
      columns.leaving += leaves_[v];
    }
    return columns;
  }

  Quadratic sum(const std::vector<int>& group, const Columns& columns) const {
    const int n = columns.offsets.back();
    Quadratic total{MatrixXd::Zero(n, n), VectorXd::Zero(n)};
    for (const int f : group) add(f, columns, total);
    if (!total.H.allFinite() || !total.g.allFinite()) {
      throw Error(ErrorCode::numerical,
                  fmt::format("{} cannot be marginalized: the measurements' derivatives at the "
                              "estimate are not finite",
                              graph_.describe_variable(columns.variables.front())));
    }
    return total;
  }

  void add(int f, const Columns& columns, Quadratic& total) const {
    const FactorType& type = graph_.factor_type(f);
    const int rows = type.residual_size();
    const auto variables = graph_.factor_variables(f);
    std::vector<const double*> x;
    std::vector<MatrixXd> J;
    std::vector<double*> targets;
    for (std::size_t k = 0; k < variables.size(); ++k) {
      x.push_back(graph_.state(variables[k]).data());
      J.emplace_back(rows, type.tangent_size(static_cast<int>(k)));
    }
    for (MatrixXd& block : J) targets.push_back(block.data());
    VectorXd r(rows);
    call_factor(
        type, [&] { return graph_.describe_factor(f); },
        [&] {
          type.evaluate(x.data(), graph_.measurement(f).data(), graph_.sqrt_information(f).data(),
                        r.data(), targets.data());
        });
    const double weight = weight_of(f, r.squaredNorm());
    for (std::size_t a = 0; a < variables.size(); ++a) {
      const auto row = columns.place.find(variables[a]);
      if (row == columns.place.end()) continue;
      const int at = columns.offsets[row->second];
      total.g.segment(at, J[a].cols()) -= weight * J[a].transpose() * r;
      for (std::size_t b = 0; b < variables.size(); ++b) {
        const auto column = columns.place.find(variables[b]);
        if (column == columns.place.end()) continue;
        total.H.block(at, columns.offsets[column->second], J[a].cols(), J[b].cols()) +=
            dense::scaled_product_of_transpose(weight, J[a], J[b]);
      }
    }
  }

  double weight_of(int factor, double squared_norm) const {
    double weight = 1.0;
    const FactorRef at = graph_.ref(factor);
    graph_.weigh(at.pool, static_cast<std::size_t>(at.entry), {&squared_norm, 1}, {}, {&weight, 1});
    return weight;
  }

  /// Eliminates the first m unknowns. H_mm is scaled to unit diagonal; where it is singular, what
  /// it does not determine has no part in the rest either, and the pseudo-inverse is exact.
  static Quadratic schur_complement(const Quadratic& all, int m) {
    const auto n = all.H.rows() - m;
    VectorXd unit = all.H.diagonal().head(m);
    unit = (unit.array() > 0.0).select(unit.cwiseSqrt().cwiseInverse(), 1.0);
    const MatrixXd mm = unit.asDiagonal() * all.H.topLeftCorner(m, m) * unit.asDiagonal();
    MatrixXd right(m, n + 1);
    right << unit.asDiagonal() * all.H.topRightCorner(m, n), unit.asDiagonal() * all.g.head(m);
    MatrixXd half;  // H_mm^(-1/2) times the right-hand sides
    const Eigen::LLT<MatrixXd> llt(mm);
    if (llt.info() == Eigen::Success &&
        llt.matrixLLT().diagonal().array().square().minCoeff() > kZeroPivot) {
      half = llt.matrixL().solve(right);
    } else {
      const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(mm);
      const VectorXd root = (eigen.eigenvalues().array() > kZeroPivot)
                                .select(eigen.eigenvalues().cwiseSqrt().cwiseInverse(), 0.0);
      half = root.asDiagonal() * dense::product_of_transpose(eigen.eigenvectors(), right);
    }
    MatrixXd H = all.H.bottomRightCorner(n, n);
    dense::subtract_product_of_transpose(half.leftCols(n), half.leftCols(n), H);
    return {std::move(H), all.g.tail(n) - half.leftCols(n).transpose() * half.col(n)};
  }

  /// What is known of where the group is in the world goes on to its prior: all that can be, if
  /// anything on its factors is held.
  int absolute_size(const std::vector<int>& group) const {
    constexpr int kAll = std::numeric_limits<int>::max();
    std::int64_t total = 0;
    for (const int f : group) {
      for (const std::int32_t v : graph_.factor_variables(f)) {
        if (is_given(v)) return kAll;
      }
      total += graph_.absolute_size(f);
    }
    return static_cast<int>(std::min<std::int64_t>(total, kAll));
  }

  const Graph& graph_;
  const std::vector<bool>& held_;
  std::span<const int> factors_;
  std::vector<bool> leaves_;
};

}  // namespace

Elimination eliminate(const Graph& graph, std::span<const int> variables,
                      const std::vector<bool>& held, std::span<const int> factors) {
  return Eliminator(graph, variables, held, factors).run();
}

Elimination eliminate(const Graph& graph, std::span<const int> variables,
                      const std::vector<bool>& held) {
  std::vector<bool> leaves(static_cast<std::size_t>(graph.variable_count()), false);
  for (const int v : variables) leaves[v] = true;
  std::vector<int> factors;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto on = graph.factor_variables(f);
    if (std::ranges::any_of(on, [&](std::int32_t v) { return leaves[v]; })) factors.push_back(f);
  }
  return eliminate(graph, variables, held, factors);
}

}  // namespace cairn
