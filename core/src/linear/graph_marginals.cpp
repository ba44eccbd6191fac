// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/graph_marginals.hpp"

#include <algorithm>
#include <cstddef>
#include <stdexcept>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn {
namespace {

Marginals& marginals_of(LinearSolver& solver) {
  if (auto* marginals = query<Marginals>(solver)) return *marginals;
  throw Error(ErrorCode::usage,
              "this linear solver cannot give covariances (it lacks the ability 'marginals'); "
              "block_cholesky can");
}

std::int64_t tangent(const Graph& graph, int variable) {
  return graph.type(variable).tangent_size();
}

}  // namespace

GraphMarginals::GraphMarginals(const Graph& graph, LinearSolver& solver)
    : graph_(&graph),
      equations_(graph, solver),
      marginals_(&marginals_of(solver)),
      of_jacobian_(query<JacobianSolver>(solver) != nullptr) {}

Factorization GraphMarginals::factorize() {
  singular_ = false;
  diagonal_.clear();
  if (size() == 0) return {};
  equations_.linearize(graph_->values());
  free_ = find_free_directions(*graph_, gauge(), graph_->values());
  if (!free_.empty()) {
    const int variable = free_.directions.front().moves.front().variable;
    return {.ok = false, .failed_block = equations_.linearizer().block_of(variable)};
  }
  Factorization factorization = equations_.factorize();
  if (!factorization.ok) return factorization;
  const BlockStructure& structure = equations_.linearizer().structure();
  std::int64_t entries = 0;
  for (int b = 0; b < structure.blocks(); ++b)
    entries += std::int64_t{structure.block_size(b)} * structure.block_size(b);
  diagonal_.resize(static_cast<std::size_t>(entries));
  {
    const Timed timed(diagonal_seconds_);
    marginals_->diagonal_blocks(diagonal_);
  }
  const double* variance = diagonal_.data();
  const double* information = equations_.diagonal().data();
  double worst = of_jacobian_ ? kFewestDigits * kFewestDigits : kFewestDigits;
  for (int b = 0; b < structure.blocks(); ++b) {
    const int n = structure.block_size(b);
    for (int k = 0; k < n; ++k) {
      const double product = variance[k * (n + 1)] * information[k];
      if (product <= worst) continue;
      worst = product;
      factorization = {.ok = false, .failed_block = b};
    }
    variance += std::ptrdiff_t{n} * n;
    information += n;
  }
  singular_ = !factorization.ok;
  return factorization;
}

std::string GraphMarginals::explain(const Factorization& failure) const {
  if (!free_.empty()) {
    const auto count = std::ssize(free_.directions);
    return fmt::format("H is not positive definite: {} gauge freedom{} likely; {}", count,
                       count == 1 ? " is" : "s are", free_.describe(*graph_, false));
  }
  if (!singular_) return equations_.explain(failure);
  const int free = equations_.free_directions();
  return fmt::format(
      "H is singular to rounding: the covariance of {} may have fewer than two digits{}",
      graph_->describe_variable(equations_.linearizer().variable_of(failure.failed_block)),
      free > 0 ? fmt::format("; {} direction{} hardly determined, by a gauge freedom or by "
                             "information that differs too much in size",
                             free, free == 1 ? " is" : "s are")
               : "");
}

std::vector<double> GraphMarginals::diagonal() {
  if (size() > 0 && diagonal_.empty())
    throw std::logic_error("GraphMarginals: diagonal without a factorisation");
  const Linearizer& linearizer = equations_.linearizer();
  std::int64_t entries = 0;
  for (int v = 0; v < graph_->variable_count(); ++v)
    entries += tangent(*graph_, v) * tangent(*graph_, v);
  std::vector<double> all(entries);
  auto from = diagonal_.begin();  // blocks are in the order of the variables
  auto to = all.begin();
  for (int v = 0; v < graph_->variable_count(); ++v) {
    const std::int64_t count = tangent(*graph_, v) * tangent(*graph_, v);
    if (linearizer.block_of(v) >= 0) {
      std::copy_n(from, count, to);
      from += count;
    }
    to += count;
  }
  return all;
}

std::vector<double> GraphMarginals::blocks(std::span<const std::pair<int, int>> pairs) {
  const Linearizer& linearizer = equations_.linearizer();
  const auto count = [&](const std::pair<int, int>& pair) {
    return tangent(*graph_, pair.first) * tangent(*graph_, pair.second);
  };
  const auto free = [&](const std::pair<int, int>& pair) {
    return linearizer.block_of(pair.first) >= 0 && linearizer.block_of(pair.second) >= 0;
  };
  std::vector<std::pair<std::int32_t, std::int32_t>> wanted;
  std::int64_t values = 0, all_values = 0;
  for (const auto& pair : pairs) {
    all_values += count(pair);
    if (!free(pair)) continue;
    wanted.emplace_back(linearizer.block_of(pair.first), linearizer.block_of(pair.second));
    values += count(pair);
  }
  std::vector<double> of_blocks(values), all(all_values);
  if (!wanted.empty()) marginals_->blocks(wanted, of_blocks);
  auto from = of_blocks.begin();
  auto to = all.begin();
  for (const auto& pair : pairs) {
    if (free(pair)) {
      std::copy_n(from, count(pair), to);
      from += count(pair);
    }
    to += count(pair);
  }
  return all;
}

std::vector<double> GraphMarginals::column(int variable) {
  const Linearizer& linearizer = equations_.linearizer();
  const std::int64_t columns = tangent(*graph_, variable), rows = graph_->tangent_size();
  std::vector<double> all(rows * columns);
  const int block = linearizer.block_of(variable);
  if (block < 0) return all;
  std::vector<double> of_blocks(size() * columns);
  marginals_->block_column(block, of_blocks);
  for (std::int64_t c = 0; c < columns; ++c) {
    auto from = of_blocks.begin() + c * size();
    auto to = all.begin() + c * rows;
    for (int v = 0; v < graph_->variable_count(); ++v) {
      const std::int64_t count = tangent(*graph_, v);
      if (linearizer.block_of(v) >= 0) {
        std::copy_n(from, count, to);
        from += count;
      }
      to += count;
    }
  }
  return all;
}

}  // namespace cairn
