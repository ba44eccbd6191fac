// SPDX-License-Identifier: BSD-3-Clause
#include "pcg/subgraph.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include "iterative/vectors.hpp"
#include "pcg/spanning_tree.hpp"

namespace cairn {
namespace {

constexpr double kFirstShift = 1e-3;
constexpr double kLargestShift = 1e6;

}  // namespace

Subgraph::Subgraph(std::unique_ptr<LinearSolver> solver, double extra)
    : solver_(std::move(solver)), extra_(extra) {}

void Subgraph::analyze(const BlockStructure& structure) {
  structure_ = &structure;
  part_.reset();
  part_of_H_ = {};
  by_factors_ = false;
  largest_shift_ = 0.0;
}

void Subgraph::choose(const BlockMatrix& H, const iterative::DiagonalBlocks& diagonal) {
  const BlockStructure& s = *structure_;
  const auto extra = static_cast<std::int64_t>(std::llround(extra_ * s.blocks()));
  const std::vector<std::int64_t> kept = choose_subgraph(s, coupling_strengths(H, diagonal), extra);
  kept_ = static_cast<std::int64_t>(kept.size());
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  source_.clear();
  marked_.assign(static_cast<std::size_t>(s.entries()), 0);
  for (const std::int64_t entry : kept) marked_[entry] = 1;
  auto next = kept.begin();
  for (std::int32_t j = 0; j < s.blocks(); ++j) {
    source_.push_back(s.column_begin()[j]);
    for (; next != kept.end() && *next < s.column_begin()[j + 1]; ++next) {
      source_.push_back(*next);
      pairs.emplace_back(s.rows()[*next], j);
    }
  }
  part_.emplace(std::vector<std::int32_t>(s.sizes().begin(), s.sizes().end()), std::move(pairs));
  M_ = BlockMatrix(*part_);
  solver_->analyze(*part_);
}

void Subgraph::copy(const BlockMatrix& H, double shift) {
  for (std::int64_t e = 0; e < part_->entries(); ++e) {
    std::copy_n(H.block(source_[e]), part_->value_begin()[e + 1] - part_->value_begin()[e],
                M_.block(e));
  }
  if (shift == 0.0) return;
  for (int j = 0; j < part_->blocks(); ++j) {
    double* block = M_.block(part_->column_begin()[j]);
    for (int k = 0; k < part_->block_size(j) * part_->block_size(j); ++k) block[k] *= 1.0 + shift;
  }
}

Factorization Subgraph::factorize(const BlockMatrix& H, const iterative::DiagonalBlocks& diagonal,
                                  const NormalBlocks* factors) {
  if (!part_) choose(H, diagonal);
  by_factors_ = factors != nullptr && factorize_kept(*factors);
  if (by_factors_) return {};
  Factorization factorization;
  for (double shift = 0.0; shift < kLargestShift; shift = std::max(10.0 * shift, kFirstShift)) {
    copy(H, shift);
    factorization = solver_->factorize(M_);
    if (!factorization.ok) continue;
    largest_shift_ = std::max(largest_shift_, shift);
    return factorization;
  }
  return factorization;
}

/// False if the factors that are kept do not determine every unknown.
bool Subgraph::factorize_kept(const NormalBlocks& factors) {
  if (part_of_H_.values().empty()) part_of_H_ = BlockMatrix(*structure_);
  factors.assemble_part(marked_, part_of_H_);
  copy(part_of_H_, 0.0);
  return solver_->factorize(M_).ok;
}

double Subgraph::apply(std::span<const double> r, std::span<double> z) {
  solver_->solve(r, z);
  return iterative::dot(r, z);
}

std::string Subgraph::note() const {
  std::string note = "subgraph preconditioner";
  if (part_) {
    note += fmt::format(" with {} of {} off-diagonal blocks", kept_,
                        structure_->entries() - structure_->blocks());
  }
  if (part_ && !by_factors_) note += " and the whole diagonal";
  if (largest_shift_ > 0.0)
    note += fmt::format(", broke down and was shifted by up to {:g}", largest_shift_);
  return note;
}

}  // namespace cairn
