// SPDX-License-Identifier: BSD-3-Clause
#include "eigen_solver.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

#include <Eigen/OrderingMethods>

namespace cairn {
namespace {

/// The block that is eliminated k-th, by Eigen's AMD on the graph of the blocks.
std::vector<int> amd_order(const BlockStructure& structure) {
  std::vector<Eigen::Triplet<double, int>> entries;
  entries.reserve(structure.entries());
  for (int column = 0; column < structure.blocks(); ++column) {
    for (std::int64_t e = structure.column_begin()[column];
         e < structure.column_begin()[column + 1]; ++e) {
      entries.emplace_back(structure.rows()[e], column, 1.0);
    }
  }
  Eigen::SparseMatrix<double> graph(structure.blocks(), structure.blocks());
  graph.setFromTriplets(entries.begin(), entries.end());
  Eigen::AMDOrdering<int>::PermutationType order;
  Eigen::AMDOrdering<int>()(graph.selfadjointView<Eigen::Lower>(), order);
  return {order.indices().begin(), order.indices().end()};
}

}  // namespace

EigenSolver::EigenSolver(const EigenOptions& options) : ordering_(options.ordering) {}

void EigenSolver::analyze(const BlockStructure& structure) {
  version_ = 0;
  factorized_ = false;
  std::vector<int> order(structure.blocks());
  if (ordering_ == "amd") {
    order = amd_order(structure);
  } else {
    std::iota(order.begin(), order.end(), 0);
  }
  scalars_.clear();
  block_of_scalar_.assign(structure.size(), 0);
  for (const int block : order) {
    for (std::int64_t k = structure.offsets()[block]; k < structure.offsets()[block + 1]; ++k) {
      scalars_.push_back(static_cast<int>(k));
      block_of_scalar_[k] = block;
    }
  }
  build_permuted(structure);
  ldlt_.analyzePattern(permuted_);
  right_.resize(pattern_.size());

  marginals_.analyze(structure.sizes());
  version_ = structure.version();
  stats_ = {};
  stats_.ordering = ordering_;
  for (int column = 0; column < pattern_.size(); ++column) {
    const double entries = 1.0 + ldlt_.column_entries(column);
    stats_.factor_nonzeros += static_cast<std::int64_t>(entries);
    stats_.factor_flops += entries * entries;
  }
  stats_.note = "simplicial LDLT";
}

/// The upper triangle of P H Pᵀ by columns, and where in it each value of the pattern goes: a
/// counting sort by permuted row, then, stably, by permuted column.
void EigenSolver::build_permuted(const BlockStructure& structure) {
  pattern_ = ScalarPattern(structure, ScalarPattern::Triangle::lower);
  const int n = pattern_.size();
  const int nonzeros = static_cast<int>(pattern_.nonzeros());
  std::vector<int> position(n);
  for (int k = 0; k < n; ++k) position[scalars_[k]] = k;

  std::vector<std::pair<int, int>> target(nonzeros);  // row, column in the permuted upper triangle
  for (int column = 0; column < n; ++column) {
    for (int k = pattern_.column_begin()[column]; k < pattern_.column_begin()[column + 1]; ++k) {
      target[k] = std::minmax({position[pattern_.rows()[k]], position[column]});
    }
  }
  const auto sorted = [&](const std::vector<int>& sequence, auto key) {
    std::vector<int> begin(n + 1, 0), result(nonzeros);
    for (const int k : sequence) ++begin[key(k) + 1];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    for (const int k : sequence) result[begin[key(k)]++] = k;
    return result;
  };
  std::vector<int> sequence(nonzeros);
  std::iota(sequence.begin(), sequence.end(), 0);
  sequence = sorted(sequence, [&](int k) { return target[k].first; });
  sequence = sorted(sequence, [&](int k) { return target[k].second; });

  permuted_.resize(n, n);
  permuted_.resizeNonZeros(nonzeros);
  std::fill_n(permuted_.outerIndexPtr(), n + 1, 0);
  place_.resize(nonzeros);
  for (int place = 0; place < nonzeros; ++place) {
    const int k = sequence[place];
    place_[k] = place;
    permuted_.innerIndexPtr()[place] = target[k].first;
    ++permuted_.outerIndexPtr()[target[k].second + 1];
  }
  std::partial_sum(permuted_.outerIndexPtr(), permuted_.outerIndexPtr() + n + 1,
                   permuted_.outerIndexPtr());
  values_.assign(nonzeros, 0.0);
}

Factorization EigenSolver::factorize(const BlockMatrix& H) {
  if (version_ == 0 || H.structure().version() != version_) {
    throw std::logic_error("linear_solver eigen: factorize before analyze of that structure");
  }
  pattern_.scatter(H, values_);
  double* permuted = permuted_.valuePtr();
  for (std::size_t k = 0; k < values_.size(); ++k) permuted[place_[k]] = values_[k];
  ldlt_.factorize(permuted_);
  // Eigen stops at a pivot of zero alone; it is then the last that was written.
  factorized_ = false;
  for (int k = 0; k < pattern_.size(); ++k) {
    if (!(ldlt_.pivot(k) > 0.0) || !std::isfinite(ldlt_.pivot(k)))
      return {false, block_of_scalar_[scalars_[k]]};
  }
  factorized_ = true;
  return {};
}

void EigenSolver::solve(std::span<const double> g, std::span<double> x) {
  if (!factorized_) throw std::logic_error("linear_solver eigen: solve without a factorisation");
  for (Eigen::Index k = 0; k < right_.size(); ++k) right_[k] = g[scalars_[k]];
  ldlt_.matrixL().solveInPlace(right_);
  right_.array() /= ldlt_.vectorD().array();
  ldlt_.matrixU().solveInPlace(right_);
  for (Eigen::Index k = 0; k < right_.size(); ++k) x[scalars_[k]] = right_[k];
}

double EigenSolver::log_determinant() const {
  if (!factorized_)
    throw std::logic_error("linear_solver eigen: log_determinant without a factorisation");
  double sum = 0.0;
  for (int k = 0; k < pattern_.size(); ++k) sum += std::log(ldlt_.pivot(k));
  return sum;
}

void* EigenSolver::ability(std::string_view name) {
  if (name == LogDeterminant::kAbility) return static_cast<LogDeterminant*>(this);
  if (name == Marginals::kAbility) return static_cast<Marginals*>(&marginals_);
  return nullptr;
}

}  // namespace cairn
