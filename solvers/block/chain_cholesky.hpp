// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "block/chains.hpp"
#include "block/refined_cholesky.hpp"
#include "block/selected_inverse.hpp"

namespace cairn::block {

/// Cholesky factorisation that eliminates chains of blocks first, many side by side in the lanes of
/// vectors, and leaves what remains to `RefinedCholesky`: the Schur complement on the separators,
/// which it orders too. Where a graph has few chains it is `RefinedCholesky` alone. The chains
/// themselves are in double precision in any case.
///
/// Chains have nothing to do with each other, so threads share their groups; what they add to the
/// separators is added in the order of the chains. So the result does not depend on the number of
/// threads.
class ChainCholesky {
 public:
  /// As for `RefinedCholesky`.
  explicit ChainCholesky(std::string_view kernels = "auto",
                         Precision precision = Precision::in_double);

  /// As for `SupernodalCholesky`; chains are looked for if `ordering` is auto.
  void analyze(const BlockStructure& structure, std::string_view ordering);
  Factorization factorize(const BlockMatrix& H);
  void solve(std::span<const double> g, std::span<double> x);
  void solve(std::span<const double> G, std::span<double> X, int columns);
  void inverse_columns(std::span<const std::int64_t> scalars, std::span<double> X);
  double log_determinant();

  /// Element k is the block eliminated k-th.
  std::span<const std::int32_t> order() const { return order_; }
  std::int64_t factor_nonzeros() const;
  double factor_flops() const;
  /// What to know of the last analysis and, in mixed precision, of what followed.
  std::string description() const;
  const std::string& ordering() const { return rest_.cholesky().ordering(); }
  const RefinedCholesky& rest() const { return rest_; }
  const Chains& chains() const { return chains_; }

 private:
  friend class ChainInverse;
  void solve_together(std::span<const double> G, std::span<double> X, int columns);
  Factorization failure(int group, unsigned lanes) const;
  void add_ends_to_rest(const BlockMatrix& H);
  std::int64_t panel_numbers() const {
    const std::int64_t d = chains_.block_size();
    return d * (d + 1) / 2 + 2 * d * d;
  }
  const double* panel(int group) const {
    return panels_.data() + chains_.group_begin(group) * panel_numbers();
  }
  const ChainKernels& chain_kernels() const {
    return kernels_->chains[chains_.block_size() == 3 ? 0 : 1];
  }

  const Kernels* kernels_;
  const BlockStructure* structure_ = nullptr;
  std::uint64_t version_ = 0;
  Chains chains_;
  RefinedCholesky rest_;
  BlockMatrix schur_;  // on the separators
  std::vector<std::int32_t> order_;
  UninitializedVector panels_;         // of the chains
  UninitializedVector ends_;           // what each chain adds to its separators' blocks
  UninitializedVector y_, ends_of_g_;  // as panels_ and ends_, of right-hand sides
  std::vector<unsigned> failed_;       // by group
  std::vector<double> G_rest_;
  bool factorized_ = false;
};

/// The blocks of Z = H⁻¹ where the L of a `ChainCholesky` has blocks: `SelectedInverse` on the
/// separators, then its recursion along each chain from its last node to its first.
class ChainInverse {
 public:
  /// `cholesky` must outlive this object.
  explicit ChainInverse(ChainCholesky& cholesky)
      : cholesky_(&cholesky), rest_(cholesky.rest_.cholesky()) {}

  /// As for `SelectedInverse`.
  void compute();
  void diagonal_blocks(std::span<double> out) const;
  bool block(std::int32_t i, std::int32_t j, double* out) const;

 private:
  template <int D>
  void invert(std::size_t chain);
  bool on_chain(std::int32_t i, std::int32_t j, double* out) const;

  ChainCholesky* cholesky_;
  SelectedInverse rest_;
  /// By node of a chain: Z with itself, with the next one and with the chain's first separator.
  std::vector<double> blocks_;
  std::vector<std::int32_t> chain_of_,
      place_of_;  // by block: -1; its chain, and its node in `nodes`
};

}  // namespace cairn::block
