// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/marginals.hpp"

#include <algorithm>
#include <stdexcept>

namespace cairn {
namespace {

using Pair = std::pair<std::int32_t, std::int32_t>;

/// Right-hand sides that are solved for together.
constexpr std::int64_t kTogether = 8;

void check_size(std::span<const double> out, std::int64_t expected) {
  if (std::ssize(out) != expected)
    throw std::logic_error("marginals: room for the result has another size than the result");
}

}  // namespace

Marginals::~Marginals() = default;
SolvedMarginals::~SolvedMarginals() = default;

void SolvedMarginals::analyze(std::span<const std::int32_t> sizes) {
  sizes_.assign(sizes.begin(), sizes.end());
  offsets_.assign(1, 0);
  for (const std::int32_t rows : sizes) offsets_.push_back(offsets_.back() + rows);
}

void SolvedMarginals::columns(std::span<const std::int64_t> scalars, std::span<double> X) {
  std::ranges::fill(X, 0.0);
  for (std::int64_t k = 0; k < std::ssize(scalars); ++k) X[k * size() + scalars[k]] = 1.0;
  if (auto* many = query<ManyRightHandSides>(*solver_))
    return many->solve(X, X, static_cast<int>(scalars.size()));
  for (std::int64_t k = 0; k < std::ssize(scalars); ++k) {
    const std::span<double> x = X.subspan(k * size(), size());
    solver_->solve(x, x);
  }
}

/// Blocks by solves for their columns, several block columns in one go.
void SolvedMarginals::fetch(std::vector<Wanted>& wanted, std::span<double> out) {
  std::ranges::stable_sort(wanted, {}, &Wanted::column);
  std::vector<std::int64_t> scalars;
  for (std::size_t first = 0; first < wanted.size();) {
    scalars.clear();
    std::size_t last = first;
    std::int32_t column = -1;
    for (; last < wanted.size(); ++last) {
      const std::int32_t next = wanted[last].column;
      if (next == column) continue;
      if (!scalars.empty() && std::ssize(scalars) + sizes_[next] > kTogether) break;
      for (std::int64_t k = offsets_[next]; k < offsets_[next + 1]; ++k) scalars.push_back(k);
      column = next;
    }
    X_.resize(size() * std::ssize(scalars));
    columns(scalars, X_);
    std::int64_t begin = 0;  // of the block column in X
    for (; first < last; ++first) {
      const Wanted& block = wanted[first];
      const std::int64_t rows = sizes_[block.row], cols = sizes_[block.column];
      while (scalars[begin] != offsets_[block.column]) ++begin;
      for (std::int64_t c = 0; c < cols; ++c) {
        const double* from = X_.data() + (begin + c) * size() + offsets_[block.row];
        for (std::int64_t r = 0; r < rows; ++r)
          out[block.target + (block.transpose ? r * cols + c : c * rows + r)] = from[r];
      }
    }
  }
}

void SolvedMarginals::diagonal_blocks(std::span<double> out) {
  std::vector<Wanted> wanted;
  std::int64_t target = 0;
  for (std::int32_t b = 0; b < std::ssize(sizes_); ++b) {
    wanted.push_back({b, b, false, target});
    target += values(b, b);
  }
  check_size(out, target);
  fetch(wanted, out);
}

void SolvedMarginals::block_column(int block, std::span<double> out) {
  check_size(out, size() * sizes_[block]);
  std::vector<std::int64_t> scalars;
  for (std::int64_t k = offsets_[block]; k < offsets_[block + 1]; ++k) scalars.push_back(k);
  columns(scalars, out);
}

/// Whether the pairs' first blocks are fewer than their second ones.
bool SolvedMarginals::by_first(std::span<const Pair> pairs) const {
  std::vector<bool> first(sizes_.size()), second(sizes_.size());
  for (const Pair& pair : pairs) {
    first[pair.first] = true;
    second[pair.second] = true;
  }
  return std::ranges::count(first, true) < std::ranges::count(second, true);
}

std::int64_t SolvedMarginals::columns_of(std::span<const Pair> pairs) const {
  const bool first = by_first(pairs);
  std::vector<bool> seen(sizes_.size());
  std::int64_t count = 0;
  for (const Pair& pair : pairs) {
    const std::int32_t column = first ? pair.first : pair.second;
    if (!seen[column]) count += sizes_[column];
    seen[column] = true;
  }
  return count;
}

void SolvedMarginals::blocks(std::span<const Pair> pairs, std::span<double> out) {
  const bool first = by_first(pairs);
  std::vector<Wanted> wanted;
  std::int64_t target = 0;
  for (const Pair& pair : pairs) {
    wanted.push_back(
        {first ? pair.second : pair.first, first ? pair.first : pair.second, first, target});
    target += values(pair.first, pair.second);
  }
  check_size(out, target);
  fetch(wanted, out);
}

}  // namespace cairn
